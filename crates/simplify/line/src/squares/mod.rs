//! Division of space into tiles with few vertices each, which are untangled independently.
//!
//! A vertex is in the tile of its position, so vertices at one position share a tile. A segment between tiles
//! *crosses over*; it is part of every result, and both of its ends are kept. The part between two such
//! segments is a [`TileRun`]: all of its vertices are in one tile.
//!
//! **Why tiles are independent.** Tiles are half-open, so the convex hulls of vertices of different tiles are
//! disjoint. A piece of a run, the segment that replaces it, and the region between them lie within the hull of
//! one tile. So a new segment can cross only segments of its own tile and segments that cross over, and a
//! region contains only vertices of its own tile. Segments that cross over never change: each is an obstacle in
//! every tile that it passes ([`VertexQuadtree::meeting`]), and two of them that meet have met in the input.
//! The guarantees of [`super::topology`] in each tile, with obstacles among the chains, therefore hold for all
//! tiles together.
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
