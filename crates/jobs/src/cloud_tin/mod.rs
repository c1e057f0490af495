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

mod choose;
mod region_mesh;
mod regions;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use self::choose::{Errors, choose};
use self::regions::Regions;
use self::write::{Written, write};
use crate::figures::Figures;
use crate::memory::PROGRAM;
use crate::placing::{Placed, Placing};
use crate::points::{Filling, PointStore, Tiling};
use crate::tin::{StageReport, horizontal_unit, vertical_unit};
use crate::{Cancel, Progress, Resources, peak_memory, workers};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Frame, Point, Point3};
use terrane_cloud::{self as cloud, Census, CloudInfo, OpenOptions, PointSource};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_files::folder_for;
use terrane_mesh::{
    self as mesh, MeshFormat, MeshHeader, MeshSink, SinkOptions, check_prj, write_prj,
};

/// Most points of a region, unless a single square holds more.
const REGION_POINTS: u64 = 1 << 17;
/// How the memory is divided.
struct Division {
    /// Eighths for points that wait, for vertices that wait, and for the program and its workers.
    points: u64,
    vertices: u64,
    workers: u64,
    /// Bytes that a worker takes for each point of a region, its surroundings, its mesh and what of it
    /// waits to be written included.
    point_bytes: u64,
}

/// Where vertices are chosen among the points, and where every point is one: the mesh is larger then,
/// and no vertices wait beside the points.
const CHOSEN: Division = Division { points: 4, vertices: 1, workers: 3, point_bytes: 320 };
const ALL: Division = Division { points: 2, vertices: 0, workers: 6, point_bytes: 600 };

impl Division {
    fn of(tolerance: f64) -> &'static Self {
        if tolerance == 0.0 { &ALL } else { &CHOSEN }
    }
}

/// Fewest bytes for points and vertices that wait.
const LEAST_SHARED: u64 = 8 << 20;

/// A cloud-to-TIN job.
#[derive(Clone, Debug)]
pub struct CloudTinJob {
    /// Files, folders, patterns or lists.
    pub inputs: Vec<String>,
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
    /// Measure largest error and RMSE for the report.
    pub measure: bool,
    /// What the job may use.
    pub resources: Resources,
}

/// What a cloud-to-TIN job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
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

/// What every stage works with.
pub(super) struct Work<'a> {
    points: &'a PointStore,
    regions: &'a Regions,
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
    if !(job.tolerance >= 0.0 && job.tolerance.is_finite()) {
        return Err(Error::usage(format!("{} is no maximum error", job.tolerance))
            .remedy("give a number of 0 or more, in the unit of the heights"));
    }
    refuse_existing(&job.output, job.overwrite)?;
    let format = mesh::by_path(&job.output, job.format.as_deref())?;
    let source = cloud::source(&job.inputs, &job.options)?;
    drop(AtomicFile::create(&job.output, job.overwrite)?);
    check_prj(&job.output, &source.info().crs, job.overwrite)?;
    let mut report = make(job, &*source, format, progress, cancel)?;
    report.files = source.files().len() as u64;
    report.notes.extend_from_slice(source.notes());
    report.notes.extend(source.info().crs.lost_in_wkt());
    report.run.wall_seconds = started.elapsed().as_secs_f64();
    report.points_per_second = report.run.rate(report.points.read);
    Ok(report)
}

/// Triangulates any source of points into the job's output.
pub(super) fn make(
    job: &CloudTinJob,
    source: &dyn PointSource,
    format: &'static MeshFormat,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudTinReport> {
    let info = source.info();
    let bounds = info.bounds.ok_or_else(no_surface)?;
    let mut header = header(job, info, bounds, format)?;
    let (placed, notes) =
        job.placing.place(&info.crs, (header.bounds, info.frame.scale), format)?;
    header.scale = placed.scale;
    header.origin = placed.origin(header.origin, header.bounds);
    let options = SinkOptions { overwrite: job.overwrite, ..SinkOptions::default() };
    let options = SinkOptions { temp_dir: job.resources.temp_dir.clone(), ..options };
    let sink = || (format.create)(&job.output, &header, &options);
    let mut clock = Clock::default();
    let folder = folder_for(&job.output, job.resources.temp_dir.as_deref());
    let filling = Filling {
        threads: job.resources.threads.max(1),
        memory: job.resources.memory / 8 * Division::of(job.tolerance).points,
        folder,
        progress,
        cancel,
    };
    let points = PointStore::fill(source, Tiling::new(bounds, info.count), &filling)?;
    clock.lap("read", points.census().read);
    let regions = Regions::new(&points, REGION_POINTS);
    let threads = threads(job, regions.most_points())?;
    let vertex_bytes = job.resources.memory / 8 * Division::of(job.tolerance).vertices;
    let measure = job.measure;
    let work = Work {
        points: &points,
        regions: &regions,
        threads,
        vertex_bytes,
        measure,
        folder,
        progress,
        cancel,
    };
    let tolerance = in_steps(job.tolerance, info.frame.scale[2]);
    let made = triangulate(&work, tolerance, &info.frame, sink, &mut clock)?;
    let prj = write_prj(&job.output, &info.crs, job.overwrite)?;
    let report = report(job, info, &work, &made, format, prj, clock);
    Ok(CloudTinReport { placed: Some(placed).filter(Placed::is_local), notes, ..report })
}

/// A tolerance in steps. What is a whole number of steps but for rounding is meant to be whole.
fn in_steps(tolerance: f64, step: f64) -> f64 {
    let steps = tolerance / step;
    let whole = steps.round();
    if (steps - whole).abs() <= whole * 1e-12 { whole } else { steps }
}

/// What came of the work.
struct Made {
    written: Written,
    errors: Errors,
    stacked: u64,
    spilled: u64,
}

fn triangulate(
    work: &Work<'_>,
    tolerance: f64,
    frame: &Frame,
    sink: impl FnOnce() -> Result<Box<dyn MeshSink>>,
    clock: &mut Clock,
) -> Result<Made> {
    let kept = work.points.census().kept;
    let hull = work.points.hull()?.corners();
    if hull.len() < 3 {
        return Err(no_surface());
    }
    if tolerance == 0.0 {
        let written = write(work, work.points, &hull, frame, sink()?)?;
        clock.lap("write", kept);
        let (stacked, spilled) = (kept - written.vertices, work.points.spilled());
        return Ok(Made { written, errors: Errors::default(), stacked, spilled });
    }
    let (vertices, errors) = choose(work, tolerance, &hull)?;
    clock.lap("choose", kept);
    let written = write(work, &vertices, &hull, frame, sink()?)?;
    clock.lap("write", written.vertices);
    let spilled = work.points.spilled() + vertices.spilled();
    Ok(Made { written, errors, stacked: kept - errors.points, spilled })
}

/// Workers that fit in what the points leave of the memory.
fn threads(job: &CloudTinJob, most_points: u64) -> Result<usize> {
    let Division { points, workers, point_bytes, .. } = Division::of(job.tolerance);
    let (eighth, worker) = (job.resources.memory / 8, (most_points * point_bytes).max(1));
    let fitting = (eighth * workers).saturating_sub(PROGRAM) / worker;
    if fitting == 0 || eighth * points < LEAST_SHARED {
        let eighth = (worker + PROGRAM).div_ceil(*workers).max(LEAST_SHARED.div_ceil(*points));
        let needed = (8 * eighth).div_ceil(1 << 20);
        let message = format!("at least {needed} MiB of memory are needed");
        return Err(Error::new(ErrorKind::Resource, message)
            .remedy(format!("pass --memory {needed}M or more")));
    }
    Ok(job.resources.threads.clamp(1, usize::try_from(fitting).unwrap_or(usize::MAX)))
}

fn no_surface() -> Error {
    Error::bad_input("the points have no surface: fewer than three, or all on a line")
        .remedy("look at the filters, or at the files with `terrane info`")
}

fn header(
    job: &CloudTinJob,
    info: &CloudInfo,
    bounds: [Point; 2],
    format: &MeshFormat,
) -> Result<MeshHeader> {
    let [low, high] = bounds;
    let middle = |a: i32, b: i32| i32::midpoint(a, b);
    let centre = Point::new(middle(low.x, high.x), middle(low.y, high.y), middle(low.z, high.z));
    if format.single_precision {
        check_single(bounds, centre, format)?;
    }
    let unit = vertical_unit(&info.crs).map(|unit| format!(" {unit}")).unwrap_or_default();
    let comments = vec![
        format!("source {}", job.inputs.join(" ")),
        format!("max error {}{unit}", job.tolerance),
    ];
    let bounds: [Point3; 2] = bounds.map(|corner| info.frame.world(corner));
    let (crs, origin) = (info.crs.clone(), info.frame.world(centre));
    Ok(MeshHeader { crs, origin, scale: [1.0; 3], bounds, comments, channels: Vec::new() })
}

/// Fails where f32 does not tell one step from the next.
fn check_single(bounds: [Point; 2], centre: Point, format: &MeshFormat) -> Result<()> {
    let far = |a: i32, b: i32| a.abs_diff(b) >= 1 << 23;
    let is_far = |p: Point| far(p.x, centre.x) || far(p.y, centre.y) || far(p.z, centre.z);
    if !bounds.into_iter().any(is_far) {
        return Ok(());
    }
    let message = format!("{} stores f32, which does not hold a cloud of this extent", format.name);
    Err(Error::usage(message).remedy("write PLY or OBJ, or a part of the cloud with --bounds"))
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
    job: &CloudTinJob,
    info: &CloudInfo,
    work: &Work<'_>,
    made: &Made,
    format: &MeshFormat,
    prj: Option<PathBuf>,
    clock: Clock,
) -> CloudTinReport {
    let Made { written, errors, .. } = made;
    let step = info.frame.scale[2];
    let measured = |steps: f64| job.measure.then_some(steps * step);
    let census = *work.points.census();
    CloudTinReport {
        input: job.inputs.join(" "),
        output: job.output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        horizontal_unit: horizontal_unit(&info.crs).to_owned(),
        vertical_unit: vertical_unit(&info.crs).unwrap_or("units").to_owned(),
        tolerance: job.tolerance,
        max_error: measured(errors.most),
        rmse: measured((errors.squares / errors.points.max(1) as f64).sqrt()),
        points: census,
        stacked_points: made.stacked,
        vertices: written.vertices,
        triangles: written.triangles,
        kept: written.vertices as f64 / census.kept.max(1) as f64,
        output_bytes: written.bytes,
        prj: prj.map(|path| path.display().to_string()),
        regions: work.regions.all.len() as u64,
        run: Figures {
            threads: work.threads,
            memory_budget: job.resources.memory,
            peak_memory: peak_memory(),
            spilled_bytes: Some(made.spilled),
            wall_seconds: 0.0,
        },
        stages: clock.stages,
        ..CloudTinReport::default()
    }
}
