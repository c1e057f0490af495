//! Cells without points within the convex hull of occupied cells, and the largest group of them.

use serde::Serialize;

use super::map::PointDensityMap;

/// Statistics of the void cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct VoidStatistics {
    /// Cells without points.
    pub cells: u64,
    /// Their share of the hull, from 0 to 1.
    pub share: f64,
    /// Area in square units of x and y.
    pub area: f64,
    /// Area of the largest group, connected by sides.
    pub largest_area: f64,
    /// West, south, east, north of that group.
    pub largest_bounds: Option<[f64; 4]>,
}

/// Statistics of the voids, and the hull that contains them.
pub(super) struct VoidCells {
    pub(super) statistics: VoidStatistics,
    /// Per row, the first and the last column of the hull; rows without it have none.
    hull: Vec<Option<[usize; 2]>>,
}

impl VoidCells {
    /// True if a cell (column, row) is within the hull.
    pub(super) fn is_inside(&self, [col, row]: [usize; 2]) -> bool {
        self.hull[row].is_some_and(|[first, last]| first <= col && col <= last)
    }
}

pub(super) fn find(map: &PointDensityMap) -> VoidCells {
    let hull = hull(map);
    let [columns, _] = map.cells.size;
    let mut open = vec![false; map.counts.len()];
    let (mut cells, mut hull_cells) = (0, 0);
    for (row, ends) in hull.iter().enumerate() {
        let Some([first, last]) = *ends else { continue };
        hull_cells += (last - first + 1) as u64;
        let within = row * columns + first..=row * columns + last;
        for (open, count) in open[within.clone()].iter_mut().zip(&map.counts[within]) {
            *open = *count == 0;
            cells += u64::from(*open);
        }
    }
    let largest = largest(open, map.cells.size);
    let area = map.cells.area();
    let statistics = VoidStatistics {
        cells,
        share: cells as f64 / hull_cells.max(1) as f64,
        area: cells as f64 * area,
        largest_area: largest.cells as f64 * area,
        largest_bounds: (largest.cells > 0)
            .then(|| map.cells.bounds(largest.north_west, largest.south_east)),
    };
    VoidCells { statistics, hull }
}

/// The convex hull of the centres of occupied cells, as the first and last column of each row.
fn hull(map: &PointDensityMap) -> Vec<Option<[usize; 2]>> {
    let [columns, _] = map.cells.size;
    let spans: Vec<Option<[i64; 2]>> = map.counts.chunks(columns).map(occupied_span).collect();
    let west: Vec<_> = spans.iter().map(|span| span.map(|[first, _]| first)).collect();
    // Negated, the eastern side is a lower hull too.
    let east: Vec<_> = spans.iter().map(|span| span.map(|[_, last]| -last)).collect();
    let sides = below(&west).into_iter().zip(below(&east));
    sides
        .map(|(first, last)| {
            let [first, last] = [first?, -last?];
            (first <= last).then_some([first as usize, last as usize])
        })
        .collect()
}

/// The first and the last column of a row that have points.
fn occupied_span(row: &[u64]) -> Option<[i64; 2]> {
    let first = row.iter().position(|n| *n > 0)?;
    let last = row.iter().rposition(|n| *n > 0)?;
    Some([first as i64, last as i64])
}

/// The lower convex hull of the values, rounded up to whole numbers, from the first value to the last.
fn below(values: &[Option<i64>]) -> Vec<Option<i64>> {
    let mut chain: Vec<[i64; 2]> = Vec::new();
    for (at, value) in (0..).zip(values) {
        let Some(value) = *value else { continue };
        // Drops vertices on or above the line from their predecessor to the new one.
        while let [.., a, b] = chain[..]
            && (b[1] - a[1]) * (at - a[0]) >= (value - a[1]) * (b[0] - a[0])
        {
            chain.pop();
        }
        chain.push([at, value]);
    }
    let mut out = vec![None; values.len()];
    if let [[at, value]] = chain[..] {
        out[at as usize] = Some(value);
    }
    for pair in chain.windows(2) {
        let [[from, low], [to, high]] = [pair[0], pair[1]];
        for at in from..=to {
            let rise = (high - low) * (at - from);
            // Rounds up: a cell belongs to the hull only if its centre does.
            out[at as usize] = Some(low - (-rise).div_euclid(to - from));
        }
    }
    out
}

/// Void cells connected by their sides, and the corners (column, row) of the box around them.
#[derive(Default)]
struct VoidGroup {
    cells: u64,
    north_west: [usize; 2],
    south_east: [usize; 2],
}

impl VoidGroup {
    fn add(&mut self, [col, row]: [usize; 2]) {
        self.cells += 1;
        self.north_west = [self.north_west[0].min(col), self.north_west[1].min(row)];
        self.south_east = [self.south_east[0].max(col), self.south_east[1].max(row)];
    }
}

/// The largest group of `open` cells, by flood fill.
fn largest(mut open: Vec<bool>, [columns, rows]: [usize; 2]) -> VoidGroup {
    let mut largest = VoidGroup::default();
    let mut stack: Vec<u32> = Vec::new();
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        stack.push(start as u32);
        let mut group = VoidGroup { north_west: [columns, rows], ..VoidGroup::default() };
        while let Some(cell) = stack.pop() {
            let cell = cell as usize;
            let (col, row) = (cell % columns, cell / columns);
            group.add([col, row]);
            let neighbours = [
                (col > 0).then(|| cell - 1),
                (col + 1 < columns).then(|| cell + 1),
                (row > 0).then(|| cell - columns),
                (row + 1 < rows).then(|| cell + columns),
            ];
            for next in neighbours.into_iter().flatten() {
                if std::mem::take(&mut open[next]) {
                    stack.push(next as u32);
                }
            }
        }
        if group.cells > largest.cells {
            largest = group;
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn voids_are_within_the_hull_and_the_largest_is_found() {
        let map = PointDensityMap::of_rows(&[
            &[0, 0, 1, 0, 0, 0],
            &[0, 1, 0, 0, 1, 0],
            &[1, 0, 0, 0, 1, 0],
            &[0, 1, 1, 0, 1, 0],
            &[0, 0, 1, 1, 0, 0],
        ]);
        let found = find(&map);
        let inside = |row: usize| {
            (0..6).map(|col| u8::from(found.is_inside([col, row]))).collect::<Vec<_>>()
        };
        assert_eq!(inside(0), [0, 0, 1, 0, 0, 0]);
        assert_eq!(inside(1), [0, 1, 1, 1, 1, 0]);
        assert_eq!(inside(2), [1, 1, 1, 1, 1, 0]);
        assert_eq!(inside(4), [0, 0, 1, 1, 0, 0]);
        // Two of the second row, three of the third and one of the fourth, all in one group.
        let voids = found.statistics;
        assert_eq!((voids.cells, voids.area, voids.largest_area), (6, 6.0, 6.0));
        assert_eq!(voids.largest_bounds, Some([1.0, 1.0, 4.0, 4.0]));
        assert!((voids.share - 6.0 / 16.0).abs() < 1e-12);
        assert_eq!(find(&PointDensityMap::of_rows(&[&[1]])).statistics.largest_bounds, None);
    }

    /// Whether a place is in the hull of others: some two of them lie on either side of every line through it. By all
    /// triangles of them.
    fn is_within(place: [i64; 2], corners: &[[i64; 2]]) -> bool {
        let turn = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum()
        };
        let between = |a: [i64; 2], b: [i64; 2]| {
            turn(a, b, place) == 0
                && (0..2).all(|k| a[k].min(b[k]) <= place[k] && place[k] <= a[k].max(b[k]))
        };
        corners.iter().any(|a| {
            corners.iter().any(|b| {
                between(*a, *b)
                    || corners.iter().any(|c| {
                        let turns = [turn(*a, *b, place), turn(*b, *c, place), turn(*c, *a, place)];
                        turn(*a, *b, *c) != 0
                            && (turns.iter().all(|t| *t > 0) || turns.iter().all(|t| *t < 0))
                    })
            })
        })
    }

    proptest! {
        #[test]
        fn the_hull_is_that_of_all_triangles(cells in prop::collection::vec((0usize..9, 0usize..7), 1..9)) {
            let mut rows = vec![vec![0; 9]; 7];
            cells.iter().for_each(|(col, row)| rows[*row][*col] += 1);
            let map = PointDensityMap::of_rows(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>());
            let found = find(&map);
            let corners: Vec<[i64; 2]> = cells.iter().map(|(c, r)| [*c as i64, *r as i64]).collect();
            for (col, row) in (0..63).map(|i| (i % 9, i / 9)) {
                let expected = is_within([col as i64, row as i64], &corners);
                prop_assert_eq!(found.is_inside([col, row]), expected, "{} {}", col, row);
            }
        }
    }
}
