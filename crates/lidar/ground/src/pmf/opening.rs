//! Detects objects on the ground by morphological openings with growing windows.

use super::holes::{self, widened};
use super::parameters::Parameters;
use crate::grid::slid;
use crate::lowest_points::EMPTY;

/// Value for cells where no window with a height starts.
const NOTHING: i32 = i32::MIN;

/// Number of cells around a cell that decide whether it is part of an object: the reach of the windows that
/// hold it.
pub(super) fn reach(radius: usize) -> usize {
    2 * radius
}

/// Empties the cells that belong to objects.
pub(super) fn take_off_objects(heights: &mut [i32], width: usize, parameters: &Parameters) {
    let radius = parameters.radius();
    let mut wide = PaddedHeights::around(heights, width, reach(radius));
    wide.heights = holes::filled(&wide.heights, wide.width, holes::reach(radius));
    let mut last = wide.heights.clone();
    for r in radii(radius) {
        let opened = wide.opened(2 * r + 1);
        let threshold = parameters.slope * r as f64 * parameters.cell / parameters.step;
        let rows = heights.chunks_exact_mut(width).enumerate();
        for (row, line) in rows {
            let from = wide.at(row);
            let pairs = last[from..].iter().zip(&opened[from..]);
            for (height, (before, after)) in line.iter_mut().zip(pairs) {
                if f64::from(*before) - f64::from(*after) > threshold {
                    *height = EMPTY;
                }
            }
        }
        last = opened;
    }
}

/// Half widths of the windows: each a quarter larger than the one before, by at least one cell.
fn radii(max: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(1), move |r| (*r < max).then(|| (r + 1 + r / 4).min(max)))
}

/// Heights with a margin.
struct PaddedHeights {
    margin: usize,
    width: usize,
    heights: Vec<i32>,
}

impl PaddedHeights {
    /// The cells with a margin of empty ones.
    fn around(inner: &[i32], width: usize, margin: usize) -> Self {
        let heights = widened(inner, width, margin);
        Self { margin, width: width + 2 * margin, heights }
    }

    /// Where an inner row begins.
    fn at(&self, row: usize) -> usize {
        (row + self.margin) * self.width + self.margin
    }

    /// The opening with a square of `side` cells: at each cell, the highest of the lowest heights of all such
    /// squares that hold it. Empty cells are ignored.
    fn opened(&self, side: usize) -> Vec<i32> {
        let mut heights = slid(self.heights.clone(), self.width, side, i32::min);
        for height in &mut heights {
            *height = if *height == EMPTY { NOTHING } else { *height };
        }
        // Squares are named by their first cell; a cell is in those that begin up to `side` before it.
        heights.reverse();
        let mut opened = slid(heights, self.width, side, i32::max);
        opened.reverse();
        opened
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The highest of the lowest heights of all squares with some height that hold the cell.
    fn naive(frame: &PaddedHeights, at: usize, side: usize) -> i32 {
        let (width, rows) = (frame.width as i64, (frame.heights.len() / frame.width) as i64);
        let (col, row, side) = (at as i64 % width, at as i64 / width, side as i64);
        let height = |col: i64, row: i64| {
            let inside = (0..width).contains(&col) && (0..rows).contains(&row);
            if inside { frame.heights[(row * width + col) as usize] } else { EMPTY }
        };
        let lowest = |west: i64, south: i64| {
            let cells = (0..side).flat_map(|i| (0..side).map(move |j| (west + i, south + j)));
            cells.map(|(col, row)| height(col, row)).min().unwrap_or(EMPTY)
        };
        let squares = (col - side + 1..=col)
            .flat_map(|west| (row - side + 1..=row).map(move |south| (west, south)));
        let found = squares.map(|(west, south)| lowest(west, south)).filter(|low| *low != EMPTY);
        found.max().unwrap_or(NOTHING)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn the_opening_is_that_of_its_definition(
            width in 1..14_usize,
            cells in prop::collection::vec(
                prop_oneof![3 => -50..50_i32, 1 => Just(EMPTY)], 1..120),
            r in 1..4_usize,
        ) {
            let inner = &cells[..cells.len() / width * width];
            let frame = PaddedHeights::around(inner, width, 2 * r);
            let opened = frame.opened(2 * r + 1);
            for row in 0..inner.len() / width {
                let line = frame.at(row)..frame.at(row) + width;
                for (at, opened) in line.clone().zip(&opened[line]) {
                    if frame.heights[at] != EMPTY {
                        prop_assert_eq!(*opened, naive(&frame, at, 2 * r + 1));
                    }
                }
            }
        }
    }

    /// A block of so many cells on level ground, and whether it is taken off; cells are 2 wide and
    /// steps 0.5, so that windows of half width r take off what is higher than 2 r steps.
    fn is_taken_off(side: usize, height: i32, window: f64) -> bool {
        let usual = Parameters::metres(2.0, 0.5);
        let parameters = Parameters { slope: 0.5, window, ..usual };
        let block =
            |k: usize| (8..8 + side).contains(&(k % 24)) && (8..8 + side).contains(&(k / 24));
        let mut heights: Vec<i32> =
            (0..24 * 24).map(|k| if block(k) { height } else { 0 }).collect();
        let before = heights.clone();
        take_off_objects(&mut heights, 24, &parameters);
        let gone: Vec<bool> = heights.iter().map(|height| *height == EMPTY).collect();
        let is_gone = gone.contains(&true);
        assert!((0..gone.len()).all(|k| gone[k] == (is_gone && block(k))), "the block or nothing");
        assert!((0..gone.len()).all(|k| gone[k] || heights[k] == before[k]));
        is_gone
    }

    #[test]
    fn blocks_are_taken_off_that_rise_by_more_than_the_slope_of_the_window() {
        for (side, height, expected) in [
            (1, 2, false),
            (1, 3, true),
            (2, 2, false),
            (2, 3, true),
            // A window of three cells fits on a block of three; that of five does not.
            (3, 3, false),
            (3, 4, false),
            (3, 5, true),
            (4, 5, true),
            (5, 6, false),
            (5, 7, true),
        ] {
            assert_eq!(is_taken_off(side, height, 6.0), expected, "{side} {height}");
        }
        // No window is wider than the largest: half of it is 3 cells.
        assert!(is_taken_off(6, 99, 6.0) && !is_taken_off(7, 99, 6.0));
    }

    #[test]
    fn windows_grow_to_the_largest() {
        assert_eq!(radii(18).collect::<Vec<_>>(), [1, 2, 3, 4, 6, 8, 11, 14, 18]);
        assert_eq!(radii(1).collect::<Vec<_>>(), [1]);
    }
}
