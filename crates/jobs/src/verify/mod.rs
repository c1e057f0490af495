//! Proves a written mesh against its source grid, or the cloud it was made from, out of core.
//!
//! Three passes: vertices and triangles (and the points of a cloud) are spread over rectangles of
//! the plane through temporary files; then each rectangle is checked by itself ([`terrane_proof`]). Nothing in the report but
//! times and memory depends on threads, memory budget, or the order of work.

mod bands;
mod cloud;
mod found;
mod lines;
mod parts;
mod quality;
mod report;
mod spread;
mod squares;
pub mod tiles;
mod vertices;

use std::path::{Path, PathBuf};
use std::time::Instant;

use bytemuck::Pod;

use crate::bands::Joined;
use crate::figures::Figures;
use crate::kept::{Features, Kept};
use crate::memory::{PROGRAM, beside_program, cache_beside, short};
use crate::reading::Reading;
use crate::transform::TRANSFORMED;
use crate::{Cancel, Progress, Resources};
use terrane_base::bound::Bound;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Crs, wkt};
use terrane_files::Buckets;
use terrane_mesh::{self as mesh, MeshInfo, MeshSource};
use terrane_proof::{Layout, Precision, Snapper};
use terrane_raster::{self as raster, GridSource, Inputs};

pub use bands::{AskedBands, BandProof};
pub use cloud::{CloudVerifyJob, CloudVerifyReport, OfCloud, prove_cloud, verify_cloud};
pub use found::{FaultReport, MeshReport, Original, Verdict};
pub use lines::{LineVerifyJob, LineVerifyReport, verify_lines};
pub use quality::{
    Against, AngleReport, AspectReport, Below, DegreeReport, Measured, QualityReport, SlopeReport,
    quality,
};
pub use report::{OfGrid, Place, VerifyReport};

/// Least memory a verification can work in, and least for each thread.
const LEAST_MEMORY: u64 = 1 << 20;

/// A mesh to be proven against a raster.
#[derive(Clone, Debug)]
pub struct VerifyJob {
    /// Mesh file.
    pub mesh: PathBuf,
    /// File names, or a synthetic terrain by name.
    pub raster: Inputs,
    /// What is read of it.
    pub reading: Reading,
    /// Largest allowed vertical distance; what the mesh's comments say when `None`.
    pub tolerance: Option<f64>,
    /// What the tolerance is of; what the mesh's comments say when `None`, samples where they say nothing.
    pub bound: Option<Bound>,
    /// The smallest angle that triangles may have in plan, in degrees; what the mesh's comments say when `None`.
    pub min_angle: Option<f64>,
    /// The name of a file of features; the sample nearest to each point of it has to be a vertex.
    pub keep_points: Option<String>,
    /// The name of a file of lines and polygons that edges have to follow.
    pub breaklines: Option<String>,
    /// The bands that the mesh's channels are held to.
    pub bands: Option<AskedBands>,
    /// What the job may use.
    pub resources: Resources,
}

/// Runs a verification. An error means that it could not be done; a mesh that breaks a promise is
/// no error, but a report with `passed` false.
pub fn run(job: &VerifyJob, progress: &dyn Progress, cancel: &Cancel) -> Result<VerifyReport> {
    let mesh = open_mesh(&job.mesh)?;
    check_system(mesh.info()).map_err(|e| e.in_file(&job.mesh))?;
    let mut report = match &job.bands {
        Some(bands) => {
            bands::check_other(job)?;
            let proof = bands::Proof { job, mesh: &*mesh, progress, cancel };
            in_mesh(proof.run(bands), job)?
        }
        None => heights(&*mesh, job, progress, cancel)?,
    };
    tell_of_files(mesh.info(), job, &mut report.verdict);
    let mesh = job.mesh.display().to_string();
    let of = OfGrid { raster: job.raster.to_string(), ..report.of };
    Ok(VerifyReport { mesh, of, ..report })
}

/// Fails for a mesh that was taken to another system when it was written.
fn check_system(info: &MeshInfo) -> Result<()> {
    let Some(from) = stated_text(info, TRANSFORMED) else { return Ok(()) };
    let message = format!("was transformed from {from}, where its vertices are samples");
    Err(Error::unsupported(message).remedy("verify the mesh as it is made without --to-crs"))
}

/// The same by the text beside a mesh that names no system itself.
fn check_same_system(mesh: &Path, grid: &Crs) -> Result<()> {
    let own = wkt::of_srs(&terrane_files::prj(mesh)?);
    if !own.is_named() || !grid.is_named() || own.agrees(grid) {
        return Ok(());
    }
    let [ours, theirs] = grid.told_apart(&own);
    let message = format!("is in {theirs}, and the grid in {ours}");
    Err(Error::bad_input(message).in_file(mesh).remedy("give the grid that it was made of"))
}

/// What is wrong with the mesh names it.
fn in_mesh<T>(found: Result<T>, job: &VerifyJob) -> Result<T> {
    found.map_err(|e| match e.kind() {
        ErrorKind::BadInput => e.in_file(&job.mesh),
        _ => e,
    })
}

/// Proves the heights of a mesh.
fn heights(
    mesh: &dyn MeshSource,
    job: &VerifyJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let options = job.reading.options(&job.resources, cache_beside(job.resources.memory))?;
    let grid = raster::open_all(job.raster.names(), &options)?;
    if mesh.info().crs.is_none() {
        check_same_system(&job.mesh, &grid.info().crs)?;
    }
    let made_of = stated_text(mesh.info(), bands::BANDS);
    let tolerance = match (job.tolerance, made_of) {
        (Some(tolerance), _) => Some(tolerance),
        // What it states is the tolerance of its bands.
        (None, Some(_)) => None,
        (None, None) => stated_tolerance(mesh.info()).map_err(|e| e.in_file(&job.mesh))?,
    };
    let grid = match made_of.filter(|_| bands::is_flat(mesh.info())) {
        None => grid,
        Some(label) if tolerance.is_some() => {
            return Err(Error::usage("the mesh has no heights that could be so far off")
                .in_file(&job.mesh)
                .remedy(format!("pass --bands {label}")));
        }
        Some(_) => Joined::of(grid).flat(),
    };
    let bound = match job.bound {
        Some(bound) => bound,
        None => stated_bound(mesh.info()).map_err(|e| e.in_file(&job.mesh))?,
    };
    let min_angle = match job.min_angle {
        Some(degrees) => Some(degrees),
        None => stated_angle(mesh.info()).map_err(|e| e.in_file(&job.mesh))?,
    };
    check_grid(&*grid).map_err(|e| e.in_file(Path::new(&job.raster.to_string())))?;
    let [points, lines] = [&job.keep_points, &job.breaklines].map(Option::as_deref);
    let water = options.water.as_ref();
    let kept = Features::read(points, lines, water, &job.resources)?.on(grid.info())?;
    let asked = Asked { tolerance, bound, min_angle, kept: &kept };
    in_mesh(verify(mesh, &*grid, asked, &job.resources, progress, cancel), job)
}

/// Names bands and files that the mesh was made with, as it states, and that were not given.
fn tell_of_files(mesh: &MeshInfo, job: &VerifyJob, verdict: &mut Verdict) {
    if let Some(label) = stated_text(mesh, bands::BANDS).filter(|_| job.bands.is_none()) {
        let told = format!(
            "the mesh states that it was made of bands {label}, and voids of all: pass --bands {label}"
        );
        verdict.failures.extend((!verdict.passed).then_some(told));
        verdict.judged = false;
        if job.tolerance.is_none() {
            verdict.not_judged.clear();
        }
        verdict.not_judged.push(bands::not_judged(label));
    }
    if let Some(clip) = stated_text(mesh, CLIP).filter(|_| job.reading.clip.is_none()) {
        let told =
            format!("the mesh states that its grid was clipped to {clip}: pass it with --clip");
        verdict.failures.extend((!verdict.passed).then_some(told));
    }
    if let Some(file) = stated_text(mesh, WATER).filter(|_| job.reading.water.is_none()) {
        verdict.judged = false;
        verdict.not_judged.push(format!("whether the water of {file} is level (--water)"));
        let told = format!("the mesh states that the water of {file} is level: pass --water");
        verdict.failures.extend((!verdict.passed).then_some(told));
    }
    if let Some(file) = stated_text(mesh, KEPT).filter(|_| job.keep_points.is_none()) {
        verdict.judged = false;
        verdict.not_judged.push(format!("whether it keeps the points of {file} (--keep-points)"));
    }
    if let Some(file) = stated_text(mesh, LINES).filter(|_| job.breaklines.is_none()) {
        verdict.judged = false;
        verdict.not_judged.push(format!("whether edges follow the lines of {file} (--breaklines)"));
    }
}

/// Opens a mesh that can be proved. A solid is none: its walls and bottom are no terrain, and nothing
/// tells for sure which triangles they are.
fn open_mesh(path: &Path) -> Result<Box<dyn MeshSource>> {
    let mesh = mesh::open(path)?;
    if mesh.info().solid {
        let message = "is a solid: it has walls and a bottom, which are no terrain to verify";
        return Err(Error::unsupported(message)
            .in_file(path)
            .remedy("verify the mesh that is made without --base and --co SOLID_BASE"));
    }
    Ok(mesh)
}

/// The tolerance a mesh states in a comment: "max error 1.5 metre". A statement that is no bound is
/// an error: to take it for none would leave the errors unjudged.
fn stated_tolerance(info: &MeshInfo) -> Result<Option<f64>> {
    let Some(word) = stated(info, TOLERANCE) else { return Ok(None) };
    match word.parse() {
        Ok(tolerance) if (0.0..f64::INFINITY).contains(&tolerance) => Ok(Some(tolerance)),
        _ => Err(Error::bad_input(format!("states \"{TOLERANCE} {word}\", which is no bound"))
            .remedy("give the bound with --max-error")),
    }
}

/// The smallest angle that the triangles of a mesh have as a comment states it: "min angle 20".
fn stated_angle(info: &MeshInfo) -> Result<Option<f64>> {
    let Some(word) = stated(info, ANGLE) else { return Ok(None) };
    match word.parse() {
        Ok(degrees) if (0.0..=60.0).contains(&degrees) => Ok(Some(degrees)),
        _ => Err(Error::bad_input(format!("states \"{ANGLE} {word}\", which is no angle"))
            .remedy("give the smallest angle with --min-angle")),
    }
}

/// What the tolerance of a mesh is of, as a comment states it: "bound surface". What is not understood is
/// an error: to take it for less would leave a promise unjudged.
fn stated_bound(info: &MeshInfo) -> Result<Bound> {
    let Some(word) = stated(info, BOUND) else { return Ok(Bound::default()) };
    word.parse().map_err(|_| {
        Error::bad_input(format!("states \"{BOUND} {word}\", which is not known"))
            .remedy("say what is to be proved with --bound")
    })
}

/// The word after `key` in a mesh's comments.
fn stated<'a>(info: &'a MeshInfo, key: &str) -> Option<&'a str> {
    stated_text(info, key).map(|rest| rest.split_whitespace().next().unwrap_or_default())
}

/// What comes after `key` in a mesh's comments.
fn stated_text<'a>(info: &'a MeshInfo, key: &str) -> Option<&'a str> {
    info.details.iter().find_map(|(own, value)| {
        let rest = if own == key { value } else { value.trim().strip_prefix(key)? };
        let is_whole_word = rest.is_empty() || own == key || rest.starts_with(char::is_whitespace);
        is_whole_word.then(|| rest.trim())
    })
}

const TOLERANCE: &str = "max error";
const ANGLE: &str = "min angle";
const BOUND: &str = "bound";
const CLIP: &str = "clip";
const WATER: &str = "water";
const KEPT: &str = "keep points";
const LINES: &str = "breaklines";
const FITTED: &str = "fitted";

/// What a report says where no bound is known.
const NO_BOUND: &str = "the error, as no bound is known (--max-error)";

/// What a mesh is held to.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Largest allowed vertical distance; errors are measured, not judged, when `None`.
    pub tolerance: Option<f64>,
    /// What the tolerance is of.
    pub bound: Bound,
    /// The smallest angle that triangles may have in plan, in degrees.
    pub min_angle: Option<f64>,
    /// Samples that have to be vertices, and breaklines.
    pub kept: &'a Kept,
}

impl Asked<'_> {
    /// A tolerance at samples.
    pub fn of_samples(tolerance: Option<f64>) -> Self {
        Self { tolerance, bound: Bound::Samples, min_angle: None, kept: Kept::NONE }
    }
}

/// Proves `mesh` against `grid`. The error between samples is measured whatever the `bound` is. A caller's
/// caches of both are not part of the memory budget, of which this takes about half.
///
/// Errors: a tolerance that is no number, a grid whose map has no inverse, a triangle that refers
/// to a vertex there is not, too little memory, and everything the sources report.
pub fn verify(
    mesh: &dyn MeshSource,
    grid: &dyn GridSource,
    asked: Asked<'_>,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let start = Instant::now();
    let mut work = Work::new(mesh, asked.tolerance, resources, progress, cancel)?;
    work.set_aside(asked.kept.bytes());
    let context = Context::new(work, grid, asked)?;
    let spread = parts::fill(&context)?;
    let tally = parts::check(&context, &spread)?;
    let mut report = report::report(&context, &spread.counts, spread.broken, &tally);
    report.run = context.work.figures(start, resources, spread.bytes());
    report.of.samples_per_second = report.run.rate(report.of.samples);
    Ok(report)
}

/// What a proof works with, whatever the mesh is held against.
struct Work<'a> {
    mesh: &'a dyn MeshSource,
    progress: &'a dyn Progress,
    cancel: Cancel,
    threads: usize,
    /// Bytes for everything held here.
    memory: u64,
    /// Bytes for one thread.
    share: u64,
    /// Bytes that are held beside all that.
    aside: u64,
    /// Where spills go.
    folder: PathBuf,
}

impl<'a> Work<'a> {
    /// Figures of a proof that ends now.
    fn figures(&self, started: Instant, resources: &Resources, spilled: u64) -> Figures {
        let run = Figures::since(started, resources);
        Figures { threads: self.threads, spilled_bytes: Some(spilled), ..run }
    }

    fn new(
        mesh: &'a dyn MeshSource,
        tolerance: Option<f64>,
        resources: &Resources,
        progress: &'a dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self> {
        check_arguments(tolerance, resources)?;
        let most = usize::try_from(resources.memory / LEAST_MEMORY).unwrap_or(usize::MAX);
        let threads = resources.threads.clamp(1, most);
        // The least is enough for a domain that keeps all samples.
        let least = resources.memory.min(LEAST_MEMORY) / 8 * 5;
        // An eighth is left to the allocator.
        let half = beside_program(resources.memory) / 2;
        let memory = (half - half / 8).max(least);
        let folder = resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
        let (cancel, share) = (cancel.clone(), memory / threads as u64);
        Ok(Self { mesh, progress, cancel, threads, memory, share, aside: 0, folder })
    }

    /// Does with so many bytes less, which are held all the while.
    fn set_aside(&mut self, bytes: u64) {
        self.aside += bytes;
        self.memory = self.memory.saturating_sub(bytes);
        self.share = self.memory / self.threads as u64;
    }

    /// The error of what takes so many bytes, more than there are for everything.
    fn short(&self, what: &str, need: u64) -> Error {
        let message = format!("{what}, which takes {} MiB", need.div_ceil(1 << 20));
        let half = (need + self.aside).div_ceil(7) * 8;
        short(message, PROGRAM + 2 * half)
    }

    /// A bucket for each domain, which together hold about `bytes` until they are settled.
    fn buckets<T: Pod>(&self, layout: Layout, bytes: u64) -> Buckets<T> {
        Buckets::new(&self.folder, layout.len() as usize, bytes)
    }
}

/// What every pass over a grid needs to know.
struct Context<'a> {
    work: Work<'a>,
    grid: &'a dyn GridSource,
    asked: Asked<'a>,
    /// The mesh states that its heights are fitted.
    is_fitted: bool,
    snapper: Snapper,
    precision: Precision,
    /// See [`terrane_proof::Part::orientation`].
    orientation: i128,
}

impl<'a> Context<'a> {
    fn new(work: Work<'a>, grid: &'a dyn GridSource, asked: Asked<'a>) -> Result<Self> {
        check_grid(grid)?;
        let (info, map) = (work.mesh.info(), grid.info().transform);
        let size = [grid.info().width, grid.info().height];
        Ok(Self {
            grid,
            asked,
            is_fitted: stated(info, FITTED) == Some("heights"),
            snapper: Snapper::new(map, size, info.origin, info.single_precision),
            precision: match info.single_precision {
                true => Precision::Single { origin: info.origin[2], scale: info.scale[2] },
                false => Precision::Double,
            },
            orientation: if map.determinant() < 0.0 { -1 } else { 1 },
            work,
        })
    }
}

fn check_arguments(tolerance: Option<f64>, resources: &Resources) -> Result<()> {
    if tolerance.is_some_and(|t| !(t >= 0.0 && t.is_finite())) {
        return Err(Error::usage("the tolerance is not a number from 0 up"));
    }
    if resources.memory < LEAST_MEMORY {
        let message = format!("{} bytes of memory are too few", resources.memory);
        return Err(Error::new(ErrorKind::Resource, message).remedy("pass --memory 1M or more"));
    }
    Ok(())
}

fn check_grid(grid: &dyn GridSource) -> Result<()> {
    if !grid.info().transform.is_valid() {
        return Err(Error::bad_input("the raster's map from samples to the world has no inverse"));
    }
    if grid.info().bounds().is_empty() {
        return Err(Error::bad_input("the raster has no samples"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(details: &[(&str, &str)]) -> MeshInfo {
        let details = details.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        MeshInfo { details, ..MeshInfo::plain("test", 0, 0) }
    }

    #[test]
    fn the_tolerance_is_read_from_comments() {
        let stated = |details: &[(&str, &str)]| stated_tolerance(&info(details));
        assert_eq!(stated(&[("max error", "1.5 metre")]).unwrap(), Some(1.5));
        let second = [("comment", "source a.tif"), ("comment", "max error 0.25")];
        assert_eq!(stated(&second).unwrap(), Some(0.25));
        assert_eq!(stated(&[("comment", "max errors are small")]).unwrap(), None);
        assert_eq!(stated(&[]).unwrap(), None);
        for bad in ["max error unknown", "max error -1", "max error NaN", "max error"] {
            assert_eq!(stated(&[("comment", bad)]).unwrap_err().kind(), ErrorKind::BadInput);
        }
    }

    #[test]
    fn the_bound_is_read_from_comments_and_is_that_of_samples_where_they_state_none() {
        let stated = |details: &[(&str, &str)]| stated_bound(&info(details));
        assert_eq!(stated(&[("bound", "surface")]).unwrap(), Bound::Surface);
        let beside = [("comment", "max error 1.5 metre"), ("comment", "bound surface")];
        assert_eq!(stated(&beside).unwrap(), Bound::Surface);
        assert_eq!(stated(&[("comment", "bound samples")]).unwrap(), Bound::Samples);
        assert_eq!(stated(&[("comment", "bounds 0 0 9 9")]).unwrap(), Bound::Samples);
        assert_eq!(stated(&[]).unwrap(), Bound::Samples);
        for bad in ["bound volume", "bound", "bound 1.5"] {
            assert_eq!(stated(&[("comment", bad)]).unwrap_err().kind(), ErrorKind::BadInput);
        }
    }
}
