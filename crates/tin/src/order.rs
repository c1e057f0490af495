//! Sorting by position: rows first, by counting, then within each row.

use super::lattice_position::TilePosition;
use super::spec::TileTriangle;

/// Sorts triangles by their corners. Expected time is linear but for the length of the rows.
pub fn sort_by_position(triangles: &mut Vec<TileTriangle>) {
    by_rows(triangles, |triangle| triangle.corners[0], |triangle| triangle.corners);
}

/// Sorts by `key`, which begins with the position `first`.
pub(super) fn by_rows<T: Copy, K: Ord>(
    items: &mut Vec<T>,
    first: impl Fn(&T) -> TilePosition,
    key: impl Fn(&T) -> K,
) {
    let Some(rows) = items.iter().map(|item| first(item).row() as usize + 1).max() else { return };
    let mut ends = vec![0_usize; rows + 1];
    items.iter().for_each(|item| ends[first(item).row() as usize + 1] += 1);
    (1..=rows).for_each(|row| ends[row] += ends[row - 1]);
    let mut sorted = items.clone();
    for item in &*items {
        let place = &mut ends[first(item).row() as usize];
        sorted[*place] = *item;
        *place += 1;
    }
    let mut start = 0;
    for end in ends {
        sorted[start..end].sort_unstable_by_key(&key);
        start = end;
    }
    *items = sorted;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sorts_as_the_library_does(
            positions in proptest::collection::vec((0_u32..50, 0_u32..9, 0_u32..4), 0..300)
        ) {
            let mut items: Vec<(TilePosition, u32)> =
                positions.iter().map(|&(col, row, n)| (TilePosition::new(col, row), n)).collect();
            let mut expected = items.clone();
            expected.sort_unstable();
            by_rows(&mut items, |item| item.0, |&item| item);
            prop_assert_eq!(items, expected);
        }
    }
}
