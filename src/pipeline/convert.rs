//! Copies any grid, or a part of it, into terrane's own store: in parallel, in bounded memory, with
//! sample type, nodata, scale, offset and CRS kept.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use serde::Serialize;

use crate::error::{Error, ErrorKind, Result};
use crate::geom::Rect;
use crate::pipeline::{Cancel, Progress, Resources, peak_memory};
use crate::raster::store::{DEFAULT_TILE, Heights, StoreWriter, TILE_SIDES};
use crate::raster::{self, GridInfo, GridSource, Inputs, OpenOptions};

/// A grid-to-store job.
#[derive(Clone, Debug)]
pub struct ConvertJob {
    /// File names, or a synthetic terrain by name (`synth:rough,size=4097,seed=7`).
    pub input: Inputs,
    /// Store to write.
    pub output: PathBuf,
    /// Band to read, from 1.
    pub band: u32,
    /// Replaces the file's nodata value.
    pub nodata: Option<f64>,
    /// Keep only the samples inside (x min, y min, x max, y max), in world coordinates.
    pub bbox: Option<[f64; 4]>,
    /// Samples along a tile's side: one of [`TILE_SIDES`].
    pub tile: u32,
    /// Replace an existing output.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

impl ConvertJob {
    /// The job with everything else at its default.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>) -> Self {
        Self {
            input: input.into(),
            output: output.into(),
            band: 1,
            nodata: None,
            bbox: None,
            tile: DEFAULT_TILE,
            overwrite: false,
            resources: Resources::default(),
        }
    }
}

/// What a grid-to-store job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct ConvertReport {
    pub input: String,
    pub output: String,
    pub width: u32,
    pub height: u32,
    pub crs: String,
    pub sample_type: String,
    pub nodata: Option<f64>,
    pub samples: u64,
    pub valid_samples: u64,
    /// Lowest and highest valid height; absent when there is none.
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
    pub output_bytes: u64,
    pub threads: usize,
    pub memory_budget: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    pub samples_per_second: f64,
}

/// Runs the job. Nothing appears under the output's name unless it succeeds.
pub fn run(job: &ConvertJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ConvertReport> {
    crate::atomic::refuse_existing(&job.output, job.overwrite)?;
    let cache_bytes = Budget::divide(job)?.cache;
    let options = OpenOptions { band: job.band, nodata: job.nodata, cache_bytes };
    let source = raster::open_all(job.input.names(), &options)?;
    copy(source.as_ref(), job, progress, cancel)
}

/// As [`run`], from a grid that is open already (`job.input` is only named in the report).
pub fn copy(
    source: &dyn GridSource,
    job: &ConvertJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let start = Instant::now();
    let budget = Budget::divide(job)?;
    let window = window(source.info(), job.bbox)?;
    let info = part(source.info(), window);
    let writer = StoreWriter::create(&job.output, &info, job.tile, job.overwrite)?;
    let pieces = Pieces::new(&info, writer.tile(), budget.cache);
    let task = Task { source, window, writer: &writer, pieces, exact: info.exact_in_f32() };
    let samples = u64::from(info.width) * u64::from(info.height);
    progress.begin("convert", samples);
    let summary = task.run(budget.threads, progress, cancel)?;
    cancel.check()?;
    let output_bytes = writer.finish()?;
    progress.end();
    let wall_seconds = start.elapsed().as_secs_f64();
    Ok(ConvertReport {
        input: job.input.to_string(),
        output: job.output.display().to_string(),
        width: info.width,
        height: info.height,
        crs: info.crs.label(),
        sample_type: info.sample_type.name().to_owned(),
        nodata: info.nodata,
        samples,
        valid_samples: summary.valid,
        lowest: (summary.valid > 0).then_some(summary.lowest),
        highest: (summary.valid > 0).then_some(summary.highest),
        output_bytes,
        threads: budget.threads,
        memory_budget: job.resources.memory,
        peak_memory: peak_memory(),
        wall_seconds,
        samples_per_second: samples as f64 / wall_seconds,
    })
}

/// How the job's memory is divided.
struct Budget {
    threads: usize,
    /// Bytes for decoded blocks of the source.
    cache: usize,
}

/// Bytes of heights and of encoded samples for each sample of a tile, at most: 8 and 8.
const BYTES_PER_SAMPLE: u64 = 16;
/// Least memory left for the source's blocks.
const LEAST_CACHE: u64 = 8 << 20;

impl Budget {
    /// A tile for each thread, and the rest for the source: fewer threads where memory is short.
    fn divide(job: &ConvertJob) -> Result<Self> {
        let Resources { threads, memory, .. } = job.resources;
        let largest = TILE_SIDES.iter().copied().max().unwrap_or(DEFAULT_TILE);
        let tile = u64::from(job.tile.min(largest)).pow(2) * BYTES_PER_SAMPLE;
        let least = tile + LEAST_CACHE;
        if memory < least {
            let message = format!("the memory budget of {memory} bytes is too small");
            return Err(Error::new(ErrorKind::Resource, message)
                .remedy(format!("give at least {} MiB with --memory", least.div_ceil(1 << 20))));
        }
        let most = (memory - LEAST_CACHE) / tile;
        let threads = threads.clamp(1, usize::try_from(most).unwrap_or(usize::MAX));
        let cache = memory - threads as u64 * tile;
        Ok(Self { threads, cache: usize::try_from(cache).unwrap_or(usize::MAX) })
    }
}

/// The samples of a grid inside a box of world coordinates, edges included.
fn window(info: &GridInfo, bbox: Option<[f64; 4]>) -> Result<Rect> {
    let Some([x0, y0, x1, y1]) = bbox else { return Ok(info.bounds()) };
    let corners =
        [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|[x, y]| info.transform.invert(x, y));
    let (col, width) = span(corners.map(|c| c[0]), info.width);
    let (row, height) = span(corners.map(|c| c[1]), info.height);
    let ordered = x0 <= x1 && y0 <= y1;
    if !ordered || width == 0 || height == 0 {
        let message = format!("no sample lies inside the box {x0},{y0},{x1},{y1}");
        let [a, b] = extent(info);
        let extent = format!("{},{},{},{}", a[0], a[1], b[0], b[1]);
        return Err(Error::usage(message)
            .remedy(format!("give x min,y min,x max,y max; the grid covers {extent}")));
    }
    Ok(Rect::new(col, row, width, height))
}

/// First and number of lattice positions between the least and the greatest of four.
fn span(positions: [f64; 4], side: u32) -> (u32, u32) {
    // A sample on the edge of the box counts, whatever the rounding of the division.
    const HAIR: f64 = 1e-6;
    let least = positions.into_iter().fold(f64::INFINITY, f64::min) - HAIR;
    let most = positions.into_iter().fold(f64::NEG_INFINITY, f64::max) + HAIR;
    let first = least.ceil().clamp(0.0, f64::from(side)) as u32;
    let end = (most.floor() + 1.0).clamp(0.0, f64::from(side)) as u32;
    (first, end.saturating_sub(first))
}

/// Least and greatest world position of the grid's samples.
fn extent(info: &GridInfo) -> [[f64; 2]; 2] {
    let (right, down) = (f64::from(info.width - 1), f64::from(info.height - 1));
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, down], [right, down]];
    let corners = corners.map(|[col, row]| info.transform.apply(col, row));
    let fold = |pick: fn(f64, f64) -> f64| {
        let [a, b, c, d] = corners;
        [0, 1].map(|axis| pick(pick(a[axis], b[axis]), pick(c[axis], d[axis])))
    };
    [fold(f64::min), fold(f64::max)]
}

/// What the part of a grid inside `window` is.
fn part(info: &GridInfo, window: Rect) -> GridInfo {
    let transform = info.transform.shifted(f64::from(window.col), f64::from(window.row));
    GridInfo { width: window.width, height: window.height, transform, ..info.clone() }
}

/// The units of work: some rows of one tile each, along rows of tiles.
#[derive(Clone, Copy, Debug)]
struct Pieces {
    width: u32,
    height: u32,
    tile_width: u32,
    /// Rows of a piece; divides the tile's.
    rows: u32,
}

impl Pieces {
    /// Pieces are whole tiles, unless a row of tiles across the source's blocks is more than half
    /// of `cache` holds: then they are lower, so that no block is decoded twice.
    fn new(info: &GridInfo, (tile_width, tile_height): (u32, u32), cache: usize) -> Self {
        let row_bytes = u64::from(info.width) * info.sample_type.bytes() as u64;
        let wide = info.block.0 > tile_width;
        let mut rows = tile_height;
        while wide && rows % 2 == 0 && u64::from(rows) * row_bytes > cache as u64 / 2 {
            rows /= 2;
        }
        Self { width: info.width, height: info.height, tile_width, rows }
    }

    fn across(&self) -> u64 {
        u64::from(self.width.div_ceil(self.tile_width))
    }

    fn count(&self) -> u64 {
        self.across() * u64::from(self.height.div_ceil(self.rows))
    }

    fn rect(&self, index: u64) -> Rect {
        let (down, across) = ((index / self.across()) as u32, (index % self.across()) as u32);
        let piece =
            Rect::new(across * self.tile_width, down * self.rows, self.tile_width, self.rows);
        piece.intersect(&Rect::new(0, 0, self.width, self.height))
    }
}

/// Copying, shared between the threads.
struct Task<'a> {
    source: &'a dyn GridSource,
    window: Rect,
    writer: &'a StoreWriter,
    pieces: Pieces,
    /// True when `f32` holds every height.
    exact: bool,
}

/// Buffers of one thread.
#[derive(Default)]
struct Buffers {
    narrow: Vec<f32>,
    wide: Vec<f64>,
    bytes: Vec<u8>,
}

impl Task<'_> {
    fn run(&self, threads: usize, progress: &dyn Progress, cancel: &Cancel) -> Result<Summary> {
        let next = AtomicU64::new(0);
        let work = || {
            let result = self.work(&next, progress, cancel);
            if result.is_err() {
                next.store(self.pieces.count(), Ordering::Relaxed);
            }
            result
        };
        let summaries: Result<_> = std::thread::scope(|scope| {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined.map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        });
        let summaries: Vec<Summary> = summaries?;
        Ok(summaries.into_iter().fold(Summary::NONE, Summary::join))
    }

    fn work(&self, next: &AtomicU64, progress: &dyn Progress, cancel: &Cancel) -> Result<Summary> {
        let mut buffers = Buffers::default();
        let mut summary = Summary::NONE;
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= self.pieces.count() {
                return Ok(summary);
            }
            cancel.check()?;
            let rect = self.pieces.rect(index);
            summary = summary.join(self.copy(rect, &mut buffers)?);
            progress.advance(rect.len() as u64);
        }
    }

    fn copy(&self, rect: Rect, buffers: &mut Buffers) -> Result<Summary> {
        let Rect { col, row, .. } = self.window;
        let from = Rect::new(col + rect.col, row + rect.row, rect.width, rect.height);
        let Buffers { narrow, wide, bytes } = buffers;
        let summary = if self.exact {
            narrow.resize(rect.len(), 0.0);
            self.source.read_f32(from, narrow)?;
            self.writer.write(rect, Heights::F32(narrow), bytes)?;
            Summary::of_f32(narrow)
        } else {
            wide.resize(rect.len(), 0.0);
            self.source.read_f64(from, wide)?;
            self.writer.write(rect, Heights::F64(wide), bytes)?;
            Summary::of_f64(wide)
        };
        self.source.release(from);
        Ok(summary)
    }
}

/// What was seen while copying.
#[derive(Clone, Copy, Debug)]
struct Summary {
    valid: u64,
    lowest: f64,
    highest: f64,
}

impl Summary {
    const NONE: Self = Self { valid: 0, lowest: f64::INFINITY, highest: f64::NEG_INFINITY };

    fn join(self, other: Self) -> Self {
        Self {
            valid: self.valid + other.valid,
            lowest: self.lowest.min(other.lowest),
            highest: self.highest.max(other.highest),
        }
    }

    fn of_f32(heights: &[f32]) -> Self {
        let (mut valid, mut lowest, mut highest) = (0, f32::INFINITY, f32::NEG_INFINITY);
        for &z in heights {
            valid += u64::from(!z.is_nan());
            lowest = if z < lowest { z } else { lowest };
            highest = if z > highest { z } else { highest };
        }
        Self { valid, lowest: f64::from(lowest), highest: f64::from(highest) }
    }

    fn of_f64(heights: &[f64]) -> Self {
        let (mut valid, mut lowest, mut highest) = (0, f64::INFINITY, f64::NEG_INFINITY);
        for &z in heights {
            valid += u64::from(!z.is_nan());
            lowest = if z < lowest { z } else { lowest };
            highest = if z > highest { z } else { highest };
        }
        Self { valid, lowest, highest }
    }
}
