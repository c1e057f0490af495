//! Fills voids of a window from the nearest samples in four directions.
//!
//! In each of four quadrants around a void (north-east, south-east, south-west, north-west; a quadrant has one of the
//! two half-axes that bound it, so that all four are alike) the nearest valid sample counts, if it is within reach. The
//! height is the mean of those samples, weighted by the inverse of their distance in cells. This is the rule of
//! `gdal_fillnodata`, except that GDAL 3.10 counts samples straight above and below in the western quadrants and samples
//! in the row of the void in the northern ones, and that of equally near samples it takes any.
//!
//! For each sample of the window, two tables hold the distance to the nearest valid sample above and below. A void then
//! walks the columns outward on both sides, from one with a sample within reach to the next, until a column is farther
//! away than the samples found.
//!
//! ```
//! use terrane_base::geom::Rect;
//! use terrane_window::voids::{VoidFiller, VoidScratch};
//!
//! let heights = [1.0, f64::NAN, f64::NAN, 4.0];
//! let filler = VoidFiller { max_distance: 2, smoothing: 0 };
//! let mut scratch = VoidScratch::default();
//! let filled = filler.fill(&heights, [4, 1], Rect::new(0, 0, 4, 1), &mut scratch);
//! assert_eq!(filled, [1.0, 2.0, 3.0, 4.0]);
//! ```

use terrane_base::geom::Rect;

/// No valid sample in a column.
const NONE: u16 = u16::MAX;

/// Rule of filling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoidFiller {
    /// Greatest distance of a sample that counts, in cells; less than 65,535.
    pub max_distance: u16,
    /// Number of means over 3 x 3 samples that smooth filled heights.
    pub smoothing: u16,
}

/// Buffers of a window.
#[derive(Debug, Default)]
pub struct VoidScratch {
    /// Distance to the nearest valid sample above and below each sample, exclusive.
    above: Vec<u16>,
    below: Vec<u16>,
    /// For a row: the first column from each on that has a sample within reach, and the last before each, plus 1.
    next: Vec<usize>,
    before: Vec<usize>,
    /// Filled heights of a rectangle with a margin for smoothing, and those of the next pass.
    filled: Vec<f64>,
    smooth: Vec<f64>,
    out: Vec<f64>,
}

/// The nearest sample of each quadrant: squared distance and height.
type Quadrants = [(u32, f64); 4];

impl VoidFiller {
    /// Rows and columns around a rectangle that its heights depend on.
    pub fn reach(&self) -> u32 {
        u32::from(self.max_distance) + u32::from(self.smoothing)
    }

    /// Bytes of the window and the buffers for a rectangle of `side` columns and rows, in a `grid` of some columns and rows.
    pub fn bytes(&self, grid: [u64; 2], side: u64) -> u64 {
        let samples = |halo: u32| {
            let wide = side + 2 * u64::from(halo);
            grid.map(|side| side.min(wide)).iter().product::<u64>()
        };
        samples(self.reach()) * 12 + samples(self.smoothing.into()) * 16 + samples(0) * 8
    }

    /// The heights of a rectangle of a window, row by row: voids within reach of a valid sample are filled, others stay
    /// NaN. `size` has the columns and rows of the window, which must have [`reach`](Self::reach) samples around the
    /// rectangle, or end with the grid.
    pub fn fill<'a>(
        &self,
        heights: &[f64],
        size: [usize; 2],
        rect: Rect,
        scratch: &'a mut VoidScratch,
    ) -> &'a [f64] {
        let window = VoidWindow { heights, width: size[0] };
        window.measure(self.max_distance, scratch);
        let margin = u32::from(self.smoothing);
        let [col, row] = [rect.col, rect.row].map(|at| at.saturating_sub(margin));
        let [right, bottom] = [(rect.end_col(), size[0]), (rect.end_row(), size[1])]
            .map(|(end, size)| (u64::from(end) + u64::from(margin)).min(size as u64) as u32);
        let wide = Rect::new(col, row, right - col, bottom - row);
        scratch.filled.clear();
        for row in wide.row as usize..wide.end_row() as usize {
            window.measure_row(row, scratch);
            for col in wide.col as usize..wide.end_col() as usize {
                let height = heights[row * size[0] + col];
                let height = match height.is_nan() {
                    true => self.height(&window, scratch, [col, row]),
                    false => height,
                };
                scratch.filled.push(height);
            }
        }
        (0..self.smoothing).for_each(|_| smooth(&window, wide, scratch));
        let VoidScratch { filled, out, .. } = scratch;
        out.clear();
        for row in rect.row..rect.end_row() {
            let first = (row - wide.row) as usize * wide.width as usize;
            let first = first + (rect.col - wide.col) as usize;
            out.extend_from_slice(&filled[first..first + rect.width as usize]);
        }
        out
    }

    /// The height of a void. The two sides have no quadrant in common, and are walked one after the other.
    fn height(&self, window: &VoidWindow<'_>, scratch: &VoidScratch, at: [usize; 2]) -> f64 {
        let limit = u32::from(self.max_distance).pow(2) + 1;
        let mut nearest: Quadrants = [(limit, f64::NAN); 4];
        let [col, row] = at;
        let mut there = scratch.next[col];
        while there < window.width {
            let squared = ((there - col) * (there - col)) as u32;
            if nearest[0].0.max(nearest[1].0) <= squared {
                break;
            }
            window.visit(scratch, [there, row], squared, &mut nearest, [0, 1], there > col);
            there = scratch.next[there + 1];
        }
        let mut there = scratch.before[col + 1];
        while there > 0 {
            let squared = ((col + 1 - there) * (col + 1 - there)) as u32;
            if nearest[2].0.max(nearest[3].0) <= squared {
                break;
            }
            window.visit(scratch, [there - 1, row], squared, &mut nearest, [3, 2], there <= col);
            there = scratch.before[there - 1];
        }
        mean(&nearest)
    }
}

/// The mean of heights weighted by the inverse of their distance; NaN without any.
fn mean(nearest: &Quadrants) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (squared, height) in nearest.iter().filter(|(_, height)| !height.is_nan()) {
        let weight = 1.0 / f64::from(*squared).sqrt();
        sum += weight * height;
        weights += weight;
    }
    sum / weights
}

/// A window of samples.
struct VoidWindow<'a> {
    heights: &'a [f64],
    width: usize,
}

impl VoidWindow<'_> {
    /// Fills the tables of distances up to `max`.
    fn measure(&self, max: u16, scratch: &mut VoidScratch) {
        let (width, len) = (self.width, self.heights.len());
        scratch.above.clear();
        scratch.above.resize(len, NONE);
        scratch.below.clear();
        scratch.below.resize(len, NONE);
        let next = |height: f64, distance: u16| match (height.is_nan(), distance) {
            (false, _) => 1,
            (true, distance) if distance < max => distance + 1,
            _ => NONE,
        };
        for at in width..len {
            scratch.above[at] = next(self.heights[at - width], scratch.above[at - width]);
        }
        for at in (0..len.saturating_sub(width)).rev() {
            scratch.below[at] = next(self.heights[at + width], scratch.below[at + width]);
        }
    }

    /// Finds the columns of a row with a sample in it, above or below.
    fn measure_row(&self, row: usize, scratch: &mut VoidScratch) {
        let (first, width) = (row * self.width, self.width);
        let VoidScratch { above, below, next, before, .. } = scratch;
        let is_near = |col: usize| {
            let at = first + col;
            !self.heights[at].is_nan() || above[at] != NONE || below[at] != NONE
        };
        next.clear();
        next.resize(width + 1, width);
        before.clear();
        before.resize(width + 1, 0);
        for col in (0..width).rev() {
            next[col] = if is_near(col) { col } else { next[col + 1] };
        }
        for col in 0..width {
            before[col + 1] = if is_near(col) { col + 1 } else { before[col] };
        }
    }

    /// Updates the two quadrants of a column, `sides` [above, below] its row. The row itself belongs to one of them in
    /// columns beside the void.
    fn visit(
        &self,
        scratch: &VoidScratch,
        [col, row]: [usize; 2],
        squared: u32,
        nearest: &mut Quadrants,
        [up, down]: [usize; 2],
        is_beside: bool,
    ) {
        let at = row * self.width + col;
        let here = self.heights[at];
        // Clockwise from the north-east: the row to the right belongs to the south-east, that to the left to the
        // north-west; the column above to the north-east, that below to the south-west.
        let is_right = up == 0;
        let own = if is_right { down } else { up };
        for (quadrant, distance, is_up) in
            [(up, scratch.above[at], true), (down, scratch.below[at], false)]
        {
            let of_column = is_beside || is_up == is_right;
            let (distance, height) =
                match (quadrant == own && is_beside && !here.is_nan(), distance) {
                    (true, _) => (0, here),
                    (_, NONE) => continue,
                    (_, distance) => {
                        let rows = usize::from(distance) * self.width;
                        let there = if is_up { at - rows } else { at + rows };
                        (distance, self.heights[there])
                    }
                };
            let found = squared + u32::from(distance).pow(2);
            if of_column && found < nearest[quadrant].0 {
                nearest[quadrant] = (found, height);
            }
        }
    }
}

/// A mean of the valid samples among 3 x 3, for samples that were void in the window.
fn smooth(window: &VoidWindow<'_>, wide: Rect, scratch: &mut VoidScratch) {
    let VoidScratch { filled, smooth, .. } = scratch;
    let [width, height] = [wide.width as usize, wide.height as usize];
    smooth.clear();
    smooth.extend_from_slice(filled);
    for row in 0..height {
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        for col in 0..width {
            let there = (row + wide.row as usize) * window.width + col + wide.col as usize;
            if !window.heights[there].is_nan() || filled[row * width + col].is_nan() {
                continue;
            }
            let cols = col.saturating_sub(1)..(col + 2).min(width);
            let (mut sum, mut count) = (0.0, 0.0);
            for row in rows.clone() {
                for height in &filled[row * width..][cols.clone()] {
                    if !height.is_nan() {
                        sum += height;
                        count += 1.0;
                    }
                }
            }
            smooth[row * width + col] = sum / count;
        }
    }
    std::mem::swap(filled, smooth);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The quadrant of an offset, clockwise from the north-east.
    fn quadrant([dx, dy]: [i64; 2]) -> usize {
        match [dx >= 0, dx > 0, dy >= 0, dy > 0] {
            [true, _, false, _] => 0,
            [_, true, true, _] => 1,
            [_, false, _, true] => 2,
            _ => 3,
        }
    }

    /// The height of a void by looking at all samples.
    fn slow(heights: &[f64], width: usize, at: usize, max: i64) -> f64 {
        let [col, row] = [at % width, at / width].map(|at| at as i64);
        let mut nearest: [Option<(i64, i64, f64)>; 4] = [None; 4];
        for (other, height) in heights.iter().enumerate().filter(|(_, height)| !height.is_nan()) {
            let [dx, dy] = [(other % width) as i64 - col, (other / width) as i64 - row];
            let found = (dx * dx + dy * dy, dx.abs(), *height);
            let own = &mut nearest[quadrant([dx, dy])];
            if found.0 <= max * max && own.is_none_or(|own| (found.0, found.1) < (own.0, own.1)) {
                *own = Some(found);
            }
        }
        let found = nearest.iter().flatten();
        let [sum, weights] = found.fold([0.0, 0.0], |[sum, weights], (squared, _, height)| {
            let weight = 1.0 / (*squared as f64).sqrt();
            [sum + weight * height, weights + weight]
        });
        sum / weights
    }

    /// All heights of a grid, filled and smoothed at once.
    fn slow_all(heights: &[f64], width: usize, filler: VoidFiller) -> Vec<f64> {
        let height = heights.len() / width;
        let max = i64::from(filler.max_distance);
        let mut all: Vec<f64> = (0..heights.len())
            .map(|at| match heights[at].is_nan() {
                true => slow(heights, width, at, max),
                false => heights[at],
            })
            .collect();
        for _ in 0..filler.smoothing {
            let before = all.clone();
            for at in (0..all.len()).filter(|at| heights[*at].is_nan() && !before[*at].is_nan()) {
                let [col, row] = [at % width, at / width];
                let rows = (row.max(1) - 1..=row + 1).filter(|row| *row < height);
                let near = rows.flat_map(|row| {
                    let cols = (col.max(1) - 1..=col + 1).filter(|col| *col < width);
                    cols.map(move |col| row * width + col)
                });
                let near: Vec<f64> = near.map(|at| before[at]).filter(|z| !z.is_nan()).collect();
                all[at] = near.iter().sum::<f64>() / near.len() as f64;
            }
        }
        all
    }

    fn same(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len()
            && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan())
    }

    proptest! {
        #[test]
        fn any_window_of_a_grid_is_filled_as_by_looking_at_all_samples(
            [width, height] in [1_usize..24, 1_usize..20],
            seed: u64,
            valid in 0_u64..100,
            max_distance in 1_u16..12,
            smoothing in 0_u16..4,
            corner in [0.0..1.0, 0.0..1.0],
            far in [0.0..1.0, 0.0..1.0],
        ) {
            let draw = |at: usize| (at as u64 + 1).wrapping_mul(seed | 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
            let heights: Vec<f64> = (0..width * height)
                .map(|at| if draw(at) % 100 < valid { (draw(at + 7919) % 1000) as f64 / 8.0 } else { f64::NAN })
                .collect();
            let filler = VoidFiller { max_distance, smoothing };
            let expected = slow_all(&heights, width, filler);
            let part = |a: f64, b: f64, size: usize| {
                let first = (a * size as f64) as usize;
                (first, first + 1 + (b * (size - first - 1) as f64) as usize)
            };
            let ((left, right), (top, bottom)) = (part(corner[0], far[0], width), part(corner[1], far[1], height));
            // The window around the part, as far as it matters.
            let reach = filler.reach() as usize;
            let [x0, y0] = [left.saturating_sub(reach), top.saturating_sub(reach)];
            let [x1, y1] = [(right + reach).min(width), (bottom + reach).min(height)];
            let window: Vec<f64> = (y0..y1).flat_map(|row| heights[row * width + x0..row * width + x1].to_vec()).collect();
            let mut scratch = VoidScratch::default();
            let rect = Rect::new((left - x0) as u32, (top - y0) as u32, (right - left) as u32, (bottom - top) as u32);
            let found = filler.fill(&window, [x1 - x0, y1 - y0], rect, &mut scratch);
            let part: Vec<f64> = (top..bottom).flat_map(|row| expected[row * width + left..row * width + right].to_vec()).collect();
            prop_assert!(same(found, &part), "{found:?} {part:?}");
        }
    }

    #[test]
    fn quadrants_are_alike_when_the_window_is_turned() {
        // A sample on each half-axis and one between each two, all at other distances.
        let offsets = [[0, -3], [2, -2], [4, 0], [3, 1], [0, 2], [-1, 2], [-3, 0], [-2, -3]];
        let mut offsets: Vec<[i64; 2]> = offsets.to_vec();
        let mut found = Vec::new();
        for _ in 0..4 {
            let mut heights = vec![f64::NAN; 81];
            for (value, [dx, dy]) in offsets.iter().enumerate() {
                heights[((4 + dy) * 9 + 4 + dx) as usize] = (value * value) as f64;
            }
            let filler = VoidFiller { max_distance: 6, smoothing: 0 };
            let mut scratch = VoidScratch::default();
            found.push(filler.fill(&heights, [9, 9], Rect::new(4, 4, 1, 1), &mut scratch)[0]);
            offsets.iter_mut().for_each(|[dx, dy]| (*dx, *dy) = (-*dy, *dx));
        }
        assert!(found.iter().all(|z| (z - found[0]).abs() < 1e-12), "{found:?}");
        // By hand: north-east [2, -2] (8), south-east [3, 1] (10), south-west [0, 2] (4), north-west [-3, 0] (9).
        let weights = [(8_f64, 1.0), (10.0, 9.0), (4.0, 16.0), (9.0, 36.0)];
        let [sum, all] = weights.iter().fold([0.0, 0.0], |[sum, all], (squared, z)| {
            [sum + z / squared.sqrt(), all + 1.0 / squared.sqrt()]
        });
        assert!((found[0] - sum / all).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn voids_farther_than_the_distance_stay() {
        let mut heights = vec![f64::NAN; 12];
        heights[0] = 7.0;
        let filler = VoidFiller { max_distance: 3, smoothing: 2 };
        let mut scratch = VoidScratch::default();
        let found = filler.fill(&heights, [12, 1], Rect::new(0, 0, 12, 1), &mut scratch).to_vec();
        assert!(found[..4].iter().all(|z| *z == 7.0) && found[4..].iter().all(|z| z.is_nan()));
        let none = [f64::NAN; 4];
        let found = filler.fill(&none, [2, 2], Rect::new(0, 0, 2, 2), &mut scratch);
        assert!(found.iter().all(|z| z.is_nan()));
    }

    #[test]
    fn smoothing_changes_filled_heights_only() {
        let heights = [0.0, f64::NAN, f64::NAN, 9.0];
        let fill = |smoothing| {
            let filler = VoidFiller { max_distance: 5, smoothing };
            filler
                .fill(&heights, [4, 1], Rect::new(0, 0, 4, 1), &mut VoidScratch::default())
                .to_vec()
        };
        assert_eq!(fill(0), [0.0, 3.0, 6.0, 9.0]);
        assert_eq!(fill(1), [0.0, 3.0, 6.0, 9.0]);
        let step = [0.0, 0.0, f64::NAN, f64::NAN, f64::NAN, 8.0];
        let filler = VoidFiller { max_distance: 5, smoothing: 1 };
        let mut scratch = VoidScratch::default();
        let found = filler.fill(&step, [6, 1], Rect::new(0, 0, 6, 1), &mut scratch);
        assert_eq!(found, [0.0, 0.0, 2.0, 4.0, 6.0, 8.0]);
    }
}
