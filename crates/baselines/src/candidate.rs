//! A sample that is further off than allowed, and which of several goes first.

use std::cmp::{Ordering, Reverse};

use crate::grid::PackedSample;
use crate::plane::{PlaneOffset, TrianglePlane};
use crate::settings::BaselineTask;

/// A sample beyond the tolerance. Of two the one with the larger error is the greater, and among equals the
/// one with the lower (row, column).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RefinementCandidate {
    pub(crate) error: f64,
    pub(crate) at: PackedSample,
}

impl RefinementCandidate {
    /// The candidate that a sample of a triangle is, if it is one.
    pub(crate) fn of(
        task: &BaselineTask<'_>,
        at: PackedSample,
        offset: &PlaneOffset,
    ) -> Option<Self> {
        // What is further off by so little that it rounds to nothing is not at 0 all the same.
        let error = || offset.error().max(f64::MIN_POSITIVE);
        task.exceeds(offset).then(|| Self { error: error(), at })
    }

    /// The greatest of a triangle.
    pub(crate) fn worst(task: &BaselineTask<'_>, corners: [PackedSample; 3]) -> Option<Self> {
        let plane = TrianglePlane::new(&task.grid, corners);
        plane.offsets().filter_map(|(at, offset)| Self::of(task, at, &offset)).max()
    }
}

impl Eq for RefinementCandidate {}

impl Ord for RefinementCandidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(Reverse(self.at).cmp(&Reverse(other.at)))
    }
}

impl PartialOrd for RefinementCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
