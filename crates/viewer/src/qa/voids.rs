//! Voids: groups of empty cells, connected by sides, that occupied cells enclose. They are found row by row, from runs of
//! empty cells, in memory for one row.
//!
//! The convex hull of [`cloud_picture`](crate::cloud_picture) would count the bays of an L-shaped survey.

use std::cmp::Reverse;

use super::lattice::QaLattice;
use super::report::{QaVoid, QaVoids};

/// Voids that are listed.
const LISTED: usize = 20;
/// With this number of gaps in a row, or more, voids are not counted.
pub(super) const MAX_GAPS: usize = 1 << 15;
/// Bytes of two rows of gaps: runs, groups and their numbers.
pub(super) const GAP_BYTES: u64 = MAX_GAPS as u64 * 320;

/// Empty cells of a row, both ends included.
#[derive(Clone, Copy, Debug)]
struct VoidRun {
    from: i64,
    to: i64,
    /// Index of its group.
    group: usize,
}

/// Connected empty cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct EnclosedCells {
    cells: u64,
    /// Its first cell (row, column): the westernmost of its southernmost row.
    first: [i64; 2],
    west: i64,
    east: i64,
    north: i64,
    /// Whether it reaches beyond all occupied cells.
    is_open: bool,
}

impl EnclosedCells {
    const OUTSIDE: Self = Self {
        cells: 0,
        first: [i64::MIN; 2],
        west: i64::MIN,
        east: i64::MAX,
        north: i64::MAX,
        is_open: true,
    };

    fn of_run(row: i64, from: i64, to: i64) -> Self {
        let cells = from.abs_diff(to) + 1;
        Self { cells, first: [row, from], west: from, east: to, north: row, is_open: false }
    }

    fn merge(&mut self, other: &Self) {
        self.cells = self.cells.saturating_add(other.cells);
        self.first = self.first.min(other.first);
        self.west = self.west.min(other.west);
        self.east = self.east.max(other.east);
        self.north = self.north.max(other.north);
        self.is_open |= other.is_open;
    }

    fn rank(&self) -> (Reverse<u64>, [i64; 2]) {
        (Reverse(self.cells), self.first)
    }
}

/// Collects the voids of occupied cells that come in the order of rows, then columns.
pub(super) struct VoidTracker {
    /// Fewer cells are no void.
    min_cells: u64,
    row: i64,
    /// Last occupied column of the row.
    last: Option<i64>,
    /// Empty runs of the row, and of the row before.
    current: Vec<VoidRun>,
    runs: Vec<VoidRun>,
    /// Groups of the row before, then of the row; and the list of the next row.
    groups: Vec<EnclosedCells>,
    next: Vec<EnclosedCells>,
    parents: Vec<usize>,
    kept: Vec<Option<usize>>,
    /// Whether a row has [`MAX_GAPS`] or more.
    is_overflow: bool,
    empty: u64,
    count: u64,
    cells: u64,
    largest: Vec<EnclosedCells>,
}

/// The row below all others.
const BELOW: VoidRun = VoidRun { from: i64::MIN, to: i64::MAX, group: 0 };

impl VoidTracker {
    pub(super) fn new(min_cells: u64) -> Self {
        Self {
            min_cells,
            row: i64::MIN,
            last: None,
            current: Vec::new(),
            runs: vec![BELOW],
            groups: vec![EnclosedCells::OUTSIDE],
            next: Vec::new(),
            parents: Vec::new(),
            kept: Vec::new(),
            is_overflow: false,
            empty: 0,
            count: 0,
            cells: 0,
            largest: Vec::new(),
        }
    }

    /// Adds an occupied cell.
    pub(super) fn add(&mut self, [row, col]: [i64; 2]) {
        if self.is_overflow {
            return;
        }
        if row != self.row {
            self.end_row();
            if row != self.row.saturating_add(1) {
                // Open groups only: all runs reach the empty row between.
                (self.runs, self.groups) = (vec![BELOW], vec![EnclosedCells::OUTSIDE]);
            }
            self.row = row;
        }
        let from = self.last.map_or(i64::MIN, |last| last + 1);
        if from < col {
            self.current.push(VoidRun { from, to: col - 1, group: 0 });
        }
        self.last = Some(col);
        self.is_overflow = self.current.len() >= MAX_GAPS;
    }

    fn end_row(&mut self) {
        let Some(last) = self.last.take() else { return };
        self.current.push(VoidRun { from: last + 1, to: i64::MAX, group: 0 });
        let Self { row, current, runs, groups, parents, .. } = self;
        for run in current.iter_mut() {
            run.group = groups.len();
            groups.push(match (run.from, run.to) {
                (i64::MIN, _) | (_, i64::MAX) => EnclosedCells::OUTSIDE,
                (from, to) => EnclosedCells::of_run(*row, from, to),
            });
        }
        parents.clear();
        parents.extend(0..groups.len());
        let mut above = 0;
        for run in current.iter() {
            // Runs of both rows are sorted; one may touch several of the other.
            while runs.get(above).is_some_and(|below| below.to < run.from) {
                above += 1;
            }
            for below in runs[above..].iter().take_while(|below| below.from <= run.to) {
                unite(groups, parents, below.group, run.group);
            }
        }
        self.close();
    }

    /// Counts the groups that end below the row, and keeps the others.
    fn close(&mut self) {
        let Self { current, groups, next, parents, kept, .. } = self;
        kept.clear();
        kept.resize(groups.len(), None);
        for run in current.iter_mut() {
            let root = root(parents, run.group);
            run.group = *kept[root].get_or_insert_with(|| {
                next.push(groups[root]);
                next.len() - 1
            });
        }
        for at in 0..self.groups.len() {
            let group = self.groups[at];
            if self.parents[at] == at && self.kept[at].is_none() && !group.is_open {
                self.count(&group);
            }
        }
        std::mem::swap(&mut self.groups, &mut self.next);
        std::mem::swap(&mut self.runs, &mut self.current);
        self.next.clear();
        self.current.clear();
    }

    fn count(&mut self, group: &EnclosedCells) {
        self.empty += group.cells;
        if group.cells < self.min_cells {
            return;
        }
        self.count += 1;
        self.cells += group.cells;
        self.largest.push(*group);
        if self.largest.len() >= 2 * LISTED {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        self.largest.sort_unstable_by_key(EnclosedCells::rank);
        self.largest.truncate(LISTED);
    }

    /// The voids, and the number of all enclosed empty cells; `None` if a row has too many gaps.
    pub(super) fn finish(mut self, min_area: f64, lattice: &QaLattice) -> Option<(QaVoids, u64)> {
        if self.is_overflow {
            return None;
        }
        self.end_row();
        self.shorten();
        let places = self.largest.iter().map(|group| {
            let [west, south] = lattice.corner([group.first[0], group.west]);
            let [east, north] = lattice.corner([group.north + 1, group.east + 1]);
            let [x, y] = lattice.corner(group.first);
            QaVoid {
                area: group.cells as f64 * lattice.area,
                cells: group.cells,
                bounds: [west, south, east, north],
                inside: [x + lattice.side / 2.0, y + lattice.side / 2.0],
            }
        });
        let voids = QaVoids {
            min_area,
            count: self.count,
            cells: self.cells,
            area: self.cells as f64 * lattice.area,
            largest: places.collect(),
        };
        Some((voids, self.empty))
    }
}

/// The group that a group was united with.
pub(super) fn root(parents: &mut [usize], mut group: usize) -> usize {
    while parents[group] != group {
        parents[group] = parents[parents[group]];
        group = parents[group];
    }
    group
}

fn unite(groups: &mut [EnclosedCells], parents: &mut [usize], a: usize, b: usize) {
    let [a, b] = [root(parents, a), root(parents, b)];
    if a != b {
        // The older root stays: chains remain short.
        let (a, b) = (a.min(b), a.max(b));
        parents[b] = a;
        let other = groups[b];
        groups[a].merge(&other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The sizes of voids in rows from the south, by flood fill of a padded picture.
    fn filled(rows: &[Vec<bool>]) -> Vec<u64> {
        let width = rows[0].len() + 2;
        let mut open = vec![vec![true; width]; rows.len() + 2];
        for (row, cells) in rows.iter().enumerate() {
            for (col, is_occupied) in cells.iter().enumerate() {
                open[row + 1][col + 1] = !is_occupied;
            }
        }
        let mut sizes = Vec::new();
        for start in 0..width * open.len() {
            let mut stack = vec![[start / width, start % width]];
            let (mut size, mut is_open) = (0, false);
            while let Some([row, col]) = stack.pop() {
                if !std::mem::take(&mut open[row][col]) {
                    continue;
                }
                size += 1;
                is_open |= row == 0 || col == 0 || row + 1 == open.len() || col + 1 == width;
                stack.extend((row > 0).then(|| [row - 1, col]));
                stack.extend((col > 0).then(|| [row, col - 1]));
                stack.extend((row + 1 < open.len()).then(|| [row + 1, col]));
                stack.extend((col + 1 < width).then(|| [row, col + 1]));
            }
            sizes.extend((size > 0 && !is_open).then_some(size));
        }
        sizes.sort_unstable();
        sizes
    }

    proptest! {
        #[test]
        fn voids_are_those_of_a_flood_fill(
            rows in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.6), 9), 1..12),
        ) {
            let mut tracker = VoidTracker::new(1);
            for (row, cells) in rows.iter().enumerate() {
                for col in (0..9).filter(|col| cells[*col]) {
                    tracker.add([row as i64, col as i64]);
                }
            }
            tracker.end_row();
            let mut sizes: Vec<u64> = tracker.largest.iter().map(|group| group.cells).collect();
            sizes.sort_unstable();
            let expected = filled(&rows);
            prop_assert_eq!(tracker.empty, expected.iter().sum::<u64>());
            prop_assert_eq!(sizes, expected);
        }
    }
}
