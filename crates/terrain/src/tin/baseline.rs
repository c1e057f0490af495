//! Meshes of a grid by textbook methods: read whole, triangulated on one thread, written.

use std::time::Instant;

use super::goal::TinGoal;
use super::job::TinJob;
use super::make::{OpenedTinJob, TinMaker, in_input, options};
use super::report::{StageReport, TinReport};
use super::run::TinOutcome;
use super::window::HeightBuffers;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Point3, Rect};
use terrane_baselines::{
    BaselineGoal, BaselineMethod, BaselineTask, BaselineTin, HeightGrid, MOST_SIDE, MethodPromise,
    PackedSample, SampleStatistics, TriangulationRule,
};
use terrane_engine::{Cancel, Progress, Resources, memory};
use terrane_files::atomic::refuse_existing;
use terrane_mesh::{MeshBatch, MeshSink};
use terrane_raster::GridOpenOptions;
use terrane_tin::TinSpec;

/// A textbook method and its triangulation.
#[derive(Clone, Copy, Debug)]
pub struct TextbookMethod {
    /// The method.
    pub method: &'static BaselineMethod,
    /// The triangulation, for methods that support several.
    pub triangulation: TriangulationRule,
}

/// Vertices or triangles that are written at a time.
const BATCH: usize = 1 << 16;

/// Runs a job from file to file by a textbook method; options of tiles and dropping are ignored. The mesh
/// states the tolerance if the method guarantees one, and its true error otherwise.
///
/// # Errors
/// Those of [`run`](super::run); `Limit` for a grid with a side of more than 2^14 samples, `Resource` for one
/// that does not fit into memory; both before any sample is read.
pub fn run_by(
    job: &TinJob,
    by: &TextbookMethod,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TinReport> {
    let started = Instant::now();
    job.goal.check()?;
    if job.refinement.files() != [None; 2] {
        let message =
            format!("the method {} does not support points to keep or breaklines", by.method.name);
        return Err(Error::usage(message).remedy("leave them out, or leave out ‹method›"));
    }
    refuse_water(job, by.method.name)?;
    refuse_existing(&job.output, job.overwrite)?;
    let method = WholeGridMethod {
        what: by.method.name.to_owned(),
        sample_bytes: by.method.sample_bytes,
        otherwise: "leave out ‹method›".to_owned(),
    };
    let mut opened = OpenedTinJob::with(job, || {
        open(job, &options(job)?, &method).map_err(|error| in_input(error, &job.input))
    })?;
    opened.carried.triangulation = other_triangles(by);
    let maker = TinMaker { job, opened: &opened, progress, cancel };
    let mut report = make(&maker, by).map_err(|error| in_input(error, &job.input))?;
    report.took(started.elapsed());
    Ok(report)
}

/// Name of the triangulation, if it is not Delaunay.
fn other_triangles(by: &TextbookMethod) -> Option<&'static str> {
    match by.method.is_delaunay {
        true if by.triangulation == TriangulationRule::Delaunay => None,
        true => Some(by.triangulation.name()),
        false => Some(by.method.name),
    }
}

/// A method on the whole grid in memory.
pub(super) struct WholeGridMethod {
    /// Its name in errors.
    pub(super) what: String,
    /// Most bytes for a sample, the result included.
    pub(super) sample_bytes: u64,
    /// An alternative if the grid does not fit into memory.
    pub(super) otherwise: String,
}

/// Fails if water is to be flattened: `what` does not insert edges along banks.
pub(super) fn refuse_water(job: &TinJob, what: &str) -> Result<()> {
    match job.reading.water {
        None => Ok(()),
        Some(_) => {
            let message = format!("the method {what} does not support ‹water›");
            Err(Error::usage(message)
                .remedy("leave it out, or flatten the grid first: ‹terrane convert› with ‹water›"))
        }
    }
}

/// Opens the input; fails if it does not fit into memory.
pub(super) fn open(
    job: &TinJob,
    options: &GridOpenOptions,
    method: &WholeGridMethod,
) -> Result<memory::Opened> {
    let resources = &job.resources;
    let source = memory::open_for_estimate(&job.input, options)?;
    let (width, height) = (source.info().width, source.info().height);
    terrane_baselines::check_sides(width, height).map_err(|e| {
        e.remedy(format!("{} (its limit is {MOST_SIDE} samples a side)", method.otherwise))
    })?;
    let worker = u64::from(width) * u64::from(height) * (method.sample_bytes + READ_BYTES);
    let min_memory = memory::least(worker, source.block_bytes());
    if min_memory > resources.memory {
        return Err(too_large(method, [width, height], min_memory, resources));
    }
    memory::open(&job.input, options, &Resources { threads: 1, ..resources.clone() }, worker)
}

/// Bytes for a sample while the grid is read.
pub(super) const READ_BYTES: u64 = 20;

fn too_large(
    method: &WholeGridMethod,
    [width, height]: [u32; 2],
    min_memory: u64,
    resources: &Resources,
) -> Error {
    let grid_memory = resources.memory.saturating_sub(memory::least(0, 0));
    let side = (grid_memory / (method.sample_bytes + READ_BYTES)).isqrt();
    let message = format!(
        "{} holds the whole grid in memory: {width} x {height} samples need {} MiB, {} MiB are allowed",
        method.what,
        min_memory.div_ceil(1 << 20),
        resources.memory >> 20
    );
    let smaller = format!("use a grid of at most {side} x {side} samples, or {}", method.otherwise);
    memory::short(message, min_memory).or(&smaller)
}

fn make(maker: &TinMaker<'_>, by: &TextbookMethod) -> Result<TinReport> {
    maker.check_output()?;
    let mut stages = StageTimes::default();
    let mut window = HeightBuffers::default();
    let heights = stages.time(maker, "read", || read(maker, &mut window))?;
    let info = maker.opened.source.info();
    let extent = Rect::new(0, 0, info.width, info.height);
    let (suspects, odd_range) = (window.suspects(extent, info), window.odd_range());
    drop(window);
    let grid = HeightGrid::new(info.width, info.height, &heights, maker.opened.rounding())?;
    let tin = stages.time(maker, "method", || triangulate(maker, by, grid))?;
    maker.opened.format.check_capacity(tin.vertices.len() as u64, tin.triangles.len() as u64)?;
    let mesh = SampleMesh {
        vertices: &tin.vertices,
        triangles: &tin.triangles,
        to_world: &info.transform,
    };
    let max_error = stated(maker.job.goal, by.method, &tin);
    let report = maker.complete(max_error, 0, |sink, _| {
        let output_bytes = stages.time(maker, "write", || {
            mesh.write(|at| grid.vertex(at), |_| std::iter::empty(), sink)
        })?;
        let known = TinOutcome { suspects, odd_range, ..outcome(&tin) };
        Ok(TinOutcome { output_bytes, stages: stages.0, ..known })
    })?;
    let triangulation = by.method.takes_triangulation.then(|| by.triangulation.to_string());
    Ok(TinReport {
        method: Some(by.method.name.to_owned()),
        triangulation,
        tiles: 1,
        tile_cells: info.width.max(info.height) - 1,
        max_error: Some(tin.max_error),
        rmse: Some((tin.square_sum / surface(&tin.census)).sqrt()),
        ..report
    })
}

/// The bound that the mesh states.
fn stated(goal: TinGoal, method: &BaselineMethod, tin: &BaselineTin) -> f64 {
    match goal {
        TinGoal::MaxError(tolerance) if method.promise == MethodPromise::Samples => tolerance,
        _ => tin.max_error,
    }
}

/// Samples on the surface.
pub(super) fn surface(census: &SampleStatistics) -> f64 {
    (census.valid - census.isolated).max(1) as f64
}

fn outcome(tin: &BaselineTin) -> TinOutcome {
    TinOutcome {
        vertices: tin.vertices.len() as u64,
        triangles: tin.triangles.len() as u64,
        valid: tin.census.valid,
        isolated: tin.census.isolated,
        max_error: tin.max_error,
        square_sum: tin.square_sum,
        ..TinOutcome::default()
    }
}

/// All heights, checked like those of tiles.
fn read(maker: &TinMaker<'_>, window: &mut HeightBuffers) -> Result<Vec<f64>> {
    maker.cancel.check()?;
    let info = maker.opened.source.info();
    window.read(&*maker.opened.source, Rect::new(0, 0, info.width, info.height))?;
    if let TinGoal::MaxError(tolerance) = maker.job.goal {
        window.check_rounding(&TinSpec { ..maker.spec(tolerance) })?;
    }
    Ok(all_heights(window))
}

/// All heights that a window has, exact.
pub(super) fn all_heights(window: &HeightBuffers) -> Vec<f64> {
    let heights = window.heights();
    match heights.f64 {
        Some(exact) => exact.to_vec(),
        None => heights.f32.iter().map(|&height| f64::from(height)).collect(),
    }
}

/// The goal, converted for methods.
pub(super) fn baseline_goal(goal: TinGoal) -> BaselineGoal {
    match goal {
        TinGoal::MaxError(tolerance) => BaselineGoal::MaxError(tolerance),
        TinGoal::MaxVertices(count) => BaselineGoal::MaxVertices(count),
        TinGoal::MaxTriangles(count) => BaselineGoal::MaxTriangles(count),
    }
}

fn triangulate(
    maker: &TinMaker<'_>,
    by: &TextbookMethod,
    grid: HeightGrid<'_>,
) -> Result<BaselineTin> {
    let goal = baseline_goal(maker.job.goal);
    (by.method.run)(&BaselineTask {
        triangulation: by.triangulation,
        pulse: &|| maker.cancel.check(),
        ..BaselineTask::new(grid, goal)
    })
}

/// A mesh on the samples of a grid.
pub(super) struct SampleMesh<'a> {
    pub(super) vertices: &'a [PackedSample],
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) to_world: &'a Affine,
}

impl SampleMesh<'_> {
    /// Writes vertices and then triangles, in batches, counter-clockwise in the world: `height` gives the
    /// elevation of a sample, `values` its attributes.
    pub(super) fn write<V: Iterator<Item = f64>>(
        &self,
        height: impl Fn(PackedSample) -> f64,
        values: impl Fn(PackedSample) -> V,
        mut sink: Box<dyn MeshSink>,
    ) -> Result<u64> {
        for batch in self.vertices.chunks(BATCH) {
            let vertices: Vec<Point3> =
                batch.iter().map(|&at| self.position(at, height(at))).collect();
            let values: Vec<f64> = batch.iter().flat_map(|&at| values(at)).collect();
            let (vertices, values) = (&vertices, &values);
            sink.push(MeshBatch { vertices, values, triangles: &[], corners: &[] })?;
        }
        // Rows of a north-up grid run south: its transform mirrors, which turns corners clockwise.
        let is_mirrored = self.to_world.determinant() < 0.0;
        for batch in self.triangles.chunks(BATCH) {
            let turned =
                batch.iter().map(|&[a, b, c]| if is_mirrored { [a, c, b] } else { [a, b, c] });
            let triangles: Vec<[u64; 3]> = turned.map(|ids| ids.map(u64::from)).collect();
            let by_position = if sink.wants_corners() { &triangles[..] } else { &[] };
            let samples = by_position.iter().map(|ids| ids.map(|id| self.vertices[id as usize]));
            let corners: Vec<[Point3; 3]> =
                samples.map(|samples| samples.map(|at| self.position(at, height(at)))).collect();
            sink.push(MeshBatch {
                vertices: &[],
                values: &[],
                triangles: &triangles,
                corners: &corners,
            })?;
        }
        sink.finish()
    }

    /// The world position of a sample.
    fn position(&self, at: PackedSample, height: f64) -> Point3 {
        let [x, y] = self.to_world.apply(f64::from(at.col()), f64::from(at.row()));
        [x, y, height]
    }
}

/// Stages and their times.
#[derive(Default)]
pub(super) struct StageTimes(pub(super) Vec<StageReport>);

impl StageTimes {
    pub(super) fn time<T>(
        &mut self,
        maker: &TinMaker<'_>,
        name: &str,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        let info = maker.opened.source.info();
        let samples = u64::from(info.width) * u64::from(info.height);
        maker.progress.begin(name, samples);
        let started = Instant::now();
        let done = work();
        maker.progress.end();
        let thread_seconds = started.elapsed().as_secs_f64();
        self.0.push(StageReport { name: name.to_owned(), thread_seconds, samples });
        done
    }
}
