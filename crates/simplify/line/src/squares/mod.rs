//! Space divided into squares that hold few vertices each, so that each can be untangled by itself.
//!
//! A vertex is in the square that its position is in, so vertices at one position share a square. A
//! segment from one square to another *crosses over*; it is part of every result, and both of its
//! ends are kept. What lies between two such segments is a [`TileRun`]: all of its vertices are in one
//! square.
//!
//! **Why squares are independent.** Squares are half-open, so the convex hulls of the vertices of
//! different squares have no point in common. A piece of a run, the segment in its place, and the
//! region between them lie within the hull of one square. So a new segment can cross nothing but
//! segments of its own square and segments that cross over, and a region can hold no vertices but
//! those of its own square. Segments that cross over never change: for each square that one
//! passes through it is an obstacle ([`VertexQuadtree::meeting`]), and two of them that meet have met in
//! the input. What holds for [`super::topology`] in each square, obstacles among the chains, holds for
//! all squares together.
//!
//! **Rings across squares.** Such a ring R becomes a ring R' that has the segments that cross over
//! and the winding numbers of R wherever no hull is, as the curves in which they differ lie in hulls.
//! Hulls are closed and disjoint, so a segment that crosses over has a stretch outside of them all, on
//! both sides of which the winding numbers are the same before and after. If R crosses nothing, neither
//! does R': all of its segments are new, which cross nothing, or R's. It has three different
//! vertices at least, as two segments that cross over would be the same otherwise. So it has an area,
//! and of the sign of R's, which those winding numbers tell. (Of a ring that crosses itself the sign of
//! the sum of its areas may change: that has to be looked at.)
//!
//! **The squares** are those of a quadtree over powers of two, whatever the extent, so a
//! position's cell is exact: a multiplication by a power of two and a floor. Vertices are counted
//! by the cells of a grid ([`VertexHistogram`]), and a square of the tree that has too many is divided, in
//! cells that have too many by finer counts ([`RefinedCounts`]). The division depends on nothing but how many
//! vertices there are in which cell.

mod census;
mod runs;
#[cfg(test)]
mod tests;
mod tree;

pub use census::VertexHistogram;
pub use runs::{TileRun, cross_overs, cut};
pub use tree::{LastTile, RefinedCounts, VertexQuadtree};
