//! Interactive pages of a mesh, a grid, lines or a point cloud: one self-contained HTML file. A page of tiles requests them
//! from a server of their folder.
//!
//! The data of a page is held in memory, here and in the browser, so its size has limits: [`MAX_TRIANGLES`],
//! [`MAX_VERTICES`] of lines. A grid is shown by every n-th of its samples ([`MAX_SAMPLES`]), a cloud by some of its
//! points ([`MAX_POINTS`]), as the page notes.

mod cloud;
mod errors;
mod facts;
mod grid_sample;
mod insertion;
mod lines;
mod options;
mod point_sample;
mod solid;
mod surface;
mod tiles;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use crate::html::HtmlPage;
use crate::view::Lighting;
pub use cloud::MAX_POINTS;
pub use insertion::MOST_SIDE;
pub use options::{
    CloudPageOptions, CloudPageSetters, LinePageOptions, LinePageSetters, PageOptions, PageSetters,
    TilesPageOptions, TilesPageSetters,
};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud::ReturnCounts;
use terrane_engine::memory::{beside_program, short};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Resources};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_raster::Inputs;
pub use tiles::is_tiles;

/// Maximum number of triangles on a page.
pub const MAX_TRIANGLES: u64 = 10 << 20;
/// Maximum number of line vertices on a page.
pub const MAX_VERTICES: u64 = 4 << 20;
/// Maximum number of grid samples on a page.
pub const MAX_SAMPLES: u64 = 3 << 19;

/// Data common to all pages.
#[derive(Clone, Debug)]
pub(crate) struct PageJob<'a> {
    /// Grid files, a mesh, lines, clouds or tiles, or synthetic ones by name.
    pub(crate) input: &'a Inputs,
    /// HTML file to write.
    pub(crate) output: &'a Path,
    /// Replace an existing page.
    pub(crate) overwrite: bool,
    /// Initial lighting.
    pub(crate) lighting: Lighting,
    /// Edges of triangles are shown from the start.
    pub(crate) edges: bool,
    /// Resources of the job.
    pub(crate) resources: &'a Resources,
}

/// Contents of a page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct PageReport {
    pub input: String,
    pub output: String,
    /// The kind of page.
    pub page: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<u64>,
    /// Lines and rings, and their features.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub features: Option<u64>,
    /// Shown points of a cloud, and counts of all points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub census: Option<ReturnCounts>,
    /// Levels of tiles, and number of tiles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<u64>,
    /// For a grid: the step of the shown samples, along rows and columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride: Option<u32>,
    /// West, south, east, north of the shown extent.
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
    pub run: RunStatistics,
}

impl PageJob<'_> {
    /// Adds the initial view.
    fn add_settings(&self, page: &mut HtmlPage) {
        page.fact("azimuth", self.lighting.azimuth);
        page.fact("altitude", self.lighting.altitude);
        page.fact("exaggeration", self.lighting.heights.exaggeration);
        page.fact("edges", self.edges);
    }

    /// Writes a page once it is made.
    ///
    /// # Errors
    /// Usage for an option that the input does not support; an input beyond the limits of pages; too little memory; errors
    /// of the readers.
    fn write(
        &self,
        make: impl FnOnce() -> Result<(HtmlPage, PageReport)>,
        cancel: &Cancel,
    ) -> Result<PageReport> {
        let started = Instant::now();
        refuse_existing(self.output, self.overwrite)?;
        let (page, report) = make().map_err(|error| match error.kind() {
            ErrorKind::BadInput | ErrorKind::Usage | ErrorKind::Unsupported => {
                error.in_file(Path::new(&self.input.to_string()))
            }
            _ => error,
        })?;
        cancel.check()?;
        let mut file = AtomicFile::create(self.output, self.overwrite)?;
        file.write_all(page.html().as_bytes()).map_err(|e| Error::write(self.output, e))?;
        Ok(PageReport {
            input: self.input.to_string(),
            output: self.output.display().to_string(),
            output_bytes: file.commit()?,
            run: RunStatistics::since(started, self.resources),
            ..report
        })
    }
}

/// Fails if a page that takes `need` bytes does not fit into memory.
fn within_memory(need: u64, what: &str, resources: &Resources) -> Result<()> {
    if need <= beside_program(resources.memory) {
        return Ok(());
    }
    let required = need + (resources.memory - beside_program(resources.memory));
    let mib = required.div_ceil(1 << 20);
    Err(short(format!("a page of {what} needs {mib} MiB of memory"), required))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_engine::operation::Job;

    /// A page of nothing in particular.
    pub(super) fn job<'a>(input: &'a Inputs, resources: &'a Resources) -> PageJob<'a> {
        let (output, lighting) = (Path::new("page.html"), Lighting::default());
        PageJob { input, output, overwrite: false, lighting, edges: false, resources }
    }

    /// Resources with this memory limit.
    pub(super) fn within(memory: u64) -> Resources {
        Resources { memory, ..Resources::default() }
    }

    #[test]
    fn what_does_not_go_together_is_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let terrain = "synth:rough,size=65";
        let run = |against: Option<&str>, memory: u64| {
            let (against, resources) = (against.map(str::to_owned), within(memory));
            let options = PageOptions { against, resources, ..PageOptions::default() };
            Job::new(Inputs::from(terrain), options).write(folder.path().join("a.html"))
        };
        assert_eq!(run(Some(terrain), 1 << 30).unwrap_err().kind(), ErrorKind::Usage);
        assert_eq!(run(None, 1 << 20).unwrap_err().kind(), ErrorKind::Resource);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let report = run(None, 1 << 30).unwrap();
        assert_eq!((report.vertices, report.triangles), (Some(65 * 65), Some(2 * 64 * 64)));
        let written = std::fs::metadata(folder.path().join("a.html")).unwrap().len();
        assert_eq!(written, report.output_bytes);
    }
}
