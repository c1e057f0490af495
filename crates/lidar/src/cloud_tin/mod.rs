//! A cloud in, a mesh with a proven error bound out: the job of `terrane tin` on point clouds.
//!
//! The mesh is the Delaunay triangulation of a set of points of the cloud, and nothing else, so it has
//! no seams by its nature: every region computes the triangles it sees and no other, exactly.
//!
//! Regions are blocks of squares of up to 131,072 points. At the end each writes the triangles whose last
//! corner, in the order of regions, is its own. A sparse set of vertices far away (one for so many
//! squares, fewer with the distance) and the corners of the convex hull keep circles small while the
//! neighbourhood is being completed.
//!
//! **Why not borders of real points, as tiles of grids have.** Points do not lie on lines. A chain of
//! points along a border has to be constrained, and leaves slivers that must be mended afterwards.
//! Choosing freely and letting the triangulation decide costs one more pass over the points and has
//! nothing to mend.
//!
//! **Why lines have vertices of their own.** Points of a cloud are where the laser happened to hit; a kerb or a dam is
//! where it was measured. So a line is followed by posts on it (`lines`), not by paths over points as over the
//! samples of a grid. Nothing is forced: the triangulation of points and posts stays the one Delaunay triangulation.

mod choose;
mod keep;
mod lines;
mod options;
pub mod plan;
mod ready;
mod region_mesh;
mod regions;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use self::choose::{Chosen, Errors, choose};
use self::keep::{Nearest, nearest};
use self::lines::Lines;
pub use self::options::{CloudTinOptions, CloudTinSetters};
use self::ready::Ready;
use self::regions::Regions;
use self::write::{Written, write};
use crate::points::PointStore;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Frame, Point};
use terrane_cloud::{self as cloud, Census, OpenOptions, PointSource};
use terrane_delaunay::Hull;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::figures::Figures;
use terrane_engine::kept::{Features, KeptReport};
use terrane_engine::memory::with_polygons;
use terrane_engine::on_cloud::OnCloud;
use terrane_engine::placing::{Placed, Placing};
use terrane_engine::plan::At;
use terrane_engine::sift::Losses;
use terrane_engine::workers;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_mesh::{self as mesh, MeshFormat, MeshSink, check_prj, write_prj};
use terrane_raster::Inputs;
use terrane_terrain::tin::{FlawReport, StageReport};

/// Most points of a region, unless a single square holds more.
const REGION_POINTS: u64 = 1 << 17;
/// A cloud-to-TIN job.
#[derive(Clone, Debug)]
pub struct CloudTinJob {
    /// Files, folders, patterns or lists.
    pub inputs: Inputs,
    /// Which points are wanted, and how they are read.
    pub options: OpenOptions,
    /// Mesh file to write.
    pub output: PathBuf,
    /// Mesh format by name; by the output's ending when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// How the mesh lies in a file of its own coordinates.
    pub placing: Placing,
    /// Largest vertical distance of any point from the mesh; 0 keeps every point.
    pub tolerance: f64,
    /// The name of a file of features; the point of the cloud nearest to each point of it is a vertex.
    pub keep_points: Option<String>,
    /// The name of a file of lines and polygons that edges follow.
    pub breaklines: Option<String>,
    /// Measure largest error and RMSE for the report.
    pub measure: bool,
    /// What the job may use.
    pub resources: Resources,
}

impl CloudTinJob {
    /// A job without anything to keep.
    pub fn new(
        inputs: impl Into<Inputs>,
        output: PathBuf,
        tolerance: f64,
        resources: Resources,
    ) -> Self {
        Self {
            inputs: inputs.into(),
            options: OpenOptions { threads: resources.threads, ..OpenOptions::default() },
            output,
            format: None,
            overwrite: false,
            placing: Placing::default(),
            tolerance,
            keep_points: None,
            breaklines: None,
            measure: false,
            resources,
        }
    }

    /// What the user calls the inputs.
    fn label(&self) -> String {
        self.inputs.label().map_or_else(|| self.inputs.names().join(" "), str::to_owned)
    }

    /// Fails for a tolerance that is none.
    fn check(&self) -> Result<()> {
        match self.tolerance >= 0.0 && self.tolerance.is_finite() {
            true => Ok(()),
            false => Err(Error::usage(format!("{} is no maximum error", self.tolerance))
                .remedy("give a number of 0 or more, in the unit of the heights")),
        }
    }

    /// What is written.
    fn format(&self) -> Result<&'static MeshFormat> {
        mesh::by_path(&self.output, self.format.as_deref())
    }
}

/// What a cloud-to-TIN job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct CloudTinReport {
    pub input: String,
    pub output: String,
    pub format: String,
    pub files: u64,
    pub crs: String,
    pub horizontal_unit: String,
    pub vertical_unit: String,
    pub tolerance: f64,
    /// Largest error of any point, when measured.
    pub max_error: Option<f64>,
    /// Root mean square error, when measured.
    pub rmse: Option<f64>,
    pub points: Census,
    /// Points that lie above another one at the same position: they bind nothing.
    pub stacked_points: u64,
    /// What became of points to keep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<KeptReport>,
    /// What became of breaklines, and
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<BreaklinesReport>,
    /// vertices on them without an edge that goes on along the line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apart: Option<FlawReport>,
    pub vertices: u64,
    pub triangles: u64,
    /// Vertices for each point that was kept.
    pub kept: f64,
    pub output_bytes: u64,
    /// Coordinate reference system beside the mesh, when one was written.
    pub prj: Option<String>,
    /// How the mesh lies in its file, where that has coordinates of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placed: Option<Placed>,
    pub regions: u64,
    #[serde(flatten)]
    pub run: Figures,
    pub points_per_second: f64,
    pub stages: Vec<StageReport>,
    /// What is odd about the cloud.
    pub notes: Vec<String>,
}

impl CloudTinReport {
    /// Adds what the whole cloud tells, and the time since the work was `started`.
    fn of_source(&mut self, source: &dyn PointSource, losses: &Losses, started: Instant) {
        self.files = source.files().len() as u64;
        self.notes.extend_from_slice(source.notes());
        self.notes.extend(losses.notes());
        self.notes.extend(source.info().crs.lost_in_wkt());
        self.run.wall_seconds = started.elapsed().as_secs_f64();
        self.points_per_second = self.run.rate(self.points.read);
    }

    /// What was asked for and is not so, in words.
    pub fn unmet(&self) -> Option<String> {
        let FlawReport { count, first } = self.apart?;
        let [x, y] = first?;
        Some(format!(
            "{count} vertices on breaklines have no edge along them, the first one at x {x}, y {y}"
        ))
    }
}

/// What every stage works with.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    points: &'a PointStore,
    regions: &'a Regions,
    lines: &'a Lines<'a>,
    threads: usize,
    /// Bytes of vertices that may wait in memory.
    vertex_bytes: u64,
    measure: bool,
    folder: &'a Path,
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
}

impl Work<'_> {
    /// Does `work` for every number below `count`, on all threads.
    fn on_all(&self, count: u64, work: impl Fn(&mut (), u64) -> Result<()> + Sync) -> Result<()> {
        workers::run(self.threads, count, self.cancel, || (), work, Ok)
    }
}

/// Runs a job from files to file.
///
/// # Errors
/// As [`cloud::open`]; `Usage` for a tolerance that is none; `BadInput` when the points have no
/// surface; `CannotWrite` and `Io` from the output and the temporary files; `Resource` when the memory
/// does not suffice; `Interrupted`.
pub fn run(job: &CloudTinJob, progress: &dyn Progress, cancel: &Cancel) -> Result<CloudTinReport> {
    let started = Instant::now();
    job.check()?;
    refuse_existing(&job.output, job.overwrite)?;
    let format = job.format()?;
    let source = cloud::source(job.inputs.names(), &job.options)?;
    drop(AtomicFile::create(&job.output, job.overwrite)?);
    check_prj(&job.output, &source.info().crs, job.overwrite)?;
    let [points, lines] = [&job.keep_points, &job.breaklines].map(Option::as_deref);
    let features = Features::read_for_cloud(points, lines, &job.resources)?;
    let at = At { progress, cancel };
    let mut report = with_polygons(&job.options, &job.resources, |resources| {
        let job = CloudTinJob { resources, ..job.clone() };
        make(&job, &*source, (features, format), REGION_POINTS, at)
    })?;
    report.run.memory_budget = job.resources.memory;
    report.of_source(&*source, &Losses::of(&*source), started);
    Ok(report)
}

/// Triangulates any source of points into the job's output, in regions of so many points at the most.
pub fn make(
    job: &CloudTinJob,
    source: &dyn PointSource,
    (features, format): (Features, &'static MeshFormat),
    most: u64,
    at: At<'_>,
) -> Result<CloudTinReport> {
    let ready = Ready::new((job, &job.label()), source, features, format)?;
    let (kept, mut clock) = (&ready.kept, Clock::default());
    let points = PointStore::fill(source, ready.tiling(), &ready.filling(at))?;
    clock.lap("read", points.census().read);
    let hull = points.hull()?;
    if hull.is_flat() {
        return Err(no_surface());
    }
    let mut lines = Lines::new(kept, hull.clone(), points.tiling());
    let followed = kept.followed(|line| lines.is_outside(line), 0)?;
    let regions = Regions::new(&points, &lines.by_square(points.tiling()), most);
    lines.divide(&regions, points.tiling());
    let nearest = nearest_points(kept, &points, &hull, ready.bounds)?;
    let count = nearest.points.len() as u64;
    let kept_points = kept.kept(nearest.beyond, count, count)?;
    let held = kept.bytes() + lines.bytes();
    let work = ready.work((&points, &regions, &lines), held, at)?;
    let made = triangulate(
        &work,
        ready.tolerance(),
        (&hull.corners(), &nearest.points),
        &ready.info.frame,
        || ready.sink(),
        &mut clock,
    )?;
    let apart = made.apart.len() as u64;
    let breaklines = followed.map(|followed| BreaklinesReport { apart, ..followed });
    let report = report(&ready, &work, *points.census(), &made, clock)?;
    Ok(CloudTinReport { keep_points: kept_points, breaklines, ..report })
}

/// The points nearest to those that are to be kept.
fn nearest_points(
    kept: &OnCloud,
    points: &PointStore,
    hull: &Hull,
    [low, _]: [Point; 2],
) -> Result<Nearest> {
    let place = |at: &[u32; 2]| {
        [(at[0], low.x), (at[1], low.y)].map(|(at, low)| low.saturating_add_unsigned(at))
    };
    let positions: Vec<[i32; 2]> = kept.points.iter().map(place).collect();
    nearest(points, hull, &positions)
}

/// What came of the work.
struct Made {
    written: Written,
    errors: Errors,
    stacked: u64,
    spilled: u64,
    /// Vertices on lines without an edge that goes on.
    apart: Vec<[i32; 2]>,
}

fn triangulate(
    work: &Work<'_>,
    tolerance: f64,
    (hull, nearest): (&[Point], &[Point]),
    frame: &Frame,
    sink: impl FnOnce() -> Result<Box<dyn MeshSink>>,
    clock: &mut Clock,
) -> Result<Made> {
    let kept = work.points.census().kept;
    if tolerance == 0.0 && work.lines.is_empty() {
        let written = write(work, work.points, hull, frame, sink()?)?;
        clock.lap("write", kept);
        let (stacked, spilled) = (kept - written.vertices, work.points.spilled());
        let apart = Vec::new();
        return Ok(Made { written, errors: Errors::default(), stacked, spilled, apart });
    }
    let Chosen { vertices, errors, apart } = choose(work, tolerance, hull, nearest)?;
    clock.lap("choose", kept);
    let written = write(work, &vertices, hull, frame, sink()?)?;
    clock.lap("write", written.vertices);
    let spilled = work.points.spilled() + vertices.spilled();
    Ok(Made { written, errors, stacked: kept - errors.points, spilled, apart })
}

fn no_surface() -> Error {
    Error::bad_input("the points have no surface: fewer than three, or all on a line")
        .remedy("look at the filters, or at the files with `terrane info`")
}

/// Times of the stages.
#[derive(Debug)]
struct Clock {
    last: Instant,
    stages: Vec<StageReport>,
}

impl Default for Clock {
    fn default() -> Self {
        Self { last: Instant::now(), stages: Vec::new() }
    }
}

impl Clock {
    /// Ends a stage that handled `points`.
    fn lap(&mut self, name: &str, points: u64) {
        let thread_seconds = self.last.elapsed().as_secs_f64();
        self.stages.push(StageReport { name: name.to_owned(), thread_seconds, samples: points });
        self.last = Instant::now();
    }
}

fn report(
    ready: &Ready<'_>,
    work: &Work<'_>,
    points: Census,
    made: &Made,
    clock: Clock,
) -> Result<CloudTinReport> {
    let Ready { job, info, format, .. } = ready;
    let Made { written, errors, .. } = made;
    let prj = write_prj(&job.output, &info.crs, job.overwrite)?;
    let step = info.frame.scale[2];
    let measured = |steps: f64| work.measure.then_some(steps * step);
    Ok(CloudTinReport {
        input: ready.label.clone(),
        output: job.output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        horizontal_unit: info.crs.horizontal_units().to_owned(),
        vertical_unit: info.crs.heights_unit().unwrap_or("units").to_owned(),
        tolerance: job.tolerance,
        max_error: measured(errors.most),
        rmse: measured((errors.squares / errors.points.max(1) as f64).sqrt()),
        points,
        stacked_points: made.stacked,
        vertices: written.vertices,
        triangles: written.triangles,
        kept: written.vertices as f64 / points.kept.max(1) as f64,
        output_bytes: written.bytes,
        prj: prj.map(|path| path.display().to_string()),
        placed: Some(ready.placed.clone()).filter(Placed::is_local),
        regions: work.regions.all.len() as u64,
        run: Figures::since(Instant::now(), &job.resources)
            .with_threads(work.threads)
            .with_spilled(made.spilled),
        stages: clock.stages,
        apart: made.apart.first().map(|&[x, y]| {
            let [x, y, _] = info.frame.world(Point::new(x, y, 0));
            FlawReport { count: made.apart.len() as u64, first: Some([x, y]) }
        }),
        notes: ready.notes.clone(),
        ..CloudTinReport::default()
    })
}
