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

use budget::Budget;
use join::Pieces;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_crs as crs;
use terrane_engine::figures::Figures;
use terrane_engine::operation::{Operation, Request, Writes};
use terrane_engine::options::{FileOutput, Finite, GridInput, Reprojection};
use terrane_engine::outputs::not_member;
use terrane_engine::transform::{Moving, Transformed, extent_of};
use terrane_engine::workers;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::{folder_for, lock, unlocked};
use terrane_options::{Options, Range, Rule};
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs, OpenOptions};
use terrane_simplify::{Length, LengthText, Measure, Threshold, goal_of};
use terrane_vector::{self as vector, FeatureSink, VectorFormat, WriteOptions};
use terrane_window::contour::Levels;
use tiles::{Tiles, Worker};

/// Cells along the side of a tile, least to most.
const TILE_CELLS: [f64; 2] = [16.0, 8192.0];

/// Make contour lines of a grid
///
/// The surface is linear along the lines between neighbouring samples; higher ground is on the right of each line. Lines end
/// at voids and at the border, do not branch, and do not touch each other. With ‹tolerance› they are simplified, and neither
/// cross nor touch afterwards. The file is the same for any number of threads and any memory.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct ContourOptions {
    /// Lines at all multiples of this height, in the vertical unit of the data
    #[option(short = 'i', alias = "every", value = "HEIGHT", range = Range::POSITIVE, heading = "Levels")]
    pub interval: Option<f64>,
    /// Lines at these heights, such as 10,50,100, instead
    #[option(alias = "at", value = "LIST", with = Finite, heading = "Levels")]
    pub levels: Vec<f64>,
    /// Height from which the multiples are counted
    #[option(alias = "offset", value = "HEIGHT", with = Finite, default_text = "0", heading = "Levels")]
    pub base: Option<f64>,
    /// Mark lines at every N-th level from the base in a property "index" (true or false)
    #[option(value = "N", range = Range::new(1.0, u32::MAX as f64), heading = "Levels")]
    pub index: Option<u32>,
    /// Leave out vertices that are at most so far from the line, in units of x and y or with a unit: 100m, 2km, 50ft (of
    /// longitudes and latitudes on the ellipsoid); lines still neither cross nor touch
    #[option(alias = "simplify", value = "LENGTH", with = LengthText, range = Range::FROM_ZERO, heading = "Simplification")]
    pub tolerance: Option<Length>,
    /// Cells along the side of a tile, 16 to 8192; where tiles meet, lines keep a vertex that they may have lost
    #[option(value = "CELLS", default = 1024, range = Range::new(TILE_CELLS[0], TILE_CELLS[1]), heading = "Simplification")]
    pub tile: u32,
    /// Name of the property that holds the height of a line
    #[option(short = 'a', value = "NAME", default = "elev".to_owned(), heading = "Output")]
    pub attribute: String,
    /// Give each vertex the height of its line
    #[option(alias = "3d", heading = "Output")]
    pub with_z: bool,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// The coordinate reference system of the output.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[Rule] = &[
    Rule::OneOf(&["interval", "levels"], "levels of lines"),
    Rule::NotWith("levels", &["base", "index"]),
];

impl Operation for ContourOptions {
    const NAME: &'static str = "contour";
    type Input = GridInput;
    const WRITES: Writes = Writes::Lines;
    type Report = ContourReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.format(output).map(drop)
    }

    fn run(&self, request: Request<'_>) -> Result<ContourReport> {
        let (input, output) = (request.inputs.clone(), request.output.to_path_buf());
        let job = ContourJob { input, output, options: self.clone() };
        run(&job, request.progress, request.cancel)
    }
}

impl ContourOptions {
    fn heights(&self) -> Result<Levels> {
        match self.interval {
            Some(interval) => Levels::every(interval, self.base.unwrap_or(0.0)),
            None => Levels::list(self.levels.clone()),
        }
    }

    /// The format to write.
    fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        self.heights()?;
        if self.index.is_some() && self.attribute == write::INDEX {
            return Err(Error::usage("the heights and the marks of index contours have one name")
                .remedy("choose another ‹attribute›"));
        }
        let format = vector::by_path(output, self.file.format.as_deref())?;
        if !format.holds.kinds.contains(&vector::Kind::LineString) {
            return Err(Error::usage(format!("{} holds no lines", format.name))
                .in_file(output)
                .remedy("write GeoJSON, FlatGeobuf or a shapefile"));
        }
        Ok(format)
    }
}

/// Contour lines to make.
#[derive(Clone, Debug)]
pub struct ContourJob {
    /// Grid files, or a synthetic terrain by name.
    pub input: Inputs,
    /// File of features to write.
    pub output: PathBuf,
    /// What they are to be.
    pub options: ContourOptions,
}

impl ContourJob {
    /// What can be known to be wrong before any work; the format to write.
    fn check(&self) -> Result<&'static VectorFormat> {
        terrane_options::check(&self.options)?;
        self.options.format(&self.output)
    }
}

/// What was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
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
/// Options that cannot be; an output that exists or cannot be written; whatever the grid's
/// opener finds; heights beyond 1e30; too little memory.
pub fn run(job: &ContourJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ContourReport> {
    let start = Instant::now();
    job.check()?;
    terrane_files::atomic::refuse_existing(&job.output, job.options.file.replacing.overwrite)?;
    let budget = Budget::divide(job)?;
    let cache_bytes = usize::try_from(budget.cache).unwrap_or(usize::MAX);
    let options = job.options.grid.options(&job.options.resources, cache_bytes)?;
    let options = OpenOptions { threads: budget.threads, ..options };
    let source = raster::open_all(job.input.names(), &options)?;
    not_member(source.as_ref(), &job.output)?;
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
    operation: Option<Arc<crs::Operation>>,
}

impl<'a> Work<'a> {
    fn new(job: &'a ContourJob, info: &GridInfo) -> Result<Self> {
        info.check_cells().map_err(|e| e.in_file(Path::new(&job.input.to_string())))?;
        Ok(Self {
            job,
            format: job.check()?,
            levels: job.options.heights()?,
            tolerance: job.options.tolerance.map(|length| measured(length, info)).transpose()?,
            budget: Budget::divide(job)?,
            info: info.clone(),
            operation: job.operation(info)?.map(Arc::new),
        })
    }

    fn sink(&self) -> Result<Box<dyn FeatureSink>> {
        let options = WriteOptions {
            overwrite: self.job.options.file.replacing.overwrite,
            temp_dir: self.job.options.resources.temp_dir.clone(),
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
        let tiles = Tiles::new(&self.info, self.job.options.tile);
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
        let run = Figures::since(start, &job.options.resources)
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
            tolerance: self.tolerance.map(Tolerance::threshold),
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
    fn operation(&self, info: &GridInfo) -> Result<Option<crs::Operation>> {
        let Some(transform) = self.options.reprojection.transform() else { return Ok(None) };
        let (input, extent) = (self.input.to_string(), Some(extent_of(info)));
        let source = (Path::new(&input), &info.crs);
        let operation = transform.operation(source, extent, &self.options.resources)?;
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
        folder_for(&self.output, self.options.resources.temp_dir.as_deref())
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
            .remedy("pass ‹tolerance› as a plain number, in units of x and y"));
    }
    Ok(Tolerance { measure, value })
}
