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
mod region_mesh;
mod regions;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use self::choose::{Chosen, Errors, choose};
use self::keep::{Nearest, nearest};
use self::lines::Lines;
use self::regions::Regions;
use self::write::{Written, write};
use crate::beside;
use crate::breaklines::BreaklinesReport;
use crate::figures::Figures;
use crate::kept::{Features, KeptReport};
use crate::memory::PROGRAM;
use crate::on_cloud::OnCloud;
use crate::placing::{Placed, Placing};
use crate::points::{Filling, PointStore, Tiling};
use crate::sift::Losses;
use crate::tin::{FlawReport, StageReport, horizontal_unit, vertical_unit};
use crate::{Cancel, Progress, Resources, peak_memory, workers};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Frame, Point, Point3};
use terrane_cloud::{self as cloud, Census, CloudInfo, OpenOptions, PointSource};
use terrane_delaunay::Hull;
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_files::{folder_for, path_of};
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
/// The same where lines have posts beside them.
const ALL_AND_POSTS: Division = Division { points: 2, vertices: 2, workers: 4, point_bytes: 600 };

impl Division {
    fn of(tolerance: f64, kept: &OnCloud) -> &'static Self {
        match (tolerance == 0.0, kept.has_lines()) {
            (false, _) => &CHOSEN,
            (true, false) => &ALL,
            (true, true) => &ALL_AND_POSTS,
        }
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
    /// The name of a file of features; the point of the cloud nearest to each point of it is a vertex.
    pub keep_points: Option<String>,
    /// The name of a file of lines and polygons that edges follow.
    pub breaklines: Option<String>,
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
    if !(job.tolerance >= 0.0 && job.tolerance.is_finite()) {
        return Err(Error::usage(format!("{} is no maximum error", job.tolerance))
            .remedy("give a number of 0 or more, in the unit of the heights"));
    }
    refuse_existing(&job.output, job.overwrite)?;
    let format = mesh::by_path(&job.output, job.format.as_deref())?;
    let source = cloud::source(&job.inputs, &job.options)?;
    drop(AtomicFile::create(&job.output, job.overwrite)?);
    check_prj(&job.output, &source.info().crs, job.overwrite)?;
    let [points, lines] = [&job.keep_points, &job.breaklines].map(Option::as_deref);
    let features = Features::read_for_cloud(points, lines, &job.resources)?;
    let mut report = make(job, &*source, features, format, progress, cancel)?;
    report.files = source.files().len() as u64;
    report.notes.extend_from_slice(source.notes());
    report.notes.extend(Losses::of(&*source).notes());
    report.notes.extend(source.info().crs.lost_in_wkt());
    report.run.wall_seconds = started.elapsed().as_secs_f64();
    report.points_per_second = report.run.rate(report.points.read);
    Ok(report)
}

/// Triangulates any source of points into the job's output.
pub(super) fn make(
    job: &CloudTinJob,
    source: &dyn PointSource,
    features: Features,
    format: &'static MeshFormat,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudTinReport> {
    let info = source.info();
    let bounds = info.bounds.ok_or_else(no_surface)?;
    let kept = features.on_cloud(info, bounds)?;
    let mut header = header(job, info, kept.and_heights(bounds), format)?;
    let (placed, notes) =
        job.placing.place(&info.crs, (header.bounds, info.frame.scale), format)?;
    header.scale = placed.scale;
    header.unit.clone_from(&placed.unit);
    header.origin = placed.origin(header.origin, header.bounds);
    let options = SinkOptions { overwrite: job.overwrite, ..SinkOptions::default() };
    let options = SinkOptions { temp_dir: job.resources.temp_dir.clone(), ..options };
    let sink = || (format.create)(&job.output, &header, &options);
    let memory = job.resources.memory.saturating_sub(kept.bytes());
    let division = Division::of(job.tolerance, &kept);
    let mut clock = Clock::default();
    let folder = folder_for(&job.output, job.resources.temp_dir.as_deref());
    let filling = Filling {
        threads: job.resources.threads.max(1),
        memory: memory / 8 * division.points,
        folder,
        within: None,
        progress,
        cancel,
    };
    let points = PointStore::fill(source, Tiling::new(bounds, info.count), &filling)?;
    clock.lap("read", points.census().read);
    let hull = points.hull()?;
    if hull.is_flat() {
        return Err(no_surface());
    }
    let mut lines = Lines::new(&kept, hull.clone(), points.tiling());
    let followed = kept.followed(|line| lines.is_outside(line), 0)?;
    let regions = Regions::new(&points, &lines.by_square(points.tiling()), REGION_POINTS);
    lines.divide(&regions, points.tiling());
    let nearest = nearest_points(&kept, &points, &hull, bounds)?;
    let count = nearest.points.len() as u64;
    let kept_points = kept.kept(nearest.beyond, count, count)?;
    let held = kept.bytes() + lines.bytes();
    let threads = threads(job, division, regions.most_points(), lines.most_bytes(), held)?;
    let vertex_bytes = job.resources.memory.saturating_sub(held) / 8 * division.vertices;
    let measure = job.measure;
    let work = Work {
        points: &points,
        regions: &regions,
        lines: &lines,
        threads,
        vertex_bytes,
        measure,
        folder,
        progress,
        cancel,
    };
    let tolerance = in_steps(job.tolerance, info.frame.scale[2]);
    let made = triangulate(
        &work,
        tolerance,
        (&hull.corners(), &nearest.points),
        &info.frame,
        sink,
        &mut clock,
    )?;
    let prj = write_prj(&job.output, &info.crs, job.overwrite)?;
    let report = report(job, info, &work, &made, format, prj, clock);
    let apart = made.apart.len() as u64;
    let breaklines = followed.map(|followed| BreaklinesReport { apart, ..followed });
    let placed = Some(placed).filter(Placed::is_local);
    Ok(CloudTinReport { placed, notes, keep_points: kept_points, breaklines, ..report })
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

/// Workers that fit in what the points leave of the memory, of which so many bytes are held all the while.
fn threads(
    job: &CloudTinJob,
    division: &Division,
    most_points: u64,
    most_lines: u64,
    held: u64,
) -> Result<usize> {
    let Division { points, workers, point_bytes, .. } = division;
    let worker = (most_points * point_bytes + most_lines).max(1);
    let eighth = job.resources.memory.saturating_sub(held) / 8;
    let fitting = (eighth * workers).saturating_sub(PROGRAM) / worker;
    if fitting == 0 || eighth * points < LEAST_SHARED {
        let eighth = (worker + PROGRAM).div_ceil(*workers).max(LEAST_SHARED.div_ceil(*points));
        let needed = (8 * eighth + held).div_ceil(1 << 20);
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
    let mut comments = vec![
        format!("source {}", job.inputs.join(" ")),
        format!("max error {}{unit}", job.tolerance),
    ];
    let beside = [("keep points", &job.keep_points), ("breaklines", &job.breaklines)];
    comments.extend(beside.into_iter().filter_map(|(what, name)| {
        Some(format!("{what} {}", beside::label(&path_of(name.as_deref()?))))
    }));
    let bounds: [Point3; 2] = bounds.map(|corner| info.frame.world(corner));
    let (crs, origin) = (info.crs.clone(), info.frame.world(centre));
    Ok(MeshHeader {
        crs,
        origin,
        scale: [1.0; 3],
        unit: None,
        bounds,
        comments,
        channels: Vec::new(),
    })
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
        apart: made.apart.first().map(|&[x, y]| {
            let [x, y, _] = info.frame.world(Point::new(x, y, 0));
            FlawReport { count: made.apart.len() as u64, first: Some([x, y]) }
        }),
        ..CloudTinReport::default()
    }
}
