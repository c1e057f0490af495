//! The whole job: points in, regions, vertices, and the mesh out.

use std::time::Instant;

use super::context::CloudTinContext;
use super::job::{CloudTinJob, CloudTinReport};
use super::lines::CloudLines;
use super::nearest_points::{ConstraintPoints, nearest};
use super::prepared::PreparedCloudTin;
use super::regions::{CloudTinRegions, REGION_POINTS, no_surface};
use super::vertex_selection::{ChosenVertices, CloudTinErrors, select};
use super::write::{WrittenCloudTin, write};
use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::{self as cloud, PointSource, ReturnCounts};
use terrane_delaunay::ConvexHull;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::cloud_constraints::OnCloud;
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::local_frame::StorageScale;
use terrane_engine::memory::with_polygons;
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::{Cancel, Progress};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_mesh::{MeshFormat, MeshSink, check_prj, write_prj};
use terrane_terrain::tin::{FlawReport, StageReport};

/// Runs a job from files to file.
///
/// # Errors
/// As [`cloud::open`]; `Usage` for an invalid tolerance; `BadInput` if the points do not form a surface;
/// `CannotWrite` and `Io` from the output and the temporary files; `Resource` when the memory does not suffice;
/// `Interrupted`.
pub fn run(job: &CloudTinJob, progress: &dyn Progress, cancel: &Cancel) -> Result<CloudTinReport> {
    let started = Instant::now();
    job.check()?;
    refuse_existing(&job.output, job.overwrite)?;
    let format = job.format()?;
    let source = cloud::source(job.inputs.names(), &job.options)?;
    drop(AtomicFile::create(&job.output, job.overwrite)?);
    check_prj(&job.output, &source.info().crs, job.overwrite)?;
    let [points, lines] = [&job.keep_points, &job.breaklines].map(Option::as_deref);
    let features = ConstraintFeatures::read_for_cloud(points, lines, &job.resources)?;
    let at = RunControl { progress, cancel };
    let mut report = with_polygons(&job.options, &job.resources, |resources| {
        let job = CloudTinJob { resources, ..job.clone() };
        make(&job, &*source, features, format, REGION_POINTS, at)
    })?;
    report.run.memory_budget = job.resources.memory;
    report.of_source(&*source, &LostPoints::of(&*source), started);
    Ok(report)
}

/// Triangulates any source of points into the output of the job, in regions of at most `max_points` points.
pub fn make(
    job: &CloudTinJob,
    source: &dyn PointSource,
    features: ConstraintFeatures,
    format: &'static MeshFormat,
    max_points: u64,
    at: RunControl<'_>,
) -> Result<CloudTinReport> {
    let ready = PreparedCloudTin::new(job, &job.label(), source, features, format)?;
    let (constraints, mut clock) = (&ready.constraints, CloudTinClock::default());
    let points = PointStore::fill(source, ready.tiling(), &ready.filling(at))?;
    clock.lap("read", points.census().read);
    let hull = points.hull()?;
    if hull.is_flat() {
        return Err(no_surface());
    }
    let mut lines = CloudLines::new(constraints, hull.clone(), points.tiling());
    let followed = constraints.breaklines_report(|line| lines.is_outside(line), 0)?;
    let regions = CloudTinRegions::new(&points, &lines.by_square(points.tiling()), max_points);
    lines.divide(&regions, points.tiling());
    let nearest = nearest_points(constraints, &points, &hull, ready.bounds)?;
    let count = nearest.points.len() as u64;
    let keep_points = constraints.points_report(nearest.beyond, count, count)?;
    let resident_bytes = constraints.bytes() + lines.bytes();
    let work = ready.work(&points, &regions, &lines, resident_bytes, at)?;
    let outcome = triangulate(
        &work,
        ready.tolerance(),
        &hull.corners(),
        &nearest.points,
        &ready.info.frame,
        || ready.sink(),
        &mut clock,
    )?;
    let apart = outcome.apart.len() as u64;
    let breaklines = followed.map(|followed| BreaklinesReport { apart, ..followed });
    let report = report(&ready, &work, *points.census(), &outcome, clock)?;
    Ok(CloudTinReport { keep_points, breaklines, ..report })
}

/// The points nearest to the positions to keep.
fn nearest_points(
    constraints: &OnCloud,
    points: &PointStore,
    hull: &ConvexHull,
    [low, _]: [Point; 2],
) -> Result<ConstraintPoints> {
    let positions = constraints.points.iter();
    let positions = positions
        .map(|[x, y]| [low.x.saturating_add_unsigned(*x), low.y.saturating_add_unsigned(*y)]);
    nearest(points, hull, positions.collect())
}

/// Result of the work.
pub(super) struct CloudTinOutcome {
    pub(super) written: WrittenCloudTin,
    pub(super) errors: CloudTinErrors,
    pub(super) stacked: u64,
    pub(super) spilled: u64,
    /// Vertices on lines without an edge along them.
    pub(super) apart: Vec<[i32; 2]>,
}

fn triangulate(
    work: &CloudTinContext<'_>,
    tolerance: f64,
    hull: &[Point],
    nearest: &[Point],
    frame: &PointFrame,
    sink: impl FnOnce() -> Result<Box<dyn MeshSink>>,
    clock: &mut CloudTinClock,
) -> Result<CloudTinOutcome> {
    let kept = work.points.census().kept;
    if tolerance == 0.0 && work.lines.is_empty() {
        let written = write(work, work.points, hull, frame, sink()?)?;
        clock.lap("write", kept);
        let (stacked, spilled) = (kept - written.vertices, work.points.spilled());
        let apart = Vec::new();
        return Ok(CloudTinOutcome {
            written,
            errors: CloudTinErrors::default(),
            stacked,
            spilled,
            apart,
        });
    }
    let ChosenVertices { vertices, errors, apart } = select(work, tolerance, hull, nearest)?;
    clock.lap("choose", kept);
    let written = write(work, &vertices, hull, frame, sink()?)?;
    clock.lap("write", written.vertices);
    let spilled = work.points.spilled() + vertices.spilled();
    Ok(CloudTinOutcome { written, errors, stacked: kept - errors.points, spilled, apart })
}

/// Times of the stages.
#[derive(Debug)]
pub(super) struct CloudTinClock {
    last: Instant,
    stages: Vec<StageReport>,
}

impl Default for CloudTinClock {
    fn default() -> Self {
        Self { last: Instant::now(), stages: Vec::new() }
    }
}

impl CloudTinClock {
    /// Ends a stage that handled `points`.
    pub(super) fn lap(&mut self, name: &str, points: u64) {
        let thread_seconds = self.last.elapsed().as_secs_f64();
        self.stages.push(StageReport { name: name.to_owned(), thread_seconds, samples: points });
        self.last = Instant::now();
    }
}

pub(super) fn report(
    ready: &PreparedCloudTin<'_>,
    work: &CloudTinContext<'_>,
    points: ReturnCounts,
    outcome: &CloudTinOutcome,
    clock: CloudTinClock,
) -> Result<CloudTinReport> {
    let PreparedCloudTin { job, info, format, .. } = ready;
    let CloudTinOutcome { written, errors, .. } = outcome;
    let prj = write_prj(&job.output, &info.crs, job.overwrite)?;
    let rmse = (errors.squares / errors.points.max(1) as f64).sqrt();
    let [max_error, rmse] =
        [errors.max, rmse].map(|steps| work.measure.then_some(steps * info.frame.scale[2]));
    Ok(CloudTinReport {
        input: ready.label.clone(),
        output: job.output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        horizontal_unit: info.crs.horizontal_units().to_owned(),
        vertical_unit: info.crs.heights_unit().unwrap_or("units").to_owned(),
        tolerance: job.tolerance,
        max_error,
        rmse,
        points,
        stacked_points: outcome.stacked,
        vertices: written.vertices,
        triangles: written.triangles,
        kept: written.vertices as f64 / points.kept.max(1) as f64,
        output_bytes: written.bytes,
        prj: prj.map(|path| path.display().to_string()),
        placed: Some(ready.placed.clone()).filter(StorageScale::is_local),
        regions: work.regions.all.len() as u64,
        run: RunStatistics::since(Instant::now(), &job.resources)
            .with_threads(work.threads)
            .with_spilled(outcome.spilled),
        stages: clock.stages,
        apart: outcome.apart.first().map(|&[x, y]| {
            let [x, y, _] = info.frame.world(Point::new(x, y, 0));
            FlawReport { count: outcome.apart.len() as u64, first: Some([x, y]) }
        }),
        notes: ready.notes.clone(),
        ..CloudTinReport::default()
    })
}

#[cfg(test)]
mod tests;
