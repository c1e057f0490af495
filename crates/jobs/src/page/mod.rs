//! A page of a mesh, a grid, lines or a cloud, to be looked at in a browser: one HTML file that holds what it shows; or of
//! tiles, which it asks a server of their folder for.
//!
//! What a page shows is held in memory, here and in the browser, so its size has limits: [`MOST_TRIANGLES`],
//! [`MOST_VERTICES`] of lines. A grid is shown by every n-th of its samples ([`MOST_SAMPLES`]), a cloud by some of its
//! points ([`MOST_POINTS`]), which the page says.

mod cloud;
mod errors;
mod facts;
mod few;
mod insertion;
mod lattice;
mod lines;
mod solid;
mod surface;
mod tiles;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::figures::Figures;
use crate::input::{self, Surface};
use crate::memory::{beside_program, cache_beside, short};
use crate::options::GridInput;
use crate::{Cancel, Progress, Resources};
pub use cloud::{MOST_POINTS, USUAL_POINTS};
pub use insertion::MOST_SIDE;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud::{Census, OpenOptions};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_page::Page;
use terrane_raster::Inputs;
pub use tiles::is_tiles;

/// Most triangles of a page.
pub const MOST_TRIANGLES: u64 = 10 << 20;
/// Most vertices of lines on a page.
pub const MOST_VERTICES: u64 = 4 << 20;
/// Most samples that a page shows of a grid.
pub const MOST_SAMPLES: u64 = 3 << 19;

/// What is to be shown.
#[derive(Clone, Debug, PartialEq)]
pub enum Show {
    /// A mesh, with its errors against a grid if there is one; or a grid.
    Surface {
        /// The grid that errors are measured against.
        against: Option<Inputs>,
    },
    /// Greedy insertion on a small grid, step by step.
    Insertion,
    /// Lines, with all of their simplifications.
    Lines {
        /// The object of a TopoJSON file; its first one when `None`.
        layer: Option<String>,
    },
    /// Points of a cloud.
    Cloud {
        /// How it is read, and which points.
        open: Box<OpenOptions>,
        /// How many of them are shown, at most [`MOST_POINTS`].
        points: u64,
    },
    /// Tiles of the globe's terrain, as a server of the folder sends them.
    Tiles,
}

/// A page to make.
#[derive(Clone, Debug)]
pub struct PageJob {
    /// Grid files, a mesh, lines or clouds, or synthetic ones by name.
    pub input: Inputs,
    /// What is read of a grid.
    pub reading: GridInput,
    /// What is shown of it.
    pub show: Show,
    /// HTML file to write.
    pub output: PathBuf,
    /// Replace an existing page.
    pub overwrite: bool,
    /// Edges of triangles are shown from the start.
    pub edges: bool,
    /// Where the light comes from at the start: degrees clockwise from north.
    pub azimuth: f64,
    /// Degrees of the light above the horizon.
    pub altitude: f64,
    /// Factor on heights at the start; the page chooses when `None`.
    pub exaggeration: Option<f64>,
    /// West, south, east, north of the part to show.
    pub bbox: Option<[f64; 4]>,
    /// What the job may use.
    pub resources: Resources,
}

/// What is on a page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PageReport {
    pub input: String,
    pub output: String,
    /// The kind of page.
    pub page: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<u64>,
    /// Lines and rings, and the features they are of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub features: Option<u64>,
    /// Points of a cloud that are shown, and what became of all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub census: Option<Census>,
    /// Levels of tiles, and how many tiles there are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<u64>,
    /// Of a grid: every so many-th sample is shown, along rows and columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride: Option<u32>,
    /// West, south, east, north of what is shown.
    pub bounds: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowest: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highest: Option<f64>,
    /// The largest distance of a vertex on the page from where it is in the file, along any axis.
    pub rounding: f64,
    /// The largest error of a triangle, where errors were measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_error: Option<f64>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: Figures,
}

/// Makes a page.
///
/// # Errors
/// Usage for an option that does not go with the input; a surface beyond [`MOST_TRIANGLES`]; a cloud without points;
/// too little memory; and what the readers find.
pub fn run(job: &PageJob, progress: &dyn Progress, cancel: &Cancel) -> Result<PageReport> {
    let started = Instant::now();
    refuse_existing(&job.output, job.overwrite)?;
    let made = match &job.show {
        Show::Surface { against } => surface(job, against.as_ref(), progress, cancel),
        Show::Insertion => insertion(job, cancel),
        Show::Lines { layer } => lines::page(layer.as_ref(), job, progress, cancel),
        Show::Cloud { open, points } => cloud::page((open, *points), job, progress, cancel),
        Show::Tiles => tiles::page(job),
    };
    let (page, report) = made.map_err(|error| match error.kind() {
        ErrorKind::BadInput | ErrorKind::Usage | ErrorKind::Unsupported => {
            error.in_file(Path::new(&job.input.to_string()))
        }
        _ => error,
    })?;
    cancel.check()?;
    let output_bytes = write(job, page)?;
    let (input, output) = (job.input.to_string(), job.output.display().to_string());
    Ok(PageReport {
        input,
        output,
        output_bytes,
        run: Figures::since(started, &job.resources),
        ..report
    })
}

fn surface(
    job: &PageJob,
    against: Option<&Inputs>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(Page, PageReport)> {
    let options = job.reading.options(&job.resources, cache_beside(job.resources.memory))?;
    match (input::open(job.input.names(), &options)?, against) {
        (Surface::Grid(_), Some(_)) => {
            Err(Error::usage("‹against› is for a mesh, and this is a grid")
                .remedy("leave ‹against› out, or make a mesh of the grid with `terrane tin`"))
        }
        (Surface::Grid(grid), None) => lattice::page(grid.as_ref(), job, progress, cancel),
        (Surface::Mesh(mesh), _) => surface::page(mesh.as_ref(), against, job, progress, cancel),
    }
}

fn insertion(job: &PageJob, cancel: &Cancel) -> Result<(Page, PageReport)> {
    let options = job.reading.options(&job.resources, cache_beside(job.resources.memory))?;
    match input::open(job.input.names(), &options)? {
        Surface::Grid(grid) => insertion::page(grid.as_ref(), job, cancel),
        Surface::Mesh(_) => Err(Error::usage("samples of a grid are inserted, and this is a mesh")
            .remedy("name the grid that it was made from")),
    }
}

fn write(job: &PageJob, page: Page) -> Result<u64> {
    let html = page.html();
    let mut file = AtomicFile::create(&job.output, job.overwrite)?;
    file.write_all(html.as_bytes()).map_err(|e| Error::write(&job.output, e))?;
    file.commit()
}

/// Fails when a page of what takes `need` bytes does not fit.
fn within_memory(need: u64, what: &str, resources: &Resources) -> Result<()> {
    if need <= beside_program(resources.memory) {
        return Ok(());
    }
    let enough = need + (resources.memory - beside_program(resources.memory));
    let mib = enough.div_ceil(1 << 20);
    Err(short(format!("a page of {what} takes {mib} MiB of memory"), enough))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;

    /// A page of nothing in particular.
    pub(super) fn job(show: Show, memory: u64) -> PageJob {
        PageJob {
            input: "synth:rough,size=65".into(),
            reading: GridInput::default(),
            show,
            output: "page.html".into(),
            overwrite: false,
            edges: false,
            azimuth: 315.0,
            altitude: 45.0,
            exaggeration: None,
            bbox: None,
            resources: Resources { memory, ..Resources::default() },
        }
    }

    #[test]
    fn what_does_not_go_together_is_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let run = |show: Show, memory: u64| {
            let job = PageJob { output: folder.path().join("a.html"), ..job(show, memory) };
            run(&job, &Silent, &Cancel::default())
        };
        let against = Show::Surface { against: Some("synth:rough,size=65".into()) };
        assert_eq!(run(against, 1 << 30).unwrap_err().kind(), ErrorKind::Usage);
        let grid = || Show::Surface { against: None };
        assert_eq!(run(grid(), 1 << 20).unwrap_err().kind(), ErrorKind::Resource);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let report = run(grid(), 1 << 30).unwrap();
        assert_eq!((report.vertices, report.triangles), (Some(65 * 65), Some(2 * 64 * 64)));
        let written = std::fs::metadata(folder.path().join("a.html")).unwrap().len();
        assert_eq!(written, report.output_bytes);
    }
}
