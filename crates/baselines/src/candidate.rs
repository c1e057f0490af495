//! A sample that is further off than allowed, and which of several goes first.

use std::cmp::{Ordering, Reverse};

use crate::grid::Sample;
use crate::plane::{Offset, Plane};
use crate::task::Task;

/// A sample beyond the tolerance. Of two the one with the larger error is the greater, and among equals the
/// one with the lower (row, column).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) error: f64,
    pub(crate) at: Sample,
}

impl Candidate {
    /// The candidate that a sample of a triangle is, if it is one.
    pub(crate) fn of(task: &Task<'_>, at: Sample, offset: &Offset) -> Option<Self> {
        // What is further off by so little that it rounds to nothing is not at 0 all the same.
        let error = || offset.error().max(f64::MIN_POSITIVE);
        task.exceeds(offset).then(|| Self { error: error(), at })
    }

    /// The greatest of a triangle.
    pub(crate) fn worst(task: &Task<'_>, corners: [Sample; 3]) -> Option<Self> {
        let plane = Plane::new(&task.grid, corners);
        plane.offsets().filter_map(|(at, offset)| Self::of(task, at, &offset)).max()
    }
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(Reverse(self.at).cmp(&Reverse(other.at)))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
