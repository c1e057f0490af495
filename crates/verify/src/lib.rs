//! Proves a written mesh against its source grid, or the cloud it was made from, out of core.
//!
//! Three passes: vertices and triangles (and the points of a cloud) are spread over rectangles of
//! the plane through temporary files; then each rectangle is checked by itself ([`terrane_proof`]). Nothing in the report but
//! times and memory depends on threads, memory budget, or the order of work.

mod bands;
mod cloud;
mod found;
mod header;
mod lines;
mod options;
mod parts;
mod quality;
mod report;
mod spread;
mod squares;
#[cfg(feature = "tiles")]
pub mod tiles;
mod vertices;

use std::path::{Path, PathBuf};
use std::time::Instant;

use bytemuck::Pod;

use self::header::{Header, judge_bounds};
use terrane_base::bound::Bound;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Crs;
use terrane_baselines::{METHODS, Triangulation};
use terrane_engine::bands::{Joined, label};
use terrane_engine::figures::Figures;
use terrane_engine::kept::{Features, Kept};
use terrane_engine::memory::{PROGRAM, beside_program, cache_beside, short};
use terrane_engine::proof::Verdict;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::Buckets;
use terrane_mesh::{self as mesh, HeightBand, MeshInfo, MeshSource, Promises};
use terrane_proof::{Layout, Precision, Snapper};
use terrane_raster::{self as raster, GridSource};

pub use bands::{AskedBands, BandProof};
pub use cloud::{CloudVerifyReport, OfCloud, prove_cloud};
pub use found::{FaultReport, MeshReport, Original};
pub use lines::{LineVerifyJob, LineVerifyReport, verify_lines};
use options::Proving;
pub use options::{
    CloudMeshProof, CloudMeshProofSetters, Gone, LineProof, LineProofSetters, MeshProof,
    MeshProofSetters,
};
pub use quality::{
    Against, AngleReport, AspectReport, Below, DegreeReport, Measured, QualityReport, SlopeReport,
    quality,
};
pub use report::{OfGrid, Place, VerifyReport};

/// Least memory a verification can work in, and least for each thread.
const LEAST_MEMORY: u64 = 1 << 20;

/// Runs a verification. An error means that it could not be done; a mesh that breaks a promise is
/// no error, but a report with `passed` false.
fn run(
    job: &Proving<'_, MeshProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let bands = job.options.asked_bands()?;
    let mesh = open_mesh(&job.written.file)?;
    let of_bands = bands.as_ref();
    let options = [
        ("max error", "‹max_error›", job.options.tolerance().is_some()),
        ("bound", "‹bound›", job.options.bound.is_some()),
        ("min angle", "‹min_angle›", job.options.min_angle.is_some()),
        ("bands", "‹bands›", of_bands.is_none()),
        ("weights", "‹weights›", of_bands.is_none_or(|asked| !asked.weights.is_empty())),
        ("heights", "‹band›", of_bands.is_none_or(|asked| asked.heights.is_some())),
    ];
    let stated = stated(mesh.info(), &options).map_err(|e| e.in_file(&job.written.file))?;
    check_system(&stated).map_err(|e| e.in_file(&job.written.file))?;
    let (mut report, crs) = match of_bands {
        Some(bands) => {
            let proof = bands::Proof { job, mesh: &*mesh, stated: &stated, progress, cancel };
            in_mesh(proof.run(bands), job)?
        }
        None => heights((&*mesh, &stated), job, progress, cancel)?,
    };
    let header = Header {
        mesh: &job.written.file,
        info: mesh.info(),
        stated: &stated,
        crs: &crs,
        original: "grid",
    };
    header.judge(&mut report.verdict)?;
    judge_bounds(&*mesh, &mut report.verdict, (progress, cancel))?;
    tell_of_files(&stated, job, &mut report.verdict);
    let mesh = job.written.file.display().to_string();
    let of = OfGrid { raster: job.written.original.to_string(), ..report.of };
    Ok(VerifyReport { mesh, of, ..report })
}

/// Fails for a mesh that was taken to another system when it was written.
fn check_system(stated: &Promises) -> Result<()> {
    let Some(from) = &stated.transformed_from else { return Ok(()) };
    let message = format!("was transformed from {from}, where its vertices are samples");
    Err(Error::unsupported(message).remedy("verify the mesh as it is made without ‹to_crs›"))
}

/// What is wrong with the mesh names it.
fn in_mesh<T>(found: Result<T>, job: &Proving<'_, MeshProof>) -> Result<T> {
    found.map_err(|e| match e.kind() {
        ErrorKind::BadInput => e.in_file(&job.written.file),
        _ => e,
    })
}

/// Proves the heights of a mesh; returns the reference system of the grid, too.
fn heights(
    (mesh, stated): (&dyn MeshSource, &Promises),
    job: &Proving<'_, MeshProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(VerifyReport, Crs)> {
    let options = job
        .options
        .grid
        .options(&job.options.resources, cache_beside(job.options.resources.memory))?;
    let grid = raster::open_all(job.written.original.names(), &options)?;
    let crs = grid.info().crs.clone();
    let made_of = stated.bands.as_deref().map(label);
    // What a mesh of bands states is their tolerance.
    let of_heights = tolerance(stated).filter(|_| made_of.is_none());
    let tolerance = job.options.tolerance().or(of_heights);
    let grid = match made_of.filter(|_| stated.heights == Some(HeightBand::None)) {
        None => grid,
        Some(label) if tolerance.is_some() => {
            return Err(Error::usage("the mesh has no heights that could be so far off")
                .in_file(&job.written.file)
                .remedy(format!("pass ‹bands› {label}")));
        }
        Some(_) => Joined::of(grid).flat(),
    };
    let bound = job.options.bound.or(stated.bound).unwrap_or_default();
    let min_angle = job.options.min_angle.or(stated.min_angle);
    check_grid(&*grid).map_err(|e| e.in_file(Path::new(&job.written.original.to_string())))?;
    let [points, lines] =
        [&job.options.constraints.keep_points, &job.options.constraints.breaklines]
            .map(Option::as_deref);
    let water = options.water.as_ref();
    let kept = Features::read(points, lines, water, &job.options.resources)?.on(grid.info())?;
    let asked = Asked { tolerance, bound, min_angle, kept: &kept };
    let report =
        in_mesh(verify(mesh, &*grid, asked, &job.options.resources, progress, cancel), job)?;
    Ok((report, crs))
}

/// What a mesh states; `options` are the key of a statement, the option in its place, and whether it may be wrong, as
/// this is given or nothing is judged by it.
///
/// # Errors
/// Statements that contradict each other, and those that are not valid and that no option replaces: to ignore them
/// would leave promises unjudged.
fn stated(mesh: &MeshInfo, options: &[(&str, &str, bool)]) -> Result<Promises> {
    let stated = mesh.promises()?;
    for line in &stated.invalid {
        let remedy = match options.iter().find(|(key, ..)| line.starts_with(key)) {
            Some((.., true)) => continue,
            Some((_, option, _)) => format!("give {option} in its place"),
            None => "make the mesh again, or remove this comment".to_owned(),
        };
        let message = format!("states \"{line}\", which is not valid");
        return Err(Error::bad_input(message).remedy(remedy));
    }
    Ok(stated)
}

/// The tolerance that a mesh states.
fn tolerance(stated: &Promises) -> Option<f64> {
    stated.max_error.as_ref().map(|error| error.value)
}

/// True unless vertices are connected in a way that is not Delaunay: "triangulation data-dependent", or the
/// name of a method.
///
/// # Errors
/// A name that is not known: to believe it would leave edges unjudged.
fn is_delaunay(stated: &Promises) -> Result<bool> {
    let Some(name) = &stated.triangulation else { return Ok(true) };
    let mut others = METHODS.iter().filter(|method| !method.is_delaunay);
    match name.parse::<Triangulation>() {
        Ok(known) => Ok(known == Triangulation::Delaunay),
        Err(_) if others.any(|method| method.name == *name) => Ok(false),
        Err(_) => {
            Err(Error::bad_input(format!("states \"triangulation {name}\", which is not known"))
                .remedy("make the mesh again, or remove this comment: its edges are judged then"))
        }
    }
}

/// Names bands and files that the mesh was made with, as it states, and that were not given.
fn tell_of_files(stated: &Promises, job: &Proving<'_, MeshProof>, verdict: &mut Verdict) {
    let mut tell = |told: String, left: String| {
        verdict.failures.extend((!verdict.passed).then_some(told));
        verdict.leave(left);
    };
    if let Some(bands) = stated.bands.as_deref().filter(|_| job.options.bands.is_empty()) {
        let label = label(bands);
        tell(
            format!(
                "the mesh states that it was made of bands {label}, and voids of all: pass ‹bands› {label}"
            ),
            bands::not_judged(&label),
        );
    }
    if let Some(clip) = stated.clip.as_deref().filter(|_| job.options.grid.clip.is_none()) {
        tell(
            format!("the mesh states that its grid was clipped to {clip}: pass it with ‹clip›"),
            format!("whether it ends where the polygons of {clip} do (‹clip›)"),
        );
    }
    if let Some(file) = stated.water.as_deref().filter(|_| job.options.grid.water.is_none()) {
        tell(
            format!("the mesh states that the water of {file} is level: pass ‹water›"),
            format!("whether the water of {file} is level (‹water›)"),
        );
    }
    if job.options.bands.is_empty() && stated.bands.is_none() {
        let known = Promises { unknown: Vec::new(), ..stated.clone() }.to_lines();
        let keys = ["bands", "weights", "heights"];
        for line in known.iter().filter(|line| keys.iter().any(|key| line.starts_with(key))) {
            verdict.leave(format!("the statement \"{line}\", without bands"));
        }
    }
    leave_files(
        stated,
        [
            job.options.constraints.keep_points.is_some(),
            job.options.constraints.breaklines.is_some(),
        ],
        verdict,
    );
}

/// Names points and lines of files that a mesh states and that were not given, as not judged.
fn leave_files(stated: &Promises, [points, lines]: [bool; 2], verdict: &mut Verdict) {
    if let Some(file) = stated.keep_points.as_deref().filter(|_| !points) {
        verdict.leave(format!("whether it keeps the points of {file} (‹keep_points›)"));
    }
    if let Some(file) = stated.breaklines.as_deref().filter(|_| !lines) {
        verdict.leave(format!("whether edges follow the lines of {file} (‹breaklines›)"));
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
            .remedy("verify the mesh that is made without ‹base› and ‹co› SOLID_BASE"));
    }
    Ok(mesh)
}

/// What a report says where no bound is known.
const NO_BOUND: &str = "the error, as no bound is known (‹max_error›)";

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
        Figures::since(started, resources).with_threads(self.threads).with_spilled(spilled)
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
        // Each thread needs some of what is left.
        let most = usize::try_from(self.memory / LEAST_MEMORY).unwrap_or(usize::MAX).max(1);
        self.threads = self.threads.min(most);
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
    /// What the mesh states.
    stated: Promises,
    /// Vertices may lie above or below their samples.
    is_fitted: bool,
    /// The mesh states no triangulation that is not Delaunay.
    is_delaunay: bool,
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
        let stated = info.promises()?;
        Ok(Self {
            grid,
            asked,
            is_fitted: stated.fitted.is_some(),
            is_delaunay: is_delaunay(&stated)?,
            stated,
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
        return Err(Error::new(ErrorKind::Resource, message).remedy("pass ‹memory› 1M or more"));
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
