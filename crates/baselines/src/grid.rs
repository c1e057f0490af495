//! The input of the methods: heights of samples, and positions packed into one number.

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::HeightQuantization;
use terrane_base::geom::predicates::Lattice;

/// Bits of a column.
const BITS: u32 = 14;

/// A sample: column and row below 2^14, packed so that the order of numbers is (row, column) order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PackedSample(u32);

impl PackedSample {
    /// The sample in this column and row, both below 2^14.
    #[inline(always)]
    pub fn new(col: u32, row: u32) -> Self {
        debug_assert!(col >> BITS == 0 && row >> BITS == 0);
        Self(row << BITS | col)
    }

    /// Column, from 0.
    #[inline(always)]
    pub fn col(self) -> u32 {
        self.0 & ((1 << BITS) - 1)
    }

    /// Row, from 0.
    #[inline(always)]
    pub fn row(self) -> u32 {
        self.0 >> BITS
    }

    /// As coordinates for the predicates.
    #[inline(always)]
    pub(crate) fn lattice(self) -> Lattice {
        [self.col() as i32, self.row() as i32]
    }
}

/// Heights of a grid in memory.
#[derive(Clone, Copy, Debug)]
pub struct HeightGrid<'a> {
    width: u32,
    height: u32,
    heights: &'a [f64],
    rounding: Option<HeightQuantization>,
}

/// Maximum number of samples along a side: all predicates are exact in 64 bits.
pub const MOST_SIDE: u32 = 1 << BITS;

impl<'a> HeightGrid<'a> {
    /// A grid of `width` columns and `height` rows of samples; `heights` row by row, NaN where void.
    /// Vertices have heights after `rounding`, if the output stores f32.
    ///
    /// # Errors
    /// Usage: the number of heights differs from that of samples, or a height is infinite. Limit: a side of more than
    /// 2^14 samples.
    pub fn new(
        width: u32,
        height: u32,
        heights: &'a [f64],
        rounding: Option<HeightQuantization>,
    ) -> Result<Self> {
        check_sides(width, height)?;
        if heights.len() as u64 != u64::from(width) * u64::from(height) {
            let message =
                format!("{} heights for a grid of {width} x {height} samples", heights.len());
            return Err(Error::usage(message).remedy("give one height for each sample"));
        }
        if heights.iter().any(|height| height.is_infinite()) {
            return Err(Error::usage("a height is infinite").remedy("use NaN for voids"));
        }
        Ok(Self { width, height, heights, rounding })
    }

    /// Columns of samples.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows of samples.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Index of a sample, row by row.
    #[inline(always)]
    pub(crate) fn index(&self, at: PackedSample) -> usize {
        at.row() as usize * self.width as usize + at.col() as usize
    }

    /// Samples.
    pub(crate) fn len(&self) -> usize {
        self.heights.len()
    }

    /// The height of a sample, NaN where void.
    #[inline(always)]
    pub fn sample(&self, at: PackedSample) -> f64 {
        self.heights[self.index(at)]
    }

    /// The heights of a row from one column to another, both included.
    pub(crate) fn row(&self, row: u32, low: u32, high: u32) -> &[f64] {
        &self.heights
            [self.index(PackedSample::new(low, row))..=self.index(PackedSample::new(high, row))]
    }

    /// Height in the output of a vertex at this sample.
    #[inline(always)]
    pub fn vertex(&self, at: PackedSample) -> f64 {
        let height = self.sample(at);
        self.rounding.map_or(height, |rounding| rounding.apply(height))
    }

    /// All samples in (row, column) order.
    pub(crate) fn samples(&self) -> impl Iterator<Item = PackedSample> + use<> {
        let (width, height) = (self.width, self.height);
        (0..height).flat_map(move |row| (0..width).map(move |col| PackedSample::new(col, row)))
    }

    /// True if the cell whose first sample is (`col`, `row`) has four valid samples.
    pub(crate) fn holds_cell(&self, col: u32, row: u32) -> bool {
        let corners = [(col, row), (col + 1, row), (col, row + 1), (col + 1, row + 1)];
        col + 1 < self.width
            && row + 1 < self.height
            && corners.iter().all(|&(col, row)| !self.sample(PackedSample::new(col, row)).is_nan())
    }

    /// True for samples of the first and the last column.
    fn is_on_west_or_east(&self, at: PackedSample) -> bool {
        at.col() == 0 || at.col() + 1 == self.width
    }

    /// True for samples of the first and the last row.
    fn is_on_north_or_south(&self, at: PackedSample) -> bool {
        at.row() == 0 || at.row() + 1 == self.height
    }

    /// True for samples on the sides of the grid.
    pub(crate) fn is_on_side(&self, at: PackedSample) -> bool {
        self.is_on_west_or_east(at) || self.is_on_north_or_south(at)
    }

    /// True for the four corners of the grid.
    pub(crate) fn is_corner(&self, at: PackedSample) -> bool {
        self.is_on_west_or_east(at) && self.is_on_north_or_south(at)
    }
}

/// Fails if a grid with these sides is too large.
///
/// # Errors
/// Limit: a side of more than 2^14 samples.
pub fn check_sides(width: u32, height: u32) -> Result<()> {
    if width.max(height) > MOST_SIDE {
        let message = format!(
            "a grid of {width} x {height} samples exceeds the limit of {MOST_SIDE} along a side"
        );
        return Err(Error::new(ErrorKind::Limit, message)
            .remedy("leave ‹method› out: the default method supports grids of any size"));
    }
    Ok(())
}
