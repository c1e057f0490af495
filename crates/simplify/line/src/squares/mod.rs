//! Space divided into squares that hold few vertices each, so that each can be untangled by itself.
//!
//! A vertex is in the square that its position is in, so vertices at one position share a square. A
//! segment from one square to another *crosses over*; it is part of every result, and both of its
//! ends are kept. What lies between two such segments is a [`Run`]: all of its vertices are in one
//! square.
//!
//! **Why squares are independent.** Squares are half-open, so the convex hulls of the vertices of
//! different squares have no point in common. A piece of a run, the segment in its place, and the
//! region between them lie within the hull of one square. So a new segment can cross nothing but
//! segments of its own square and segments that cross over, and a region can hold no vertices but
//! those of its own square. Segments that cross over never change: for each square that one
//! passes through it is an obstacle ([`Squares::meeting`]), and two of them that meet have met in
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
//! by the cells of a grid ([`Census`]), and a square of the tree that has too many is divided, in
//! cells that have too many by finer counts ([`Finer`]). The division depends on nothing but how many
//! vertices there are in which cell.

mod census;
mod runs;
#[cfg(test)]
mod tests;
mod tree;

pub use census::{Census, Finer};
pub use runs::{Run, cross_overs, cut};
pub use tree::{Place, Squares};

use terrane_base::geom::plane::Xy;

/// Fraction bits of a float: cells are no smaller than what it leaves of the largest coordinate.
const BITS: i32 = 52;

/// 2 to the power of `exponent`, which is within the range of normal floats.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

/// The cell of side 2^level that a position is in.
#[inline(always)]
fn cell(p: Xy, level: i32) -> [i64; 2] {
    let scale = power(-level);
    p.map(|c| (c * scale).floor() as i64)
}

/// The lowest level for positions of magnitude up to `most`: their cells are whole numbers of 53 bits.
fn lowest_level(most: f64) -> i32 {
    // Coordinates beyond 1e140 are refused, and those below 1e-130 are as good as 0.
    let exponent = (most.max(1e-130).to_bits() >> 52) as i32 - 1022;
    exponent - BITS
}
