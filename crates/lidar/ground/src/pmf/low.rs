//! Removes points below the ground: multipath echoes among the lowest points of cells.

use crate::grid::within;
use crate::lowest_points::EMPTY;

/// Cells on each side that a cell is compared with.
pub(super) const REACH: usize = 2;
/// Number of neighbours of a valid cell that are as low; so many cells may be noise at once.
const RANK: usize = 3;

/// Removes heights more than `depth` steps below the third lowest around them; the bottom of a ditch has lower
/// neighbours. Cells with few neighbours are kept.
pub(super) fn without_noise(minima: &[i32], width: usize, depth: f64) -> Vec<i32> {
    let cleaned = minima.iter().enumerate().map(|(at, &own)| {
        let is_noise = own != EMPTY
            && third_lowest_around(minima, width, at)
                .is_some_and(|low| f64::from(low) - f64::from(own) > depth);
        if is_noise { EMPTY } else { own }
    });
    cleaned.collect()
}

/// The third lowest height around a cell, if there are three.
fn third_lowest_around(minima: &[i32], width: usize, at: usize) -> Option<i32> {
    let (col, row) = (at % width, at / width);
    let rows = within(row, REACH, minima.len() / width);
    let cols = within(col, REACH, width);
    let mut lowest = [EMPTY; RANK];
    for line in rows {
        let from = line * width;
        for (k, height) in (from + cols.start..).zip(&minima[from + cols.start..from + cols.end]) {
            if k != at {
                insert(&mut lowest, *height);
            }
        }
    }
    lowest.last().copied().filter(|low| *low != EMPTY)
}

/// Inserts a height into the sorted lowest ones, dropping the highest.
#[inline(always)]
fn insert(lowest: &mut [i32; RANK], height: i32) {
    let mut height = height;
    for low in lowest {
        let higher = height.max(*low);
        *low = height.min(*low);
        height = higher;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn noise_is_below_the_third_lowest_around_it(
            width in 1..10_usize,
            cells in prop::collection::vec(
                prop_oneof![3 => -90..90_i32, 1 => Just(EMPTY)], 1..80),
        ) {
            let minima = &cells[..cells.len() / width * width];
            let kept = without_noise(minima, width, 20.0);
            for (at, height) in minima.iter().enumerate() {
                let near = |k: &usize| {
                    (k % width).abs_diff(at % width) <= 2
                        && (k / width).abs_diff(at / width) <= 2
                        && *k != at
                };
                let mut around: Vec<i32> = (0..minima.len()).filter(near).map(|k| minima[k]).collect();
                around.sort();
                let third = around.get(2).copied().filter(|low| *low != EMPTY);
                let is_noise = *height != EMPTY && third.is_some_and(|low| low - height > 20);
                prop_assert_eq!(kept[at], if is_noise { EMPTY } else { *height });
            }
        }
    }

    #[test]
    fn a_ditch_is_no_noise() {
        let cells: Vec<i32> = (0..100).map(|k| if k % 10 == 4 { -300 } else { 0 }).collect();
        assert_eq!(without_noise(&cells, 10, 100.0)[10..90], cells[10..90], "but for its ends");
        let mut pit = vec![0; 100];
        (pit[44], pit[45]) = (-300, -900);
        let bare = without_noise(&pit, 10, 100.0);
        assert!(
            bare.iter().enumerate().all(|(k, z)| *z == if k == 44 || k == 45 { EMPTY } else { 0 })
        );
    }
}
