//! Contour lines of a grid of any size, written to a vector file.
//!
//! Threads trace tiles into pieces of lines, which are joined where they meet on the rim of a tile and stored
//! in memory or in an unnamed file. After all tiles, lines are assembled one by one and written, sorted by
//! level and by their first edge (the lowest one of a ring). So the file depends on the grid and the levels
//! only, not on threads, memory or tiles.
//!
//! **Simplified lines** are simplified tile by tile, by the greedy double cone, and untangled
//! ([`terrane_line::topology`]), all levels together; vertices on rims stay. A tile is convex, so lines of
//! different tiles cannot cross. They cannot touch along a rim either: a piece with both ends on one rim keeps
//! the vertex farthest from it, so no segment lies along a rim. Each dropped vertex is within the tolerance of
//! the segment in its place. The start of a ring stays, too, so lines have the same order and ids as without a
//! tolerance. The result depends on the tile size: each line keeps its vertices on rims.
//!
//! **Polygons** between the levels are made of these lines and of the border of the area with heights; see
//! module `bands`.
//!
//! **Memory.** The budget is divided between the tile of each thread, decoded blocks, and stored pieces. These
//! grow with the lines and not with the grid: about 160 bytes for each piece between two rims (or line within a
//! tile), 512 and 128 bytes for each side of a void if polygons are made, and 16 bytes a vertex, which are spilled. After the tiles their memory is used for the line being
//! written, 128 bytes a vertex. It is an error if crossings, pieces or a line do not fit.

mod bands;
mod budget;
mod job;
mod join;
mod simplify;
mod tiles;
mod trace;
mod write;

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use bands::{BandParts, BandWriter};
use budget::ContourMemory;
use join::ContourPieces;
use simplify::{MetricTolerance, measured};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_crs as crs;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_engine::outputs::not_member;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::{FeatureReprojection, Transformed};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_engine::{memory, workers};
use terrane_files::{lock, unlocked};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource};
use terrane_simplify::{DistanceKind, MetGoal};
use terrane_vector::{self as vector, FeatureSink, VectorFormat, VectorWriteOptions};
use terrane_window::contour::ContourLevels;
use tiles::ContourTiles;
use trace::{ContourTask, ContourWorker};

pub use job::{ContourJob, ContourOptions, ContourReport, ContourSetters};

impl Operation for ContourOptions {
    const NAME: &'static str = "contour";
    type Input = GridInput;
    const WRITES: Writes = Writes::Features;
    type Report = ContourReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.format(output).map(drop)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<ContourReport> {
        let (input, output) = (request.inputs.clone(), request.output.to_path_buf());
        let job = ContourJob { input, output, options: self.clone() };
        run(&job, request.progress, request.cancel)
    }
}

/// Runs the job. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// Invalid options; an output that exists or cannot be written; errors of opening the grid; heights beyond
/// 1e30; too little memory.
pub fn run(job: &ContourJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ContourReport> {
    let start = Instant::now();
    job.check()?;
    terrane_files::atomic::refuse_existing(&job.output, job.options.file.replacing.overwrite)?;
    let budget = ContourMemory::of(job);
    let resources = &job.options.resources;
    let options = job.options.grid.options(resources, GridOpenOptions::default().cache_bytes)?;
    let (source, shares) = memory::open(&job.input, &options, resources, budget.worker)
        .map_err(memory::or_smaller_tiles)?;
    not_member(source.as_ref(), &job.output)?;
    let work = OpenedContourJob::new(job, source.info(), budget.with(shares))?;
    let sink = work.sink()?;
    let pieces = work.trace(source.as_ref(), progress, cancel)?;
    // Decoded blocks and clip polygons make room for lines.
    drop((source, options));
    work.write(pieces, sink, start, progress, cancel)
}

/// As [`run`], from an open grid (`job.input` is only used in the report).
///
/// # Errors
/// As [`run`].
pub fn trace(
    source: &dyn GridSource,
    job: &ContourJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ContourReport> {
    let start = Instant::now();
    let budget = ContourMemory::of(job);
    let Resources { memory, threads, .. } = job.options.resources;
    let shares =
        memory::divide(memory, threads, budget.worker).map_err(memory::or_smaller_tiles)?;
    let work = OpenedContourJob::new(job, source.info(), budget.with(shares))?;
    let sink = work.sink()?;
    let pieces = work.trace(source, progress, cancel)?;
    work.write(pieces, sink, start, progress, cancel)
}

/// Fails for simplified polygons of a rotated grid of several tiles: its rims are not straight in coordinates.
fn refuse_rotated(job: &ContourJob, info: &GridInfo) -> Result<()> {
    let ContourOptions { polygons, tolerance, tile, .. } = &job.options;
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let [origin, east, south] = corners.map(|[col, row]| info.transform.apply(col, row));
    let is_straight = east[1] == origin[1] && south[0] == origin[0];
    let is_one_tile = ContourTiles::new(info, *tile).count() == 1;
    if !polygons || tolerance.is_none() || is_straight || is_one_tile {
        return Ok(());
    }
    Err(Error::usage(
        "‹polygons› with ‹tolerance› is not supported for rotated grids of several tiles",
    )
    .remedy("leave ‹tolerance› out, raise ‹tile›, or resample the grid"))
}

/// Fails for polygons that would cross themselves: of a grid whose crossings are not apart in coordinates, or of simplified
/// lines in another CRS, where they are other lines between their vertices.
fn refuse_crossing(job: &ContourJob, info: &GridInfo) -> Result<()> {
    let ContourOptions { polygons, tolerance, reprojection, .. } = &job.options;
    if !polygons {
        return Ok(());
    }
    if tolerance.is_some() && reprojection.to_crs.is_some() {
        return Err(Error::usage("‹polygons› with ‹tolerance› cannot have another CRS")
            .remedy("reproject the grid first (‹terrane convert›), or leave ‹tolerance› out"));
    }
    let [right, bottom] = [info.width, info.height].map(|side| f64::from(side) - 1.0);
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
    let largest = |axis: usize| {
        let places = corners.iter().map(|[col, row]| info.transform.apply(*col, *row)[axis].abs());
        places.fold(0.0, f64::max)
    };
    let map = &info.transform;
    let cells = [map.a.hypot(map.b), map.d.hypot(map.e)];
    // Crossings may be so many parts of a cell apart; some more for rounding.
    const PARTS: f64 = 65_536.0 * 8.0;
    let is_fine = [0, 1].into_iter().all(|axis| cells[axis] > largest(axis) * f64::EPSILON * PARTS);
    is_fine.then_some(()).ok_or_else(|| {
        let [width, height] = cells;
        Error::unsupported(format!(
            "cells of {width} x {height} are too small for polygons at coordinates up to {} x {}",
            largest(0),
            largest(1)
        ))
        .remedy("move the grid nearer to 0, 0, or make lines without ‹polygons›")
    })
}

/// A job on a grid.
struct OpenedContourJob<'a> {
    job: &'a ContourJob,
    format: &'static VectorFormat,
    levels: ContourLevels,
    tolerance: Option<MetricTolerance>,
    budget: ContourMemory,
    info: GridInfo,
    operation: Option<Arc<crs::CoordinateOperation>>,
}

impl<'a> OpenedContourJob<'a> {
    fn new(job: &'a ContourJob, info: &GridInfo, budget: ContourMemory) -> Result<Self> {
        info.check_cells().map_err(|e| e.in_file(Path::new(&job.input.to_string())))?;
        refuse_rotated(job, info)?;
        refuse_crossing(job, info)?;
        Ok(Self {
            job,
            format: job.check()?,
            levels: job.options.heights()?,
            tolerance: job.options.tolerance.map(|length| measured(length, info)).transpose()?,
            budget,
            info: info.clone(),
            operation: job.operation(info)?.map(Arc::new),
        })
    }

    fn sink(&self) -> Result<Box<dyn FeatureSink>> {
        let options = VectorWriteOptions {
            overwrite: self.job.options.file.replacing.overwrite,
            temp_dir: self.job.options.resources.temp_dir.clone(),
            ..VectorWriteOptions::default()
        };
        let mut layer = write::layer(self.job, self.format, &self.info);
        let Some(operation) = &self.operation else {
            return vector::create(&self.job.output, self.format, &layer, &options);
        };
        layer.crs = operation.target().clone();
        let inner = vector::create(&self.job.output, self.format, &layer, &options)?;
        Ok(Box::new(FeatureReprojection { inner, operation: operation.clone() }))
    }

    fn trace(
        &self,
        source: &dyn GridSource,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ContourPieces> {
        let tiles = ContourTiles::new(&self.info, self.job.options.tile);
        progress.begin("trace", self.samples());
        let polygons = self.job.options.polygons;
        let mut pieces = ContourPieces::new(&self.budget, self.job.spill_folder());
        pieces.bands = polygons.then(BandParts::default);
        let pieces = Mutex::new(pieces);
        let Self { levels, budget, tolerance, .. } = self;
        let (budget, tolerance) = (*budget, *tolerance);
        let task = ContourTask { source, levels, tiles, budget, tolerance, polygons, cancel };
        workers::run(
            budget.threads,
            tiles.count(),
            cancel,
            || ContourWorker::new(&task),
            |worker: &mut ContourWorker<'_, '_>, tile| {
                let traced = worker.trace(tile).map_err(|e| self.of_input(e))?;
                lock(&pieces).add(traced, tiles.rect(tile), tiles, cancel)?;
                progress.advance(tiles.owned(tile));
                Ok(())
            },
            |_| Ok(()),
        )?;
        progress.end();
        Ok(unlocked(pieces))
    }

    fn write(
        &self,
        pieces: ContourPieces,
        sink: Box<dyn FeatureSink>,
        start: Instant,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ContourReport> {
        let Self { job, format, levels, info, budget, .. } = self;
        let operation = self.operation.as_deref();
        let mut made = if job.options.polygons {
            let all_samples = operation.is_some();
            let writer = BandWriter { job, format, levels, info, budget, all_samples };
            writer.write(pieces, sink, progress, cancel)?
        } else {
            let max_vertices = budget.line_vertices();
            let writer = write::ContourWriter { job, format, levels, info, max_vertices };
            writer.write(pieces, sink, progress, cancel)?
        };
        made.notes.extend(raster::cautions(info));
        let drawn = made.lowest.zip(made.highest).map(|(lowest, highest)| [lowest, highest]);
        made.notes.extend(drawn.and_then(|range| raster::no_terrain(info, range)));
        made.notes.extend(operation.iter().flat_map(|operation| operation.notes().iter().cloned()));
        let run = RunStatistics::since(start, &job.options.resources)
            .with_threads(self.budget.threads)
            .with_spilled(made.run.spilled_bytes);
        Ok(ContourReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            format: format.name.to_owned(),
            width: info.width,
            height: info.height,
            crs: info.crs.label(),
            transformed: operation.map(Transformed::of),
            tolerance: self.tolerance.map(|tolerance| MetGoal {
                value: tolerance.value,
                metres: tolerance.measure == DistanceKind::Geographic,
            }),
            tile: job.options.tile,
            samples: self.samples(),
            samples_per_second: run.rate(self.samples()),
            run,
            ..made
        })
    }

    fn samples(&self) -> u64 {
        u64::from(self.info.width) * u64::from(self.info.height)
    }

    /// Adds the name of the input to an error about its heights.
    fn of_input(&self, error: Error) -> Error {
        match error.kind() {
            ErrorKind::BadInput => error.in_file(Path::new(&self.job.input.to_string())),
            _ => error,
        }
    }
}
