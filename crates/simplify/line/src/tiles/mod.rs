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
//! **Rings across tiles.** Such a ring R becomes a ring R' that has the segments that cross over and the
//! winding numbers of R outside all hulls, because the curves in which they differ lie in hulls. Hulls are
//! closed and disjoint, so a segment that crosses over has a part outside all of them, with unchanged winding
//! numbers on both sides. If R does not cross itself, neither does R': its segments are those of R, or new
//! ones, which cross nothing. It has at least three distinct vertices, because two segments that cross over
//! would coincide otherwise. So it has an area with the orientation of R, as these winding numbers show. (For a
//! ring that crosses itself the sign of the total area may change: this has to be checked.)
//!
//! **The tiles** are those of a quadtree over powers of two, independent of the extent, so the cell of a
//! position is exact: a multiplication by a power of two and a floor. Vertices are counted in the cells of a
//! grid ([`VertexHistogram`]). A tile with too many vertices is divided, with finer counts for cells with too
//! many ([`RefinedCounts`]). The division depends only on the number of vertices per cell.

mod runs;
#[cfg(test)]
mod tests;
mod tree;
mod vertex_counts;

pub use runs::{TileRun, cross_overs, cut};
pub use tree::{LastTile, RefinedCounts, VertexQuadtree};
pub use vertex_counts::VertexHistogram;
