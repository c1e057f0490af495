//! The unit of a proof: a rectangle of the lattice, with everything that touches it.

use super::bound::VerticalBound;
use super::hull::ProofHull;
use super::lines::CloudTrack;
use crate::{GridDomain, ProofPosition, ProofTriangle};
use terrane_base::geom::Point;

/// One rectangle of the lattice to check, with all that touches it.
#[derive(Debug)]
pub struct CloudProofPart<'a> {
    /// The positions it owns.
    pub domain: GridDomain,
    /// Every point that lies in the domain, x and y counted from the corner of the lattice, sorted
    /// by [`order`].
    pub points: &'a [Point],
    /// Every triangle that touches the domain, in any order; others do no harm.
    pub triangles: &'a [ProofTriangle],
    /// Positions of all stored vertices of the domain, sorted; `None` when the vertices of the
    /// format have no identity.
    pub vertices: Option<&'a [ProofPosition]>,
    /// The convex hull of all points.
    pub hull: &'a ProofHull,
    /// Largest vertical distance allowed; `None` to measure only.
    pub bound: Option<VerticalBound>,
    /// Required points, at least those of the domain, sorted by [`order`].
    pub kept: &'a [Point],
    /// Breaklines, at least those through the domain.
    pub lines: &'a [CloudTrack],
}

/// The order of points in a [`CloudProofPart`]: by y, then x, then z.
pub fn order(point: &Point) -> (i32, i32, i32) {
    (point.y, point.x, point.z)
}

/// The position of a point, which is of the lattice.
pub fn position(point: Point) -> ProofPosition {
    ProofPosition::sample(i64::from(point.x), i64::from(point.y))
}
