//! Filled voids of a grid, written like any other grid.
//!
//! A filled height depends on the samples within the distance of search (and of smoothing) alone, so pieces, threads and
//! memory cannot change it. A rectangle without a void is only copied; around the voids of others the samples within that
//! distance are read.

mod bands;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use serde::Serialize;

use crate::convert::copy::{DerivedBands, run_beside};
use crate::convert::job::{ConvertJob, ConvertOptions, ConvertReport};
use crate::halo::SampleHalo;
use crate::stored;
use bands::FilledBands;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FileOutput, GridInput, GridOutput};
use terrane_engine::{Resources, memory};
use terrane_files::lock;
use terrane_options::{OptionRange, Options};
use terrane_raster::{GridInfo, GridSource, Inputs};
use terrane_window::voids::{VoidFiller, VoidScratch};

/// Most columns and rows that are filled at once.
const PIECE: u32 = 512;
/// Most bytes of filled rows that wait for their strips.
const MAX_BANDS: u64 = 64 << 20;

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
    /// Number of 3 x 3 means that smooth the filled samples
    #[option(value = "N", range = OptionRange::new(0.0, 1000.0))]
    pub smoothing: u32,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How its format is written.
    #[option(flatten)]
    pub written: GridOutput,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
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
    /// The job that copies the filled grid.
    fn copy(&self, inputs: &Inputs, output: &Path) -> ConvertJob {
        let Self { file, written, grid, resources, .. } = self.clone();
        let options =
            ConvertOptions { file, written, grid, resources, ..ConvertOptions::default() };
        ConvertJob { input: inputs.clone(), output: output.to_path_buf(), options }
    }

    fn filler(&self) -> VoidFiller {
        // The ranges of both options are far below.
        let [max_distance, smoothing] =
            [self.max_distance, self.smoothing].map(|n| u16::try_from(n).unwrap_or(u16::MAX - 1));
        VoidFiller { max_distance, smoothing }
    }

    /// The note on voids that are left.
    fn note(&self, left: u64) -> Option<String> {
        let verb = if left == 1 { "void is" } else { "voids are" };
        let most = self.max_distance;
        let cells = if most == 1 { "cell" } else { "cells" };
        (left > 0).then(|| {
            format!(
                "{left} {verb} left, more than {most} {cells} from any valid sample that was read; a larger ‹max_distance› reaches farther"
            )
        })
    }
}

impl Operation for FillOptions {
    const NAME: &'static str = "fill";
    type Input = GridInput;
    const WRITES: Writes = Writes::Grid;
    type Report = FillReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.copy(&Inputs::default(), output).options.check(output)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<FillReport> {
        let RunRequest { inputs, output, progress, cancel, .. } = request;
        if self.grid.clip.is_some() {
            return Err(Error::usage("‹clip› makes voids, which would be filled")
                .remedy("fill the whole grid, then clip it with ‹terrane convert›"));
        }
        let (copy, filler, filled) = (self.copy(inputs, output), self.filler(), Arc::default());
        let opening = self.grid.options(&self.resources, 0)?;
        let grid = memory::open_for_estimate(inputs, &opening)?.info().bounds();
        let bytes = filler.bytes([grid.width, grid.height].map(u64::from), PIECE.into());
        let bands = [(self.resources.memory / 8).min(MAX_BANDS), 0];
        let report = run_beside(&copy, bytes, bands, progress, cancel, |inner, bands| {
            let grid = FilledGrid::new(inner, filler, Arc::clone(&filled), bands);
            Ok(DerivedBands::of(Box::new(grid), Vec::new()))
        });
        let mut common = report.map_err(or_less)?;
        let left = common.samples - common.valid_samples;
        common.notes.extend(self.note(left));
        Ok(FillReport { common, filled: filled.load(Ordering::Relaxed), left })
    }
}

/// Adds a shorter search to the remedy of an error for too little memory, as threads then need less.
fn or_less(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Resource => error.or("a smaller ‹max_distance›"),
        _ => error,
    }
}

/// A grid with filled voids.
struct FilledGrid {
    inner: Box<dyn GridSource>,
    filler: VoidFiller,
    halo: SampleHalo,
    /// Number of filled samples.
    filled: Arc<AtomicU64>,
    bands: FilledBands,
    /// Buffers that no thread is using.
    spare: Mutex<Vec<FillBuffers>>,
}

#[derive(Default)]
struct FillBuffers {
    window: Vec<f64>,
    scratch: VoidScratch,
}

impl FilledGrid {
    /// A grid in front of another, which keeps filled bands of at most `bytes` bytes.
    fn new(
        inner: Box<dyn GridSource>,
        filler: VoidFiller,
        filled: Arc<AtomicU64>,
        bytes: u64,
    ) -> Self {
        let halo = SampleHalo(filler.reach());
        let bands = FilledBands::new(inner.info().width, bytes);
        Self { inner, filler, halo, filled, bands, spare: Mutex::default() }
    }

    /// Fills the voids of a rectangle that was read.
    fn fill<H: Copy + Into<f64>>(
        &self,
        rect: Rect,
        heights: &mut [H],
        narrow: impl Fn(f64) -> H,
    ) -> Result<()> {
        if !heights.iter().any(|height| is_void(*height)) {
            return Ok(());
        }
        let mut buffers = lock(&self.spare).pop().unwrap_or_default();
        let mut filled = 0;
        let mut put = |heights: &mut [H], part: Rect, found: &[f64]| {
            let both = part.intersect(&rect);
            for row in both.row..both.end_row() {
                let at = |of: Rect| {
                    let first = (row - of.row) as usize * of.width as usize;
                    first + (both.col - of.col) as usize
                };
                let found = &found[at(part)..][..both.width as usize];
                for (height, found) in heights[at(rect)..].iter_mut().zip(found) {
                    if is_void(*height) && !found.is_nan() {
                        *height = narrow(stored::nearest(self.info(), *found));
                        filled += 1;
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
        self.filled.fetch_add(filled, Ordering::Relaxed);
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
        self.fill(rect, out, |height| height as f32)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.inner.read_f64(rect, out)?;
        self.fill(rect, out, |height| height)
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
