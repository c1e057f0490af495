//! Independent proof of a mesh against the points of a cloud: error bound, coverage of the convex
//! hull, topology. Shares no code with what makes such meshes.
//!
//! The lattice is that of the cloud's frame: columns are steps east and rows steps north of the
//! lowest x and y, so that every point is a sample of it, and domains divide it as they divide a
//! grid. Whatever is decided, is decided by exact arithmetic on whole steps.

mod bound;
mod edges;
mod hull;
mod lines;
mod nearest;
mod part;
mod plane;
mod quantize;
mod strips;
#[cfg(test)]
mod tests;
mod vertical_distance;

pub use bound::VerticalBound;
pub use hull::{HullGatherer, ProofHull};
pub use lines::CloudTrack;
pub use nearest::{NearestQuery, ProofNearestPoints};
pub use part::{CloudProofPart, order, position};
pub use quantize::LatticeSnapper;

use std::mem::size_of;

use super::edges::BYTES_PER_TRIANGLE;
use super::{ProofPosition, ProofTally, ProofTriangle};
use terrane_base::geom::Point;

/// Bytes [`check`] needs for a domain of `points` points touched by `triangles` triangles, with
/// `vertices` stored vertices; points, triangles and positions included.
pub fn bytes_needed(points: u64, triangles: u64, vertices: u64) -> u64 {
    let per_point = size_of::<Point>() + vertical_distance::BYTES_PER_POINT;
    let per_triangle =
        size_of::<ProofTriangle>() + BYTES_PER_TRIANGLE + edges::MORE_BYTES_PER_TRIANGLE;
    let per_vertex = size_of::<ProofPosition>();
    points
        .saturating_mul(per_point as u64)
        .saturating_add(triangles.saturating_mul(per_triangle as u64))
        .saturating_add(vertices.saturating_mul(per_vertex as u64))
}

/// Checks one part and adds what it owns to `tally`.
///
/// O(points log points + triangles log triangles + points covered by each triangle + the strips of
/// about 4 sqrt(points) points that each triangle crosses).
pub fn check(part: &CloudProofPart<'_>, tally: &mut ProofTally) {
    let owned = part.triangles.iter().filter(|t| part.domain.owns(t.corners[0].at));
    owned.for_each(|triangle| tally.shape(triangle, 1));
    vertical_distance::check(part, tally);
    edges::check(part, tally);
}
