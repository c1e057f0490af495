//! Samples beyond the tolerance, and their order.

use std::cmp::{Ordering, Reverse};

use crate::grid::PackedSample;
use crate::plane::{PlaneOffset, TrianglePlane};
use crate::settings::BaselineTask;

/// A sample beyond the tolerance, ordered by its error, and for equal errors by descending (row, column).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RefinementCandidate {
    pub(crate) error: f64,
    pub(crate) at: PackedSample,
}

impl RefinementCandidate {
    /// A sample of a triangle as a candidate, if it is beyond the tolerance.
    pub(crate) fn of(
        task: &BaselineTask<'_>,
        at: PackedSample,
        offset: &PlaneOffset,
    ) -> Option<Self> {
        // An error may round to 0; a candidate's must not.
        task.exceeds(offset).then(|| Self { error: offset.error().max(f64::MIN_POSITIVE), at })
    }

    /// The greatest candidate of a triangle.
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
