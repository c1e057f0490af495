//! Fills holes with means of their surroundings, up to a limit.

use crate::lowest_points::EMPTY;

/// Largest half width of a filled hole for windows of this radius: objects removed by a window leave no wider
/// hole.
pub(super) fn reach(radius: usize) -> usize {
    2 * radius
}

/// The cells with a margin of empty ones.
pub(super) fn widened(inner: &[i32], width: usize, margin: usize) -> Vec<i32> {
    let wide = width + 2 * margin;
    let mut cells = vec![EMPTY; wide * (inner.len() / width + 2 * margin)];
    let lines = cells.chunks_exact_mut(wide).skip(margin);
    for (line, inner) in lines.zip(inner.chunks_exact(width)) {
        line[margin..margin + width].copy_from_slice(inner);
    }
    cells
}

/// Fills each empty cell with the mean of the smallest square around it that has enough heights; cells without
/// enough heights within `reach` stay empty.
pub(super) fn filled(heights: &[i32], width: usize, reach: usize) -> Vec<i32> {
    let sums = SummedAreaTable::new(heights, width);
    let filled = heights.iter().enumerate().map(|(at, height)| match *height {
        EMPTY => radii(reach).find_map(|r| sums.mean(at, r)).unwrap_or(EMPTY),
        known => known,
    });
    filled.collect()
}

/// Half widths of squares, each about a third larger than the one before, up to the limit.
fn radii(reach: usize) -> impl Iterator<Item = usize> {
    std::iter::successors((reach > 0).then_some(1), move |r| {
        (*r < reach).then(|| (r + 1 + r / 3).min(reach))
    })
}

/// Sums over all cells west and south of a corner, for the sum of any square in constant time.
struct SummedAreaTable {
    /// Cells of a row.
    width: usize,
    rows: usize,
    /// One more than the cells on each axis: number and sum of the heights.
    corners: Vec<(u32, i64)>,
}

impl SummedAreaTable {
    fn new(heights: &[i32], width: usize) -> Self {
        let rows = heights.len() / width;
        let mut corners = vec![(0, 0); (width + 1) * (rows + 1)];
        for (row, line) in heights.chunks_exact(width).enumerate() {
            let (mut count, mut sum) = (0, 0);
            let (before, after) = corners.split_at_mut((row + 1) * (width + 1));
            let below = &before[row * (width + 1) + 1..];
            for ((corner, below), height) in after[1..].iter_mut().zip(below).zip(line) {
                if *height != EMPTY {
                    count += 1;
                    sum += i64::from(*height);
                }
                *corner = (below.0 + count, below.1 + sum);
            }
        }
        Self { width, rows, corners }
    }

    /// The mean of the square of half width `r` around a cell, rounded down; `None` when it has too
    /// few heights: at least one for every three cells of its radius.
    fn mean(&self, at: usize, r: usize) -> Option<i32> {
        let (col, row) = (at % self.width, at / self.width);
        let (west, east) = (col.saturating_sub(r), (col + r + 1).min(self.width));
        let (south, north) = (row.saturating_sub(r), (row + r + 1).min(self.rows));
        let [ne, nw, se, sw] = [(north, east), (north, west), (south, east), (south, west)]
            .map(|(row, col)| self.corners[row * (self.width + 1) + col]);
        let count = ne.0 + sw.0 - nw.0 - se.0;
        let sum = ne.1 + sw.1 - nw.1 - se.1;
        // Rounded down below 0, too: heights shifted by whole steps have means shifted by as much.
        (count as usize > r / 3).then(|| sum.div_euclid(i64::from(count)) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive(heights: &[i32], width: usize, at: usize, reach: usize) -> i32 {
        let (col, row) = ((at % width) as i64, (at / width) as i64);
        for r in radii(reach) {
            let near = |k: &usize| {
                let (x, y) = ((k % width) as i64 - col, (k / width) as i64 - row);
                x.abs().max(y.abs()) <= r as i64 && heights[*k] != EMPTY
            };
            let found: Vec<i64> =
                (0..heights.len()).filter(near).map(|k| i64::from(heights[k])).collect();
            if found.len() > r / 3 {
                let mean = found.iter().sum::<i64>() as f64 / found.len() as f64;
                return mean.floor() as i32;
            }
        }
        EMPTY
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn holes_have_the_mean_of_the_smallest_square(
            width in 1..20_usize,
            cells in prop::collection::vec(
                prop_oneof![1 => -500..500_i32, 6 => Just(EMPTY)], 1..200),
            reach in 0..9_usize,
        ) {
            let heights = &cells[..cells.len() / width * width];
            for (at, height) in filled(heights, width, reach).into_iter().enumerate() {
                let expected = match heights[at] {
                    EMPTY => naive(heights, width, at, reach),
                    known => known,
                };
                prop_assert_eq!(height, expected);
            }
        }
    }

    #[test]
    fn squares_grow_to_the_limit() {
        assert_eq!(radii(12).collect::<Vec<_>>(), [1, 2, 3, 5, 7, 10, 12]);
        assert_eq!(radii(0).count(), 0);
    }
}
