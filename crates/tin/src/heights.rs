//! Heights of a tile or patch: one contiguous `f32` array with decimated copies.

use super::lattice_position::TilePosition;
use std::cell::Cell;
use terrane_base::cancel::Cancel;
use terrane_base::geom::HeightQuantization;

/// Decimated copies: strides 1, 2, 4, ..., 2^(LEVELS - 1).
pub(super) const LEVELS: usize = 6;
/// Lanes a scan may read beyond the end of a row.
const PADDING: usize = 16;

/// Every `2^k`-th sample of every `2^k`-th row of a field.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldLevel<'a> {
    /// Heights, `pitch` a row, with at least 16 readable values after the last.
    pub(super) heights: &'a [f32],
    /// Values from one row to the next.
    pub(super) pitch: usize,
    /// The stride is `2^shift`.
    pub(super) shift: u32,
    /// Bounds of scans: first and last column, first and last row (decimated units).
    pub(super) bounds: [i32; 4],
}

/// Exact heights of samples.
pub(super) enum ExactSamples<'a> {
    Single(&'a [f32]),
    Exact(&'a [f64]),
}

/// Heights of a rectangle of samples, row by row, NaN where void.
#[derive(Clone, Copy, Debug)]
pub struct HeightWindow<'a> {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` heights.
    pub f32: &'a [f32],
    /// The same in f64, where f32 is not exact.
    pub f64: Option<&'a [f64]>,
}

/// A private copy of a rectangle of heights, with its decimated copies behind it.
#[derive(Debug, Default)]
pub(super) struct HeightField {
    width: u32,
    height: u32,
    values: Vec<f32>,
    starts: [usize; LEVELS],
    exact: Vec<f64>,
    /// Heights of vertices by their samples, if free; else empty. Cells, because vertices move while they are in use.
    free: Vec<Cell<f64>>,
    /// Vertices are rounded to f32 relative to this height.
    rounding: Option<HeightQuantization>,
    /// Samples excluded from scans on the left, right, above and below (1 where the rim is fixed).
    margins: [u32; 4],
    /// Cancellation.
    cancel: Cancel,
}

impl HeightField {
    /// Sets the cancellation.
    pub(super) fn stop_by(&mut self, cancel: &Cancel) {
        self.cancel = cancel.clone();
    }

    /// True once the work is to stop: loops over triangles end then, and leave a mesh that is sound, but
    /// not within the tolerance.
    // Loops ask now and then: code that is rarely run is to stay out of them.
    #[inline(never)]
    pub(super) fn is_stopped(&self) -> bool {
        self.cancel.is_set()
    }

    /// The same, tested in every thousandth round of a loop: about every millisecond.
    #[inline]
    pub(super) fn is_stopped_in(&self, round: usize) -> bool {
        round.is_multiple_of(1024) && self.is_stopped()
    }

    /// Copies the `width` x `height` samples at (`col`, `row`) of `heights`.
    pub(super) fn load(
        &mut self,
        heights: &HeightWindow<'_>,
        [col, row, width, height]: [u32; 4],
        margins: [u32; 4],
        rounding: Option<HeightQuantization>,
    ) {
        (self.width, self.height, self.margins) = (width, height, margins);
        self.rounding = rounding;
        self.values.clear();
        self.exact.clear();
        self.free.clear();
        for r in row..row + height {
            let start = r as usize * heights.width as usize + col as usize;
            let range = start..start + width as usize;
            self.values.extend_from_slice(&heights.f32[range.clone()]);
            if let Some(exact) = heights.f64 {
                self.exact.extend_from_slice(&exact[range]);
            }
        }
        self.starts = [0; LEVELS];
        (1..LEVELS).for_each(|level| self.decimate(level));
        self.values.resize(self.values.len() + PADDING, f32::NAN);
        if heights.f64.is_some() {
            self.exact.resize(self.exact.len() + PADDING, f64::NAN);
        }
    }

    fn decimate(&mut self, level: usize) {
        let source = self.starts[level - 1];
        let (width, height) = self.size(level - 1);
        self.starts[level] = self.values.len();
        for row in (0..height).step_by(2) {
            let first = source + row * width;
            self.values.extend((0..width).step_by(2).map(|_| 0.0));
            let at = self.values.len() - width.div_ceil(2);
            let (finer, coarser) = self.values.split_at_mut(at);
            let samples = finer[first..first + width].iter().step_by(2);
            coarser.iter_mut().zip(samples).for_each(|(to, from)| *to = *from);
        }
    }

    fn size(&self, level: usize) -> (usize, usize) {
        [self.width, self.height].map(|count| ((count as usize - 1) >> level) + 1).into()
    }

    /// The decimated copy with stride `2^level`.
    #[inline(always)]
    pub(super) fn level(&self, level: u8) -> FieldLevel<'_> {
        let shift = u32::from(level);
        let [left, right, above, below] = self.margins;
        let [first_col, last_col] = decimated_range(self.width, [left, right], shift);
        let [first_row, last_row] = decimated_range(self.height, [above, below], shift);
        FieldLevel {
            heights: &self.values[self.starts[level as usize]..],
            pitch: ((self.width as usize - 1) >> level) + 1,
            shift,
            bounds: [first_col, last_col, first_row, last_row],
        }
    }

    /// All samples at full resolution, the rim included.
    pub(super) fn full(&self) -> FieldLevel<'_> {
        let [last_col, last_row] = [self.width, self.height].map(|count| count as i32 - 1);
        FieldLevel { bounds: [0, last_col, 0, last_row], ..self.level(0) }
    }

    /// First and last column, first and last row of scans.
    pub(super) fn scan_bounds(&self) -> [i32; 4] {
        self.level(0).bounds
    }

    /// Columns.
    pub(super) fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub(super) fn height(&self) -> u32 {
        self.height
    }

    /// Index of a sample, row by row.
    #[inline(always)]
    pub(super) fn index(&self, p: TilePosition) -> usize {
        p.row() as usize * self.width as usize + p.col() as usize
    }

    /// The exact height of a sample.
    #[inline(always)]
    pub(super) fn sample(&self, p: TilePosition) -> f64 {
        self.at(self.index(p))
    }

    /// The exact height of the sample at `index`, counted row by row.
    #[inline(always)]
    pub(super) fn at(&self, index: usize) -> f64 {
        if self.exact.is_empty() { f64::from(self.values[index]) } else { self.exact[index] }
    }

    /// All samples, row by row, and 16 values after the last.
    #[inline(always)]
    pub(super) fn samples(&self) -> ExactSamples<'_> {
        match self.exact.is_empty() {
            true => ExactSamples::Single(&self.values),
            false => ExactSamples::Exact(&self.exact),
        }
    }

    /// The maximum absolute height, without voids.
    pub(super) fn largest(&self) -> f64 {
        let samples = &self.values[..self.width as usize * self.height as usize];
        let chunks = samples.chunks(1024);
        let maxima = chunks.map(|chunk| chunk.iter().fold(0.0_f32, |max, z| max.max(z.abs())));
        f64::from(maxima.fold(0.0, f32::max))
    }

    /// The height of a vertex at this sample in the output.
    #[inline(always)]
    pub(super) fn vertex(&self, p: TilePosition) -> f64 {
        match self.free.is_empty() {
            true => self.stored(self.sample(p)),
            false => self.free[self.index(p)].get(),
        }
    }

    /// A height as stored in the output.
    fn stored(&self, height: f64) -> f64 {
        self.rounding.map_or(height, |rounding| rounding.apply(height))
    }

    /// Allows vertices to have other heights than their samples.
    pub(super) fn free_heights(&mut self) {
        let samples = self.width as usize * self.height as usize;
        let mut free = std::mem::take(&mut self.free);
        free.extend((0..samples).map(|index| Cell::new(self.stored(self.at(index)))));
        self.free = free;
    }

    /// True if vertices may have other heights than their samples.
    pub(super) fn is_free(&self) -> bool {
        !self.free.is_empty()
    }

    /// Sets the height of a vertex, rounded as stored in the output. Heights must be free.
    pub(super) fn move_vertex(&self, p: TilePosition, height: f64) {
        self.free[self.index(p)].set(self.stored(height));
    }

    /// The heights of three vertices.
    #[inline(always)]
    pub(super) fn vertices(&self, [a, b, c]: [TilePosition; 3]) -> [f64; 3] {
        [self.vertex(a), self.vertex(b), self.vertex(c)]
    }

    /// Bytes for a tile of `cells` x `cells`, with exact heights, and with free ones if `is_free`.
    pub(super) fn bytes(cells: u32, is_free: bool) -> u64 {
        let samples = u64::from(cells + 1).pow(2);
        samples * 4 * 4 / 3 + samples * if is_free { 16 } else { 8 }
    }
}

/// First and last decimated index at stride `2^shift` of `count` samples without the margins at their ends.
#[inline(always)]
fn decimated_range(count: u32, [before, after]: [u32; 2], shift: u32) -> [i32; 2] {
    let first = (before + (1 << shift) - 1) >> shift;
    let last = (count - 1 - after.min(count - 1)) >> shift;
    [first as i32, last as i32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimated_copies_hold_every_second_sample() {
        let (width, height) = (11, 6);
        let heights: Vec<f32> = (0..width * height).map(|i| i as f32).collect();
        let heights = HeightWindow { width, height, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, width, height], [0; 4], None);
        for level in 0..LEVELS as u8 {
            let copy = field.level(level);
            for row in (0..height).step_by(1 << level) {
                for col in (0..width).step_by(1 << level) {
                    let (r, c) = (row as usize >> level, col as usize >> level);
                    let value = copy.heights[r * copy.pitch + c];
                    assert_eq!(value, (row * width + col) as f32);
                }
            }
        }
    }

    #[test]
    fn the_largest_height_is_that_of_a_sample_below_zero_or_above() {
        for (z, expected) in [
            ([0.0, 1.0, -7.0, 3.0, f32::NAN, 2.0], 7.0),
            ([0.0, 1.0, -7.0, 8.5, f32::NAN, 2.0], 8.5),
            ([f32::NAN, 1.0, -7.0, 8.5, 2.0, -12.0], 12.0),
            ([f32::NAN; 6], 0.0),
        ] {
            let heights = HeightWindow { width: 3, height: 2, f32: &z, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, 3, 2], [0; 4], None);
            assert_eq!(field.largest(), expected, "{z:?}");
        }
    }

    #[test]
    fn a_field_takes_the_bytes_it_tells() {
        for cells in [64, 101, 511] {
            let side = cells + 1;
            let rounded = vec![0.0_f32; (side * side) as usize];
            let exact = vec![0.0_f64; (side * side) as usize];
            let heights =
                HeightWindow { width: side, height: side, f32: &rounded, f64: Some(&exact) };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, side, side], [1; 4], None);
            let held = 4 * field.values.len() + 8 * field.exact.len();
            let told = HeightField::bytes(cells, false);
            // Odd sides leave a little more in the copies.
            let share = told as f64 / held as f64;
            assert!((0.97..1.01).contains(&share), "{cells}: {told} for {held}");
        }
    }

    #[test]
    fn the_margin_keeps_scans_off_the_rim() {
        let heights = [0.0; 9 * 5];
        let heights = HeightWindow { width: 9, height: 5, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, 9, 5], [1; 4], None);
        assert_eq!(field.level(0).bounds, [1, 7, 1, 3]);
        assert_eq!(field.level(1).bounds, [1, 3, 1, 1]);
        assert_eq!(field.level(3).bounds, [1, 0, 1, 0]);
    }
}
