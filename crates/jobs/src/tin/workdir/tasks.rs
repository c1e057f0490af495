//! The tasks of a plan: strips of tile rows, the seams between them, and the writing of the mesh.
//!
//! A strip is as wide as the grid, so strips follow each other in the order of ids, each has at most
//! two neighbours, and a strip waits for nothing. What is done to the rows of tiles on both sides of
//! the line between two strips waits for both.
//!
//! **Why strips and not squares of tiles.** Squares share sides with four neighbours and corners with
//! four more, so a task would wait for eight others, or compute a frame of tiles twice (41 % more for 16
//! x 16 tiles). Strips compute nothing twice, and numbering and writing need a few rows of tiles in
//! memory at any size. A strip of two rows of tiles is the least; at 800,000 samples across that is 0.8
//! billion samples, a fair piece of work for a machine.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::plan::Digest;
use crate::tin::layout::{Layout, TileId};
use crate::tin::scope::{Scope, Work};
use terrane_base::error::Error;

/// Samples that a strip has about.
const STRIP_SAMPLES: u64 = 1 << 27;
/// Fewest rows of tiles in a strip: each is changed by the seam on one side only.
pub(super) const LEAST_ROWS: u32 = 2;

/// A task, by the number of its strip or of the strip above its seam.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum TaskId {
    Strip(u32),
    Seam(u32),
    Finish,
}

impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Strip(strip) => write!(f, "strip-{strip}"),
            Self::Seam(above) => write!(f, "seam-{above}"),
            Self::Finish => f.write_str("finish"),
        }
    }
}

impl FromStr for TaskId {
    type Err = Error;

    fn from_str(text: &str) -> std::result::Result<Self, Error> {
        let number = |kind: &str| text.strip_prefix(kind).and_then(|number| number.parse().ok());
        let strip = number("strip-").map(Self::Strip).or(number("seam-").map(Self::Seam));
        strip.or((text == "finish").then_some(Self::Finish)).ok_or_else(|| {
            Error::usage(format!("\"{text}\" is no task"))
                .remedy("tasks are strip-0, strip-1, ..., seam-0, ..., finish: see terrane status")
        })
    }
}

/// How a layout is cut into strips.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strips {
    layout: Layout,
    rows: u32,
}

impl Strips {
    /// Strips of `rows` rows of tiles, or of as many as make a fair piece of work.
    pub(super) fn new(layout: Layout, rows: Option<u32>) -> Self {
        let row = layout.samples() / u64::from(layout.rows);
        let fair = || STRIP_SAMPLES.div_ceil(row.max(1)).min(layout.rows.into()) as u32;
        Self { layout, rows: rows.unwrap_or_else(fair).max(LEAST_ROWS) }
    }

    /// The tiling that is cut.
    pub(super) fn layout(&self) -> Layout {
        self.layout
    }

    /// Rows of tiles in all strips but the last.
    pub(super) fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of strips. Rows that are too few for one more belong to the last.
    pub(super) fn count(&self) -> u32 {
        let (whole, rest) = (self.layout.rows / self.rows, self.layout.rows % self.rows);
        (whole + u32::from(rest >= LEAST_ROWS)).max(1)
    }

    /// All tasks, in an order in which they can be done.
    pub(super) fn tasks(&self) -> impl Iterator<Item = TaskId> + use<> {
        let seam = |strip: u32| strip.checked_sub(1).map(TaskId::Seam);
        let strips = 0..self.count();
        strips
            .flat_map(move |strip| [Some(TaskId::Strip(strip)), seam(strip)])
            .flatten()
            .chain([TaskId::Finish])
    }

    /// True when there is such a task.
    pub(super) fn has(&self, task: TaskId) -> bool {
        match task {
            TaskId::Strip(strip) => strip < self.count(),
            TaskId::Seam(above) => above < self.count() - 1,
            TaskId::Finish => true,
        }
    }

    /// The part of the work that is a task.
    pub(super) fn work(&self, task: TaskId) -> Work {
        let scope = match task {
            TaskId::Strip(strip) => {
                let [first, end] = self.rows_of(strip);
                Scope::Strip { first, end }
            }
            TaskId::Seam(above) => Scope::Seam { above: self.rows_of(above)[1] - 1 },
            TaskId::Finish => Scope::Write,
        };
        Work { layout: self.layout, scope }
    }

    /// The first row of tiles of a strip, and the one after the last.
    fn rows_of(&self, strip: u32) -> [u32; 2] {
        let last = strip + 1 == self.count();
        [strip * self.rows, if last { self.layout.rows } else { (strip + 1) * self.rows }]
    }

    /// The task that leaves the containers of a row of tiles as they are when all seams are mended.
    pub(super) fn last_of(&self, row: u32) -> TaskId {
        let strip = self.strip_of(row);
        let [first, end] = self.rows_of(strip);
        if row + 1 == end && end < self.layout.rows {
            TaskId::Seam(strip)
        } else if row == first && strip > 0 {
            TaskId::Seam(strip - 1)
        } else {
            TaskId::Strip(strip)
        }
    }

    /// The strip of a row of tiles.
    pub(super) fn strip_of(&self, row: u32) -> u32 {
        (row / self.rows).min(self.count() - 1)
    }

    /// Where the container of `tile` is in the object of `task`.
    pub(super) fn position(&self, task: TaskId, tile: TileId) -> u64 {
        self.work(task).position(tile)
    }
}

/// The tasks whose objects `task` works on; not for the last one, which needs all.
pub(super) fn before(task: TaskId) -> Vec<TaskId> {
    match task {
        TaskId::Seam(above) => vec![TaskId::Strip(above), TaskId::Strip(above + 1)],
        TaskId::Strip(_) | TaskId::Finish => Vec::new(),
    }
}

/// What the object of a task is known by: the plan, the task, and the seals of what it works on.
pub(super) fn key(plan: Digest, task: TaskId, seals: &[Digest]) -> Digest {
    let name = task.to_string();
    let mut parts: Vec<&[u8]> = vec![&plan.0, name.as_bytes()];
    parts.extend(seals.iter().map(|seal| seal.0.as_slice()));
    Digest::of_parts(&parts)
}

/// Where the object `key` of a task lies in a folder of objects.
pub(super) fn object_path(objects: &Path, task: TaskId, key: Digest) -> PathBuf {
    objects.join(format!("{task}-{}.object", key.short()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strips(rows: u32, by: Option<u32>) -> Strips {
        Strips::new(Layout::new(100, rows * 16 + 1, 16).unwrap(), by)
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
                    assert!(end - first >= LEAST_ROWS.min(rows));
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
        let order: Vec<TaskId> = strips.tasks().collect();
        for row in 0..11 {
            let tile = TileId::new(row, 2);
            let touches = |task: &&TaskId| {
                **task != TaskId::Finish && {
                    let work = strips.work(**task);
                    (0..work.tiles()).any(|i| work.tile_at(i) == tile)
                }
            };
            assert_eq!(order.iter().rfind(touches), Some(&strips.last_of(row)), "row {row}");
        }
    }

    #[test]
    fn tasks_come_after_those_they_wait_for_and_have_names() {
        let strips = strips(11, Some(3));
        let order: Vec<TaskId> = strips.tasks().collect();
        assert_eq!(order.len(), 4 + 3 + 1);
        for (i, &task) in order.iter().enumerate() {
            assert!(strips.has(task) && before(task).iter().all(|b| order[..i].contains(b)));
            assert_eq!(task.to_string().parse::<TaskId>().unwrap(), task);
        }
        for bad in ["", "strip", "strip-", "strip-x", "seam--1", "Finish"] {
            assert!(bad.parse::<TaskId>().is_err());
        }
        for beyond in [TaskId::Seam(3), TaskId::Seam(u32::MAX), TaskId::Strip(4)] {
            assert!(!strips.has(beyond), "{beyond}");
        }
    }

    #[test]
    fn strips_are_fair_pieces_of_work() {
        let rows =
            |width, height| Strips::new(Layout::new(width, height, 512).unwrap(), None).rows();
        assert_eq!((rows(80_000, 80_000), rows(800_000, 800_000), rows(1000, 1000)), (4, 2, 2));
    }

    #[test]
    fn keys_differ_by_plan_task_and_seals() {
        let [a, b] = [b"a", b"b"].map(|text| Digest::of(text));
        let keys = [
            key(a, TaskId::Strip(1), &[]),
            key(b, TaskId::Strip(1), &[]),
            key(a, TaskId::Strip(2), &[]),
            key(a, TaskId::Seam(1), &[a, b]),
            key(a, TaskId::Seam(1), &[b, a]),
        ];
        assert!((1..keys.len()).all(|i| !keys[..i].contains(&keys[i])));
    }
}
