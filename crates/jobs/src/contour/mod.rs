//! Contour lines of a grid of any size, into a file of features.
//!
//! Threads trace tiles and hand over pieces of lines, which are joined where they meet on a rim and
//! wait in memory, or in an unnamed file; when all tiles are done, lines are put together one by one
//! and written, by level and then by the edge they begin at, a ring at its lowest. So the file depends on the grid and the levels
//! alone, not on threads, memory or tiles.
//!
//! **Simplified lines** are simplified tile by tile, by the greedy double cone, and untangled
//! ([`terrane_line::topology`]), all levels together; vertices on rims stay. A tile is convex, so what
//! is in it cannot cross what is in another. Touching along a rim is left, and impossible: a piece both
//! of whose ends are on one rim keeps the vertex that is farthest from it, so no segment lies along a
//! rim. Each vertex left out is within the tolerance of the segment in its place. Where rings begin
//! stays, too, so lines have the order and the ids that they have without a tolerance. The tile is an
//! input here: on its rims each line keeps a vertex that it might have lost.
//!
//! **Memory.** The budget is divided between what each thread needs for a tile, with as many crossings as
//! fit into it, decoded blocks, and what waits. What waits grows with the lines and not with the grid:
//! about 160 bytes for each piece of a line between two rims (or whole line within a tile), beside
//! vertices of 16 bytes, which are spilled. When the tiles are done, their room is that of the line being
//! written, 128 bytes a vertex. Where crossings, pieces or a line do not fit, an error says so.

mod budget;
mod join;
mod simplify;
mod tiles;
mod write;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use serde::Serialize;

use crate::figures::Figures;
use crate::line::{Length, Measure, Threshold, goal_of};
use crate::reading::Reading;
use crate::transform::{Moving, Transform, Transformed, extent_of};
use crate::workers;
use crate::{Cancel, Progress, Resources};
use budget::Budget;
use join::Pieces;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_contour::Levels;
use terrane_crs::Operation;
use terrane_files::{folder_for, lock, unlocked};
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs, OpenOptions};
use terrane_vector::{self as vector, FeatureSink, VectorFormat, WriteOptions};
use tiles::{Tiles, Worker};

/// The heights of contour lines.
#[derive(Clone, Debug, PartialEq)]
pub enum Heights {
    /// Multiples of `interval`, counted from `base`.
    Every {
        /// Distance of neighbouring levels, in the vertical unit of the data.
        interval: f64,
        /// One of the levels.
        base: f64,
    },
    /// These.
    List(Vec<f64>),
}

/// Cells along the side of a tile, least to most.
pub const TILE_CELLS: std::ops::RangeInclusive<u32> = 16..=8192;

/// Cells along the side of a tile, unless told otherwise.
pub const USUAL_TILE: u32 = 1024;

/// Contour lines to make.
#[derive(Clone, Debug)]
pub struct ContourJob {
    /// Grid files, or a synthetic terrain by name.
    pub input: Inputs,
    /// What is read of it.
    pub reading: Reading,
    /// File of features to write.
    pub output: PathBuf,
    /// Name of the format to write; by the output's ending when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// Where lines are drawn.
    pub heights: Heights,
    /// Largest distance of a vertex that is left out from the line; all vertices are kept when `None`.
    pub tolerance: Option<Length>,
    /// Name of the property that holds the height of a line.
    pub attribute: String,
    /// Give each vertex the height of its line as z.
    pub with_z: bool,
    /// Mark each level of this number of intervals from the base.
    pub index: Option<u32>,
    /// Cells along the side of a tile, in [`TILE_CELLS`].
    pub tile: u32,
    /// The system to write in; that of the grid when `None`.
    pub transform: Option<Transform>,
    /// What the job may use.
    pub resources: Resources,
}

impl Heights {
    fn is_every(&self) -> bool {
        matches!(self, Self::Every { .. })
    }
}

impl ContourJob {
    /// The job with everything else at its default.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>, heights: Heights) -> Self {
        Self {
            input: input.into(),
            reading: Reading::default(),
            output: output.into(),
            format: None,
            overwrite: false,
            heights,
            tolerance: None,
            attribute: "elev".to_owned(),
            with_z: false,
            index: None,
            tile: USUAL_TILE,
            transform: None,
            resources: Resources::default(),
        }
    }

    fn levels(&self) -> Result<Levels> {
        match &self.heights {
            Heights::Every { interval, base } => Levels::every(*interval, *base),
            Heights::List(levels) => Levels::list(levels.clone()),
        }
    }

    /// What can be known to be wrong before any work; the format to write.
    ///
    /// # Errors
    /// Levels that are none, a tile or tolerance out of range, an unknown format or one that holds no
    /// lines.
    pub fn check(&self) -> Result<&'static VectorFormat> {
        self.levels()?;
        if !TILE_CELLS.contains(&self.tile) {
            let (least, most) = TILE_CELLS.into_inner();
            return Err(Error::usage(format!("tiles of {} cells", self.tile))
                .remedy(format!("choose {least} to {most}")));
        }
        if self.tolerance.is_some_and(|t| !(t.value >= 0.0 && t.value.is_finite())) {
            return Err(Error::usage("the tolerance is not a distance")
                .remedy("give a number of 0 or more"));
        }
        if self.index == Some(0) || (self.index.is_some() && !self.heights.is_every()) {
            return Err(Error::usage("index contours are counted in intervals, 1 or more")
                .remedy("give an interval instead of levels, or leave --index out"));
        }
        if self.index.is_some() && self.attribute == write::INDEX {
            return Err(Error::usage("the heights and the marks of index contours have one name")
                .remedy("choose another --attribute"));
        }
        let format = vector::by_path(&self.output, self.format.as_deref())?;
        if !format.holds.kinds.contains(&vector::Kind::LineString) {
            return Err(Error::usage(format!("{} holds no lines", format.name))
                .in_file(&self.output)
                .remedy("write GeoJSON, FlatGeobuf or a shapefile"));
        }
        Ok(format)
    }
}

/// What was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct ContourReport {
    pub input: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    pub width: u32,
    pub height: u32,
    /// The system of the grid.
    pub crs: String,
    /// What led to the system of the output, where that is another.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Levels with a line, and the lowest and highest of them.
    pub levels: u64,
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
    pub tolerance: Option<Threshold>,
    /// Cells along the side of a tile.
    pub tile: u32,
    /// Lines written, rings among them.
    pub lines: u64,
    pub rings: u64,
    /// Lines that would go around nothing: samples exactly on a level, with no cell among them and all
    /// others around them below.
    pub left_out: u64,
    /// Vertices written, and those before simplification, of lines left out too.
    pub vertices: u64,
    pub original_vertices: u64,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    pub samples: u64,
    #[serde(flatten)]
    pub run: Figures,
    pub samples_per_second: f64,
}

/// Runs the job. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// Those of [`ContourJob::check`]; an output that exists or cannot be written; whatever the grid's
/// opener finds; heights beyond 1e30; too little memory.
pub fn run(job: &ContourJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ContourReport> {
    let start = Instant::now();
    job.check()?;
    terrane_files::atomic::refuse_existing(&job.output, job.overwrite)?;
    let budget = Budget::divide(job)?;
    let cache_bytes = usize::try_from(budget.cache).unwrap_or(usize::MAX);
    let options = job.reading.options(&job.resources, cache_bytes)?;
    let options = OpenOptions { threads: budget.threads, ..options };
    let source = raster::open_all(job.input.names(), &options)?;
    let work = Work::new(job, source.info())?;
    let sink = work.sink()?;
    let pieces = work.trace(source.as_ref(), progress, cancel)?;
    // Decoded blocks and polygons make room for lines.
    drop((source, options));
    work.write(pieces, sink, start, progress, cancel)
}

/// As [`run`], from a grid that is open already (`job.input` is only named in the report).
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
    let work = Work::new(job, source.info())?;
    let sink = work.sink()?;
    let pieces = work.trace(source, progress, cancel)?;
    work.write(pieces, sink, start, progress, cancel)
}

/// A job on a grid.
struct Work<'a> {
    job: &'a ContourJob,
    format: &'static VectorFormat,
    levels: Levels,
    tolerance: Option<Tolerance>,
    budget: Budget,
    info: GridInfo,
    operation: Option<Arc<Operation>>,
}

impl<'a> Work<'a> {
    fn new(job: &'a ContourJob, info: &GridInfo) -> Result<Self> {
        info.check_cells().map_err(|e| e.in_file(Path::new(&job.input.to_string())))?;
        Ok(Self {
            job,
            format: job.check()?,
            levels: job.levels()?,
            tolerance: job.tolerance.map(|length| measured(length, info)).transpose()?,
            budget: Budget::divide(job)?,
            info: info.clone(),
            operation: job.operation(info)?.map(Arc::new),
        })
    }

    fn sink(&self) -> Result<Box<dyn FeatureSink>> {
        let options = WriteOptions {
            overwrite: self.job.overwrite,
            temp_dir: self.job.resources.temp_dir.clone(),
            ..WriteOptions::default()
        };
        let mut layer = write::layer(self.job, self.format, &self.info);
        let Some(operation) = &self.operation else {
            return vector::create(&self.job.output, self.format, &layer, &options);
        };
        layer.crs = operation.target().clone();
        let inner = vector::create(&self.job.output, self.format, &layer, &options)?;
        Ok(Box::new(Moving { inner, operation: operation.clone() }))
    }

    fn trace(
        &self,
        source: &dyn GridSource,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Pieces> {
        let tiles = Tiles::new(&self.info, self.job.tile);
        progress.begin("trace", self.samples());
        let pieces = Mutex::new(Pieces::new(&self.budget, self.job.spill_folder()));
        let Self { levels, budget, tolerance, .. } = self;
        let (budget, tolerance) = (*budget, *tolerance);
        let task = tiles::Task { source, levels, tiles, budget, tolerance, cancel };
        workers::run(
            budget.threads,
            tiles.count(),
            cancel,
            || Worker::new(&task),
            |worker: &mut Worker<'_, '_>, tile| {
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
        pieces: Pieces,
        sink: Box<dyn FeatureSink>,
        start: Instant,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ContourReport> {
        let Self { job, format, levels, info, .. } = self;
        let most = self.budget.line_vertices();
        let writer = write::Writer { job, format, levels, info, most };
        let mut made = writer.write(pieces, sink, progress, cancel)?;
        let operation = self.operation.as_deref();
        made.notes.extend(raster::cautions(info));
        let drawn = made.lowest.zip(made.highest).map(|(lowest, highest)| [lowest, highest]);
        made.notes.extend(drawn.and_then(|range| raster::no_terrain(info, range)));
        made.notes.extend(operation.iter().flat_map(|own| own.notes().iter().cloned()));
        let run = Figures {
            threads: self.budget.threads,
            spilled_bytes: made.run.spilled_bytes,
            ..Figures::since(start, &job.resources)
        };
        Ok(ContourReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            format: format.name.to_owned(),
            width: info.width,
            height: info.height,
            crs: info.crs.label(),
            transformed: operation.map(Transformed::of),
            tolerance: self.tolerance.map(Tolerance::threshold),
            tile: job.tile,
            samples: self.samples(),
            samples_per_second: run.rate(self.samples()),
            run,
            ..made
        })
    }

    fn samples(&self) -> u64 {
        u64::from(self.info.width) * u64::from(self.info.height)
    }

    /// Names the input in an error that names no file, if it is one of its heights.
    fn of_input(&self, error: Error) -> Error {
        match error.kind() {
            ErrorKind::BadInput => error.in_file(Path::new(&self.job.input.to_string())),
            _ => error,
        }
    }
}

impl ContourJob {
    /// What leads to the system to write in.
    fn operation(&self, info: &GridInfo) -> Result<Option<Operation>> {
        let Some(transform) = &self.transform else { return Ok(None) };
        let (input, extent) = (self.input.to_string(), Some(extent_of(info)));
        let source = (Path::new(&input), &info.crs);
        let operation = transform.operation(source, extent, &self.resources)?;
        match operation.keeps_heights() {
            true => Ok(Some(operation)),
            false => Err(Error::unsupported(
                "lines at one height are not at one height in the system to write in",
            )
            .remedy("name it without heights: those of the grid are kept")),
        }
    }

    /// Where pieces are spilled: the folder asked for, or the output's.
    fn spill_folder(&self) -> &Path {
        folder_for(&self.output, self.resources.temp_dir.as_deref())
    }
}

/// A tolerance as it is measured.
#[derive(Clone, Copy, Debug)]
struct Tolerance {
    measure: Measure,
    value: f64,
}

impl Tolerance {
    fn threshold(self) -> Threshold {
        Threshold { value: self.value, metres: self.measure == Measure::Geographic }
    }
}

/// A length over a grid.
fn measured(length: Length, info: &GridInfo) -> Result<Tolerance> {
    let (measure, value) = goal_of(length, false, &info.crs)?;
    let [east, south] = [info.width, info.height].map(|samples| f64::from(samples) - 1.0);
    let corners = [[0.0, 0.0], [east, 0.0], [0.0, south], [east, south]];
    let latitude = |[col, row]: [f64; 2]| info.transform.apply(col, row)[1];
    if measure == Measure::Geographic && corners.iter().any(|&c| latitude(c).abs() > 90.0 + 1e-6) {
        return Err(Error::bad_input("a latitude is beyond 90 degrees")
            .remedy("pass --tolerance as a plain number, in units of x and y"));
    }
    Ok(Tolerance { measure, value })
}
