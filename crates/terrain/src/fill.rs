//! Filled voids of a grid, written like any other grid.
//!
//! A filled height depends on the samples within the distance of search (and of smoothing) alone, so pieces, threads and
//! memory cannot change it. A rectangle without a void is only copied. Otherwise the samples within that distance of its
//! voids are read as well.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use serde::Serialize;

use crate::bands::{ComputedBands, PIECE};
use crate::convert::copy::{DerivedBands, ReservedMemory, run_beside};
use crate::convert::job::{ConvertJob, ConvertReport, DerivedGridOptions};
use crate::halo::SampleHalo;
use crate::stored;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_engine::memory;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{GridInput, SampleOutput};
use terrane_files::lock;
use terrane_options::{OptionRange, Options};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource, Inputs};
use terrane_window::voids::{VoidFiller, VoidScratch};

/// Fill voids of a grid from the samples around them
///
/// A void gets the mean of the nearest valid samples in four quadrants around it, weighted by the inverse of their
/// distance, as by gdal_fillnodata. Valid samples, sample type, nodata value and CRS are those of the grid.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct FillOptions {
    /// Maximum distance of samples, in cells; voids farther from any valid sample are left
    #[option(value = "CELLS", default = 100, range = OptionRange::new(1.0, 10_000.0))]
    pub max_distance: u32,
    /// Number of 3 x 3 smoothing passes over the filled samples
    #[option(value = "N", range = OptionRange::new(0.0, 1000.0))]
    pub smoothing: u32,
    /// How its samples are stored.
    #[option(flatten)]
    pub samples: SampleOutput,
    /// Input and output.
    #[option(flatten)]
    pub common: DerivedGridOptions,
}

/// What was filled.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FillReport {
    /// The written grid.
    #[serde(flatten)]
    pub common: ConvertReport,
    /// Filled samples.
    pub filled: u64,
    /// Samples that are still void.
    pub left: u64,
}

impl FillOptions {
    /// The job that writes the filled grid. Its clip polygons come after the filling.
    fn job(&self, inputs: &Inputs, output: &Path) -> ConvertJob {
        self.common.job(inputs, output).with(|options| {
            options.samples = self.samples.clone();
            options.grid.clip = None;
        })
    }

    fn filler(&self) -> VoidFiller {
        // The ranges of both options are far below.
        let [max_distance, smoothing] =
            [self.max_distance, self.smoothing].map(|n| u16::try_from(n).unwrap_or(u16::MAX - 1));
        VoidFiller { max_distance, smoothing }
    }

    /// The note on voids that are left.
    fn note(&self, left: u64) -> Option<String> {
        let most = self.max_distance;
        (left > 0).then(|| {
            format!(
                "voids left: {left}, farther than {most} cells from all valid samples that were read; a larger ‹max_distance› may reach them"
            )
        })
    }

    /// What the output stores: filled heights are rounded to it.
    fn stored(&self, info: &GridInfo) -> GridInfo {
        let SampleOutput { sample_type, out_nodata, .. } = self.samples;
        GridInfo {
            sample_type: sample_type.unwrap_or(info.sample_type),
            nodata: out_nodata.or(info.nodata),
            ..info.clone()
        }
    }
}

impl Operation for FillOptions {
    const NAME: &'static str = "fill";
    type Input = GridInput;
    const WRITES: Writes = Writes::Grid;
    type Report = FillReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.job(&Inputs::default(), output).options.check(output)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<FillReport> {
        let RunRequest { inputs, output, progress, cancel, .. } = request;
        let (job, filler, counts) = (self.job(inputs, output), self.filler(), Arc::default());
        let resources = &self.common.resources;
        let opening = self.common.grid.options(resources, 0)?;
        let whole = GridOpenOptions { clip: None, ..opening.clone() };
        let grid = memory::open_for_estimate(inputs, &whole)?.info().bounds();
        let bytes = filler.bytes([grid.width, grid.height].map(u64::from), PIECE.into());
        let clip = opening.clip.as_ref().map_or(0, |clip| clip.memory_use(resources.threads));
        let bands = ComputedBands::bytes(resources.memory);
        let reserved = ReservedMemory { wanted: clip + bands, least: clip };
        let report = run_beside(&job, bytes, reserved, progress, cancel, |inner, reserved| {
            let inside = Inside::of(inner.info(), &opening)?;
            let stored = self.stored(inner.info());
            let bands = ComputedBands::new(inner.info().width, reserved - clip);
            let (halo, spare) = (SampleHalo(filler.reach()), Mutex::default());
            let counts = Arc::clone(&counts);
            let grid = FilledGrid { inner, inside, stored, filler, halo, counts, bands, spare };
            Ok(DerivedBands::of(Box::new(grid), Vec::new()))
        });
        let mut common = report.map_err(or_less)?;
        let VoidCounts { filled, left } = &*counts;
        let [filled, left] = [filled, left].map(|count| count.load(Ordering::Relaxed));
        common.notes.extend(self.note(left));
        Ok(FillReport { common, filled, left })
    }
}

/// Adds a shorter search to the remedy of an error for too little memory, as threads then need less.
fn or_less(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Resource => error.or("a smaller ‹max_distance›"),
        _ => error,
    }
}

/// Voids of the grid, or of the part within the clip polygons.
#[derive(Debug, Default)]
struct VoidCounts {
    filled: AtomicU64,
    left: AtomicU64,
}

/// The samples within the clip polygons. The samples outside count for filled heights, and are void in the output.
struct Inside(Option<Box<dyn GridSource>>);

impl Inside {
    /// The samples within the polygons of `opening`.
    ///
    /// # Errors
    /// Polygons with another CRS, or without a sample.
    fn of(info: &GridInfo, opening: &GridOpenOptions) -> Result<Self> {
        let Some(clip) = &opening.clip else { return Ok(Self(None)) };
        // Their memory was reserved.
        let opening = GridOpenOptions { cache_bytes: usize::MAX, ..opening.clone() };
        let level: Box<dyn GridSource> = Box::new(LevelGrid(info.clone()));
        raster::clipped(clip, &opening, |_| Ok(level)).map(|grid| Self(Some(grid)))
    }

    /// For the samples of a rectangle NaN if outside, else 0; none if all are inside.
    fn of_rect(&self, rect: Rect) -> Result<Option<Vec<f32>>> {
        let Some(grid) = &self.0 else { return Ok(None) };
        let mut inside = vec![0.0; rect.len()];
        grid.read_f32(rect, &mut inside)?;
        Ok(Some(inside))
    }
}

/// A grid whose heights are all 0.
struct LevelGrid(GridInfo);

impl GridSource for LevelGrid {
    fn info(&self) -> &GridInfo {
        &self.0
    }

    fn read_f32(&self, _: Rect, out: &mut [f32]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }

    fn read_f64(&self, _: Rect, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
}

/// A grid with filled voids.
struct FilledGrid {
    inner: Box<dyn GridSource>,
    inside: Inside,
    /// What filled heights are rounded to.
    stored: GridInfo,
    filler: VoidFiller,
    halo: SampleHalo,
    counts: Arc<VoidCounts>,
    bands: ComputedBands,
    /// Buffers that no thread is using.
    spare: Mutex<Vec<FillBuffers>>,
}

#[derive(Default)]
struct FillBuffers {
    window: Vec<f64>,
    scratch: VoidScratch,
}

impl FilledGrid {
    /// Fills the voids of a rectangle that was read, within the clip polygons, and makes the samples outside void.
    fn finish<H: Copy + Into<f64>>(
        &self,
        rect: Rect,
        heights: &mut [H],
        narrow: impl Fn(f64) -> H,
    ) -> Result<()> {
        let inside = self.inside.of_rect(rect)?;
        let set_outside = |heights: &mut [H], value: f64| {
            let both = heights.iter_mut().zip(inside.iter().flatten());
            both.filter(|(_, inside)| inside.is_nan())
                .for_each(|(height, _)| *height = narrow(value));
        };
        // Any height but a void: nothing is filled outside.
        set_outside(heights, 0.0);
        let voids =
            |heights: &[H]| heights.iter().filter(|height| is_void(**height)).count() as u64;
        let before = voids(heights);
        if before > 0 {
            self.fill(rect, heights, &narrow)?;
        }
        let left = voids(heights);
        set_outside(heights, f64::NAN);
        self.counts.filled.fetch_add(before - left, Ordering::Relaxed);
        self.counts.left.fetch_add(left, Ordering::Relaxed);
        Ok(())
    }

    /// Fills the voids of a rectangle.
    fn fill<H: Copy + Into<f64>>(
        &self,
        rect: Rect,
        heights: &mut [H],
        narrow: impl Fn(f64) -> H,
    ) -> Result<()> {
        let mut buffers = lock(&self.spare).pop().unwrap_or_default();
        let put = |heights: &mut [H], part: Rect, found: &[f64]| {
            let both = part.intersect(&rect);
            for row in both.row..both.end_row() {
                let at = |of: Rect| {
                    let first = (row - of.row) as usize * of.width as usize;
                    first + (both.col - of.col) as usize
                };
                let found = &found[at(part)..][..both.width as usize];
                for (height, found) in heights[at(rect)..].iter_mut().zip(found) {
                    if is_void(*height) && !found.is_nan() {
                        *height = narrow(stored::nearest_storable(&self.stored, *found));
                    }
                }
            }
        };
        if self.bands.are_for(rect) {
            let columns = (rect.col / PIECE..=(rect.end_col() - 1) / PIECE).map(|at| {
                let part = Rect::new(at * PIECE, rect.row, PIECE, rect.height).intersect(&rect);
                voids(rect, heights, part).map(|_| at)
            });
            let columns: Vec<u32> = columns.flatten().collect();
            self.bands.each(
                rect,
                self.info().bounds(),
                &columns,
                &mut |piece| self.piece(piece, &mut buffers).map(<[f64]>::to_vec),
                &mut |piece, found| put(heights, piece, found),
            )?;
        } else {
            for row in (rect.row..rect.end_row()).step_by(PIECE as usize) {
                for col in (rect.col..rect.end_col()).step_by(PIECE as usize) {
                    let piece = Rect::new(col, row, PIECE, PIECE).intersect(&rect);
                    let Some(voids) = voids(rect, heights, piece) else { continue };
                    put(heights, voids, self.piece(voids, &mut buffers)?);
                }
            }
        }
        self.inner.copied(self.halo.around(rect, self.info().bounds()));
        lock(&self.spare).push(buffers);
        Ok(())
    }

    /// The filled heights of a piece.
    fn piece<'a>(&self, piece: Rect, buffers: &'a mut FillBuffers) -> Result<&'a [f64]> {
        let FillBuffers { window, scratch } = buffers;
        let around = self.halo.around(piece, self.info().bounds());
        window.resize(around.len(), 0.0);
        self.inner.read_f64(around, window)?;
        let size = [around.width, around.height].map(|side| side as usize);
        let Rect { col, row, width, height } = piece;
        let within = Rect::new(col - around.col, row - around.row, width, height);
        Ok(self.filler.fill(window, size, within, scratch))
    }
}

fn is_void<H: Into<f64>>(height: H) -> bool {
    height.into().is_nan()
}

/// The rectangle around the voids of a piece of a rectangle; `None` without any.
fn voids<H: Copy + Into<f64>>(rect: Rect, heights: &[H], piece: Rect) -> Option<Rect> {
    let (mut cols, mut rows) = ([u32::MAX, 0], [u32::MAX, 0]);
    for row in piece.row..piece.end_row() {
        let first = (row - rect.row) as usize * rect.width as usize;
        let first = first + (piece.col - rect.col) as usize;
        let heights = &heights[first..first + piece.width as usize];
        let Some(left) = heights.iter().position(|height| is_void(*height)) else { continue };
        let right = heights.iter().rposition(|height| is_void(*height)).unwrap_or(left);
        cols = [cols[0].min(left as u32), cols[1].max(right as u32)];
        rows = [rows[0].min(row), row];
    }
    let [width, height] =
        [cols, rows].map(|[first, last]| last.wrapping_sub(first).wrapping_add(1));
    (cols[0] <= cols[1]).then(|| Rect::new(piece.col + cols[0], rows[0], width, height))
}

impl GridSource for FilledGrid {
    fn info(&self) -> &GridInfo {
        self.inner.info()
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.inner.read_f32(rect, out)?;
        self.finish(rect, out, |height| height as f32)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.inner.read_f64(rect, out)?;
        self.finish(rect, out, |height| height)
    }

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(self.halo.last_read_for(rect, self.info().bounds()));
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(rect);
    }

    fn advise_read(&self, rect: Rect) {
        self.inner.advise_read(rect);
    }
}
