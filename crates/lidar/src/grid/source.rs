//! The bands of a complete grid as grid sources.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

use super::blocks::CellBlocks;
use super::extent::{CellRequest, GridExtent};
use super::heights::HeightSource;
use super::report::GridBandReport;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::{Cancel, Progress};
use terrane_gridding::{CellUnits, StatisticBand, fill};
use terrane_raster::write::GridSink;
use terrane_raster::{GridInfo, GridSource};
use terrane_terrain::convert::{copy_levels, task};

/// Cells whose values are known.
pub(super) trait CellSource: Sync {
    /// The values of band `number` (`band`) in `rect` of the written cells; NaN for voids.
    fn values(
        &self,
        number: usize,
        band: &StatisticBand,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()>;

    /// Releases `rect`: none of its bands will be read again.
    fn release(&self, _rect: Rect) {}
}

/// Bands whose values are known.
pub(super) struct CellBands<'a> {
    pub(super) cells: &'a dyn CellSource,
    pub(super) bands: &'a [StatisticBand],
    /// The grid as it is written.
    pub(super) info: &'a GridInfo,
}

impl CellBands<'_> {
    /// Writes the values of all bands to the sink; returns the number of valid cells of each.
    pub(super) fn write(
        &self,
        sink: &mut dyn GridSink,
        threads: usize,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Vec<u64>> {
        let bands = (0..self.bands.len()).map(|number| BandSource::new(self, number));
        let bands: Vec<_> = bands.collect();
        let sources: Vec<_> = bands.iter().map(|band| band as &dyn GridSource).collect();
        let window = self.info.bounds();
        progress.begin("write", window.len() as u64);
        let pieces = task::CopyPieces::new(window, &bands[0], sink, 0);
        let task = task::CopyTask { sources: &sources, window, sink, pieces };
        task.run(threads, progress, cancel)?;
        progress.end();
        copy_levels(sink, threads, progress, cancel)?;
        Ok(bands.iter().map(BandSource::valid).collect())
    }

    pub(super) fn reports(&self, valid: &[u64]) -> Vec<GridBandReport> {
        let bands = self.bands.iter().zip(valid);
        bands.map(|(band, &valid)| GridBandReport { name: band.label.clone(), valid }).collect()
    }
}

/// A grid with all its points.
pub(super) struct FinishedGrid<'a> {
    pub(super) blocks: &'a CellBlocks<'a>,
    pub(super) extent: &'a GridExtent,
    pub(super) units: CellUnits,
    /// Heights for bands that need them.
    pub(super) heights: Option<HeightSource>,
    /// Longest edge of triangles that are surface, in world units.
    pub(super) max_edge: Option<f64>,
}

impl FinishedGrid<'_> {
    /// A rectangle of written cells, relative to all computed cells.
    fn computed(&self, rect: Rect) -> Rect {
        let Rect { col, row, .. } = self.extent.output;
        Rect::new(rect.col + col, rect.row + row, rect.width, rect.height)
    }

    /// The values of a band in `rect` of all computed cells; NaN for voids.
    fn unfilled(&self, band: &StatisticBand, rect: Rect, out: &mut [f64]) -> Result<()> {
        if let (Some(heights), true) = (&self.heights, band.is_triangulated()) {
            let piece = CellRequest { extent: self.extent, rect, max_edge: self.max_edge };
            return heights.values(band.statistic, piece, out);
        }
        out.fill(if band.counts() { 0.0 } else { f64::NAN });
        let (stride, shift) = (rect.width as usize, self.blocks.shift());
        for index in self.blocks.touching(rect) {
            let window = self.blocks.window(index);
            let part = window.intersect(&rect);
            self.blocks.read(index, |block| {
                for row in part.row..part.row + part.height {
                    let from = ((row - window.row) << shift) + (part.col - window.col);
                    let to = (row - rect.row) as usize * stride + (part.col - rect.col) as usize;
                    let line = &mut out[to..to + part.width as usize];
                    for (out, at) in line.iter_mut().zip(from as usize..) {
                        *out = block.value(band, at, &self.units);
                    }
                }
            })?;
        }
        Ok(())
    }

    /// The values of a band with voids filled.
    fn filled(&self, band: &StatisticBand, rect: Rect, out: &mut [f64]) -> Result<()> {
        let reach = self.extent.fill;
        if reach == 0 || !band.statistic.fills() {
            return self.unfilled(band, rect, out);
        }
        // What is written has a margin of the reach all around.
        let (width, height) = (rect.width + 2 * reach, rect.height + 2 * reach);
        let around = Rect::new(rect.col - reach, rect.row - reach, width, height);
        let mut values = vec![0.0; around.len()];
        self.unfilled(band, around, &mut values)?;
        let mut unfilled = vec![0.0; rect.len()];
        self.unfilled(band, rect, &mut unfilled)?;
        void_beyond(&mut values, around, self.extent.known);
        // A cell outside the cloud's bounds is no source, but keeps its own value.
        fill(&values, around, rect, reach, out);
        let known = out.iter_mut().zip(unfilled).filter(|(_, value)| !value.is_nan());
        known.for_each(|(out, value)| *out = value);
        Ok(())
    }
}

impl CellSource for FinishedGrid<'_> {
    fn values(&self, _: usize, band: &StatisticBand, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.filled(band, self.computed(rect), out)
    }

    fn release(&self, rect: Rect) {
        self.blocks.release(self.computed(rect));
    }
}

/// Sets the cells of `around` outside of `known` to NaN.
fn void_beyond(values: &mut [f64], around: Rect, known: Rect) {
    for (row, line) in (around.row..).zip(values.chunks_exact_mut(around.width as usize)) {
        let inside = (known.row..known.row + known.height).contains(&row);
        for (col, value) in (around.col..).zip(line) {
            if !inside || !(known.col..known.col + known.width).contains(&col) {
                *value = f64::NAN;
            }
        }
    }
}

/// One band.
pub(super) struct BandSource<'a> {
    of: &'a CellBands<'a>,
    number: usize,
    valid: AtomicU64,
}

thread_local! {
    /// Reusable buffer for conversion to f32; allocating it for each block is slower.
    static VALUES: Cell<Vec<f64>> = const { Cell::new(Vec::new()) };
}

/// Largest count up to which all are exact in `f32`.
const EXACT: f64 = (1 << 24) as f64;

impl<'a> BandSource<'a> {
    pub(super) fn new(of: &'a CellBands<'a>, number: usize) -> Self {
        Self { of, number, valid: AtomicU64::new(0) }
    }

    /// Valid cells read; a count of 0 is not valid.
    pub(super) fn valid(&self) -> u64 {
        self.valid.load(Ordering::Relaxed)
    }

    fn band(&self) -> &'a StatisticBand {
        &self.of.bands[self.number]
    }

    fn narrow(&self, values: &[f64], out: &mut [f32]) -> Result<()> {
        let is_count = self.band().statistic.is_whole();
        if is_count && let Some(inexact) = values.iter().find(|count| **count > EXACT) {
            return Err(Error::usage(format!("a count of {inexact} is not exact in float32"))
                .remedy("pass ‹type› float64"));
        }
        out.iter_mut().zip(values).for_each(|(out, value)| *out = *value as f32);
        Ok(())
    }

    fn tally(&self, values: &[f64]) {
        let counts = self.band().counts();
        let valid = values.iter().filter(|value| !value.is_nan() && (!counts || **value != 0.0));
        let valid = valid.count();
        self.valid.fetch_add(valid as u64, Ordering::Relaxed);
    }
}

impl GridSource for BandSource<'_> {
    fn info(&self) -> &GridInfo {
        self.of.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        let mut values = VALUES.take();
        values.clear();
        values.resize(rect.len(), 0.0);
        let read = self.read_f64(rect, &mut values).and_then(|()| self.narrow(&values, out));
        VALUES.set(values);
        read
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.of.cells.values(self.number, self.band(), rect, out)?;
        self.tally(out);
        Ok(())
    }

    fn release(&self, rect: Rect) {
        if self.number + 1 == self.of.bands.len() {
            self.of.cells.release(rect);
        }
    }
}
