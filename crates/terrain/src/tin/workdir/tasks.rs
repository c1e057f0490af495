//! The tasks of a mesh: strips of tile rows, and the seams between them.
//!
//! A strip is as wide as the grid, so strips follow each other in the order of ids, each has at most two
//! neighbours, and a strip waits for nothing. The seam between two strips waits for both.
//!
//! **Why strips and not squares of tiles.** Squares share sides with four neighbours and corners with four
//! more, so a task would wait for eight others, or compute a frame of tiles twice (41 % more for 16 x 16
//! tiles). Strips compute nothing twice, and numbering and writing need a few rows of tiles in memory at any
//! size. A strip has at least two rows of tiles: 0.8 billion samples at a width of 800,000 samples, a
//! reasonable task for one machine.

use std::fmt;

use crate::tin::layout::{TileId, TileLayout};
use crate::tin::task_scope::{LayoutWork, RunScope};
use terrane_engine::plan::Numbered;

/// Approximate number of samples of a strip.
const STRIP_SAMPLES: u64 = 1 << 27;
/// Fewest rows of tiles in a strip: each is changed by the seam on one side only.
pub(super) const MIN_ROWS: u32 = 2;

/// A task, by the number of its strip or of the strip above its seam.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum StripTask {
    Strip(u32),
    Seam(u32),
}

impl StripTask {
    /// By name.
    pub(super) const NAMES: [Numbered<Self>; 2] = [("strip", Self::Strip), ("seam", Self::Seam)];

    /// The tasks whose objects it works on.
    pub(super) fn before(self) -> Vec<Self> {
        match self {
            Self::Seam(above) => vec![Self::Strip(above), Self::Strip(above + 1)],
            Self::Strip(_) => Vec::new(),
        }
    }
}

impl fmt::Display for StripTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Strip(strip) => write!(f, "strip-{strip}"),
            Self::Seam(above) => write!(f, "seam-{above}"),
        }
    }
}

/// How a layout is cut into strips.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileStrips {
    layout: TileLayout,
    rows: u32,
}

impl TileStrips {
    /// Strips of `rows` rows of tiles, by default of about [`STRIP_SAMPLES`].
    pub(super) fn new(layout: TileLayout, rows: Option<u32>) -> Self {
        let row = layout.samples() / u64::from(layout.rows);
        let usual = STRIP_SAMPLES.div_ceil(row.max(1)).min(layout.rows.into()) as u32;
        Self { layout, rows: rows.unwrap_or(usual).max(MIN_ROWS) }
    }

    /// The tiling that is cut.
    pub(super) fn layout(&self) -> TileLayout {
        self.layout
    }

    /// Rows of tiles in all strips but the last.
    pub(super) fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of strips. Rows that are too few for one more belong to the last.
    pub(super) fn count(&self) -> u32 {
        let (full, rest) = (self.layout.rows / self.rows, self.layout.rows % self.rows);
        (full + u32::from(rest >= MIN_ROWS)).max(1)
    }

    /// All tasks, in an order in which they can be done.
    pub(super) fn tasks(&self) -> impl Iterator<Item = StripTask> + use<> {
        let tasks = (0..self.count()).flat_map(|strip| {
            [Some(StripTask::Strip(strip)), strip.checked_sub(1).map(StripTask::Seam)]
        });
        tasks.flatten()
    }

    /// The part of the work that is a task.
    pub(super) fn work(&self, task: StripTask) -> LayoutWork {
        let scope = match task {
            StripTask::Strip(strip) => {
                let [first, end] = self.rows_of(strip);
                RunScope::Strip { first, end }
            }
            StripTask::Seam(above) => RunScope::Seam { above: self.rows_of(above)[1] - 1 },
        };
        LayoutWork { layout: self.layout, scope }
    }

    /// The first row of tiles of a strip, and the one after the last.
    fn rows_of(&self, strip: u32) -> [u32; 2] {
        let last = strip + 1 == self.count();
        [strip * self.rows, if last { self.layout.rows } else { (strip + 1) * self.rows }]
    }

    /// The task that leaves the containers of a row of tiles as they are when all seams are mended.
    pub(super) fn last_of(&self, row: u32) -> StripTask {
        let strip = self.strip_of(row);
        let [first, end] = self.rows_of(strip);
        if row + 1 == end && end < self.layout.rows {
            StripTask::Seam(strip)
        } else if row == first && strip > 0 {
            StripTask::Seam(strip - 1)
        } else {
            StripTask::Strip(strip)
        }
    }

    /// The task that triangulates a row of tiles.
    pub(super) fn first_of(&self, row: u32) -> StripTask {
        StripTask::Strip(self.strip_of(row))
    }

    /// The strip of a row of tiles.
    fn strip_of(&self, row: u32) -> u32 {
        (row / self.rows).min(self.count() - 1)
    }

    /// Where the container of `tile` is in the object of `task`.
    pub(super) fn position(&self, task: StripTask, tile: TileId) -> u64 {
        self.work(task).position(tile)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strips(rows: u32, by: Option<u32>) -> TileStrips {
        TileStrips::new(TileLayout::new(100, rows * 16 + 1, 16).unwrap(), by)
    }

    #[test]
    fn every_row_is_in_one_strip_and_no_strip_is_too_low() {
        for rows in 1..40 {
            for by in 1..9 {
                let strips = strips(rows, Some(by));
                let mut next = 0;
                for strip in 0..strips.count() {
                    let [first, end] = strips.rows_of(strip);
                    assert_eq!(first, next);
                    assert!(end - first >= MIN_ROWS.min(rows));
                    assert!((first..end).all(|row| strips.strip_of(row) == strip));
                    next = end;
                }
                assert_eq!(next, rows);
            }
        }
    }

    #[test]
    fn every_tile_is_final_in_the_last_task_that_touches_it() {
        let strips = strips(11, Some(3));
        let order: Vec<StripTask> = strips.tasks().collect();
        for row in 0..11 {
            let tile = TileId::new(row, 2);
            let touches = |task: &&StripTask| {
                let work = strips.work(**task);
                (0..work.tiles()).any(|i| work.tile_at(i) == tile)
            };
            assert_eq!(order.iter().rfind(touches), Some(&strips.last_of(row)), "row {row}");
        }
    }

    #[test]
    fn tasks_come_after_those_they_wait_for() {
        let order: Vec<StripTask> = strips(11, Some(3)).tasks().collect();
        assert_eq!(order.len(), 4 + 3);
        for (i, task) in order.iter().enumerate() {
            assert!(task.before().iter().all(|before| order[..i].contains(before)), "{task}");
        }
    }

    #[test]
    fn strips_are_fair_pieces_of_work() {
        let rows = |width, height| {
            TileStrips::new(TileLayout::new(width, height, 512).unwrap(), None).rows()
        };
        assert_eq!((rows(80_000, 80_000), rows(800_000, 800_000), rows(1000, 1000)), (4, 2, 2));
    }
}
