//! Histogram of vertices by cells whose sides are powers of two.

use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::{MOST, Xy};

/// Largest number of cells along x and along y.
const SIDE: i64 = 1024;

/// Fraction bits of a float, which limit the smallest cell relative to the largest coordinate.
const BITS: i32 = 52;

/// 2^`exponent`, within the range of normal floats.
pub(super) fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

/// Cell of side 2^level of a position.
#[inline(always)]
pub(super) fn cell(p: Xy, level: i32) -> [i64; 2] {
    let scale = power(-level);
    p.map(|c| (c * scale).floor() as i64)
}

/// Lowest level for positions of magnitude up to `most`, with cell numbers of at most 53 bits.
fn lowest_level(most: f64) -> i32 {
    // Coordinates above 1e140 are rejected, and those below 1e-130 count as 0.
    let exponent = (most.max(1e-130).to_bits() >> 52) as i32 - 1022;
    exponent - BITS
}

/// Vertex counts in the cells of a grid of at most 1024 x 1024 cells.
///
/// The grid grows by merging two by two cells: the result does not depend on the order. 8 MiB, and 2 more while
/// it grows.
#[derive(Clone, Debug)]
pub struct VertexHistogram {
    /// The lowest and highest coordinates.
    bounds: [Xy; 2],
    level: i32,
    /// Counts, row by row; column and row are the last ten bits of a cell's numbers.
    counts: Vec<u64>,
    total: u64,
}

impl Default for VertexHistogram {
    fn default() -> Self {
        let bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        Self { bounds, level: i32::MIN, counts: vec![0; (SIDE * SIDE) as usize], total: 0 }
    }
}

impl VertexHistogram {
    /// Counts vertices. O(n), and O(cells) when the grid grows.
    ///
    /// # Errors
    /// `BadInput` for a coordinate that is not finite or beyond [`MOST`].
    pub fn add(&mut self, points: &[Xy]) -> Result<()> {
        let mut bounds = self.bounds;
        for p in points {
            for axis in 0..2 {
                // False for NaN, too.
                let is_sound = p[axis].abs() <= MOST;
                if !is_sound {
                    let message = format!("position {p:?} is not finite or too large");
                    return Err(Error::bad_input(message).remedy("remove or repair the vertex"));
                }
                bounds[0][axis] = bounds[0][axis].min(p[axis]);
                bounds[1][axis] = bounds[1][axis].max(p[axis]);
            }
        }
        if bounds != self.bounds {
            self.grow(bounds);
        }
        for &p in points {
            let at = place(cell(p, self.level));
            self.counts[at] += 1;
        }
        self.total += points.len() as u64;
        Ok(())
    }

    /// Number of counted vertices.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Extends the grid to `bounds`.
    fn grow(&mut self, bounds: [Xy; 2]) {
        let mut level = self.level.max(lowest_level(magnitude(bounds)));
        while !fits(bounds.map(|p| cell(p, level))) {
            level += 1;
        }
        if level > self.level && self.total > 0 {
            let up = (level - self.level).min(63);
            let old = self.bounds.map(|p| cell(p, self.level));
            let new = old.map(|at| at.map(|c| c >> up));
            // At most a quarter of all cells, and those along two sides.
            let width = new[1][0] - new[0][0] + 1;
            let index = |at: [i64; 2]| ((at[1] - new[0][1]) * width + at[0] - new[0][0]) as usize;
            let mut sums = vec![0; index(new[1]) + 1];
            for at in cells(old) {
                sums[index(at.map(|c| c >> up))] += std::mem::take(&mut self.counts[place(at)]);
            }
            for at in cells(new) {
                self.counts[place(at)] = sums[index(at)];
            }
        }
        (self.level, self.bounds) = (level, bounds);
    }

    /// Lowest possible level of cells.
    pub(super) fn lowest_level(&self) -> i32 {
        lowest_level(magnitude(self.bounds))
    }

    /// Non-empty counts for prefix sums: up to 8 MiB more.
    pub(super) fn counts(&self) -> SummedVertexCounts {
        let range = self.bounds.map(|p| cell(p, self.level));
        SummedVertexCounts::new(self.level, range, |at| self.counts[place(at)])
    }
}

fn magnitude(bounds: [Xy; 2]) -> f64 {
    bounds.as_flattened().iter().fold(0.0, |most, c| c.abs().max(most))
}

fn fits([low, high]: [[i64; 2]; 2]) -> bool {
    high[0] - low[0] < SIDE && high[1] - low[1] < SIDE
}

fn place(cell: [i64; 2]) -> usize {
    ((cell[1] & (SIDE - 1)) * SIDE + (cell[0] & (SIDE - 1))) as usize
}

/// All cells of a range, row by row.
fn cells([low, high]: [[i64; 2]; 2]) -> impl Iterator<Item = [i64; 2]> {
    (low[1]..=high[1]).flat_map(move |y| (low[0]..=high[0]).map(move |x| [x, y]))
}

/// Prefix sums of counts in x and y.
#[derive(Clone, Debug)]
pub(super) struct SummedVertexCounts {
    pub(super) level: i32,
    low: [i64; 2],
    size: [i64; 2],
    sums: Vec<u64>,
}

impl SummedVertexCounts {
    /// Sum over cells of a range, both ends included.
    pub(super) fn new(level: i32, range: [[i64; 2]; 2], count: impl Fn([i64; 2]) -> u64) -> Self {
        let low = range[0];
        let size = [0, 1].map(|axis| range[1][axis] - low[axis] + 1);
        let mut sums = vec![0; ((size[0] + 1) * (size[1] + 1)) as usize];
        let at = |x: i64, y: i64| (y * (size[0] + 1) + x) as usize;
        for [x, y] in cells([[1, 1], size]) {
            let before = sums[at(x - 1, y)] + sums[at(x, y - 1)] - sums[at(x - 1, y - 1)];
            sums[at(x, y)] = before + count([low[0] + x - 1, low[1] + y - 1]);
        }
        Self { level, low, size, sums }
    }

    /// Counted cells.
    pub(super) fn range(&self) -> [[i64; 2]; 2] {
        [self.low, [0, 1].map(|axis| self.low[axis] + self.size[axis] - 1)]
    }

    /// Count in a cell of this level or a higher one.
    pub(super) fn of(&self, cell: [i64; 2], level: i32) -> u64 {
        let up = level - self.level;
        let [low, high] = [0, 1].map(|by| {
            [0, 1]
                .map(|axis| (((cell[axis] + by) << up) - self.low[axis]).clamp(0, self.size[axis]))
        });
        let sum = |x: i64, y: i64| self.sums[(y * (self.size[0] + 1) + x) as usize];
        sum(high[0], high[1]) + sum(low[0], low[1]) - sum(low[0], high[1]) - sum(high[0], low[1])
    }
}
