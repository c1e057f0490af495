//! A grid to a mesh by a method of the textbooks: read whole, triangulated on one thread, written.

use std::time::Instant;

use super::job::{Goal, TinJob};
use super::make::{Maker, Opened, in_input, options};
use super::report::{StageReport, TinReport};
use super::run::Outcome;
use super::window::Window;
use crate::memory;
use crate::{Cancel, Progress, Resources};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Affine, Point3, Rect};
use terrane_files::atomic::refuse_existing;
use terrane_mesh::{MeshBatch, MeshSink};
use terrane_methods::{
    Census, Goal as MethodGoal, Grid, Method, Promise, Task, Tin, Triangulation,
};
use terrane_tin::Spec;

/// A way to make a mesh that is not the engine's own.
#[derive(Clone, Copy, Debug)]
pub struct Textbook {
    /// The method.
    pub method: &'static Method,
    /// How vertices are connected, by methods that leave it open.
    pub triangulation: Triangulation,
}

/// Vertices or triangles that are written at a time.
const BATCH: usize = 1 << 16;

/// Runs a job from file to file by a method of the textbooks: what the job says of tiles, dropping and the
/// like is not looked at. The mesh states the tolerance if the method keeps to one, and its true error
/// otherwise.
///
/// # Errors
/// Those of [`run`](super::run); `Limit` for a grid with a side of more than 2^14 samples, `Resource` for one
/// that the memory does not hold, both before any sample is read.
pub fn run_by(
    job: &TinJob,
    by: &Textbook,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TinReport> {
    let started = Instant::now();
    job.goal.check()?;
    if job.refinement.files() != [None; 2] {
        let message = format!("the method {} keeps no points or breaklines", by.method.name);
        return Err(Error::usage(message).remedy("leave them out, or the method"));
    }
    if job.reading.water.is_some() {
        let message = format!("the method {} follows no banks of water", by.method.name);
        return Err(Error::usage(message).remedy(
            "leave --water or the method out, or flatten the grid first: terrane convert --water",
        ));
    }
    refuse_existing(&job.output, job.overwrite)?;
    let named = |error| in_input(error, &job.input);
    let opened = Opened::with(job, || open(job, by.method).map_err(named))?;
    let maker = Maker { job, opened: &opened, progress, cancel };
    let mut report = make(&maker, by).map_err(named)?;
    report.took(started.elapsed());
    Ok(report)
}

/// Opens the input where the memory holds all of it.
fn open(job: &TinJob, method: &Method) -> Result<memory::Opened> {
    let (options, resources) = (options(job)?, &job.resources);
    let source = memory::look_at(&job.input, &options)?;
    let (width, height) = (source.info().width, source.info().height);
    terrane_methods::check_sides(width, height)?;
    let worker = u64::from(width) * u64::from(height) * (method.sample_bytes + READ_BYTES);
    let least = memory::least(worker, source.block_bytes());
    if least > resources.memory {
        return Err(too_large(method, [width, height], least, resources));
    }
    memory::open(&job.input, &options, &Resources { threads: 1, ..resources.clone() }, worker)
}

/// Bytes for a sample while the grid is read.
const READ_BYTES: u64 = 20;

fn too_large(
    method: &Method,
    [width, height]: [u32; 2],
    least: u64,
    resources: &Resources,
) -> Error {
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let room = resources.memory.saturating_sub(memory::least(0, 0));
    let side = (room / (method.sample_bytes + READ_BYTES)).isqrt();
    let message = format!(
        "{} holds the whole grid: {width} x {height} samples take {} MiB, {} MiB are allowed",
        method.name,
        mib(least),
        resources.memory >> 20
    );
    Error::new(ErrorKind::Resource, message).remedy(format!(
        "pass --memory {}M or more, or a grid of at most {side} x {side} samples, or leave --method out",
        mib(least)
    ))
}

fn make(maker: &Maker<'_>, by: &Textbook) -> Result<TinReport> {
    maker.check_output()?;
    let mut stages = Stages::default();
    let mut window = Window::default();
    let heights = stages.time(maker, "read", || read(maker, &mut window))?;
    let info = maker.opened.source.info();
    let whole = Rect::new(0, 0, info.width, info.height);
    let suspects = window.suspects(whole, info);
    drop(window);
    let grid = Grid::new(info.width, info.height, &heights, maker.opened.rounding())?;
    let tin = stages.time(maker, "method", || triangulate(maker, by, grid))?;
    maker.opened.format.check_capacity(tin.vertices.len() as u64, tin.triangles.len() as u64)?;
    let write = |sink, _| {
        let output_bytes =
            stages.time(maker, "write", || write(&grid, &tin, sink, &info.transform))?;
        Ok(Outcome { suspects, output_bytes, stages: stages.0, ..outcome(&tin) })
    };
    let report = maker.complete(stated(maker.job.goal, by.method, &tin), 0, write)?;
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
fn stated(goal: Goal, method: &Method, tin: &Tin) -> f64 {
    match goal {
        Goal::MaxError(tolerance) if method.promise == Promise::Samples => tolerance,
        _ => tin.max_error,
    }
}

/// Samples on the surface.
fn surface(census: &Census) -> f64 {
    (census.valid - census.isolated).max(1) as f64
}

fn outcome(tin: &Tin) -> Outcome {
    Outcome {
        vertices: tin.vertices.len() as u64,
        triangles: tin.triangles.len() as u64,
        valid: tin.census.valid,
        isolated: tin.census.isolated,
        max_error: tin.max_error,
        square_sum: tin.square_sum,
        ..Outcome::default()
    }
}

/// All heights, checked as those of tiles are.
fn read(maker: &Maker<'_>, window: &mut Window) -> Result<Vec<f64>> {
    maker.cancel.check()?;
    let info = maker.opened.source.info();
    window.read(&*maker.opened.source, Rect::new(0, 0, info.width, info.height))?;
    if let Goal::MaxError(tolerance) = maker.job.goal {
        window.check_rounding(&Spec { ..maker.spec(tolerance) })?;
    }
    let heights = window.heights();
    let narrow = || heights.f32.iter().map(|&height| f64::from(height)).collect();
    Ok(heights.f64.map_or_else(narrow, <[f64]>::to_vec))
}

fn triangulate(maker: &Maker<'_>, by: &Textbook, grid: Grid<'_>) -> Result<Tin> {
    let goal = match maker.job.goal {
        Goal::MaxError(tolerance) => MethodGoal::MaxError(tolerance),
        Goal::MaxVertices(most) => MethodGoal::MaxVertices(most),
        Goal::MaxTriangles(most) => MethodGoal::MaxTriangles(most),
    };
    let pulse = || maker.cancel.check();
    (by.method.run)(&Task {
        triangulation: by.triangulation,
        pulse: &pulse,
        ..Task::new(grid, goal)
    })
}

/// Vertices and then triangles, in batches, counter-clockwise in the world.
fn write(
    grid: &Grid<'_>,
    tin: &Tin,
    mut sink: Box<dyn MeshSink>,
    to_world: &Affine,
) -> Result<u64> {
    let position = |id: u64| {
        let at = tin.vertices[id as usize];
        let [x, y] = to_world.apply(f64::from(at.col()), f64::from(at.row()));
        [x, y, grid.vertex(at)]
    };
    for first in (0..tin.vertices.len()).step_by(BATCH) {
        let last = tin.vertices.len().min(first + BATCH);
        let vertices: Vec<Point3> = (first as u64..last as u64).map(position).collect();
        sink.push(MeshBatch { vertices: &vertices, triangles: &[], corners: &[] })?;
    }
    let is_mirrored = to_world.determinant() < 0.0;
    for batch in tin.triangles.chunks(BATCH) {
        let turned = |&[a, b, c]: &[u32; 3]| {
            (if is_mirrored { [a, c, b] } else { [a, b, c] }).map(u64::from)
        };
        let triangles: Vec<[u64; 3]> = batch.iter().map(turned).collect();
        let wanted = if sink.wants_corners() { &triangles[..] } else { &[] };
        let corners: Vec<[Point3; 3]> = wanted.iter().map(|ids| ids.map(position)).collect();
        sink.push(MeshBatch { vertices: &[], triangles: &triangles, corners: &corners })?;
    }
    sink.finish()
}

/// What was done, and how long it took.
#[derive(Default)]
struct Stages(Vec<StageReport>);

impl Stages {
    fn time<T>(
        &mut self,
        maker: &Maker<'_>,
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
