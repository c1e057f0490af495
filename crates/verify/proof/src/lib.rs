//! Independent proof of a mesh's promises: error bound, coverage, topology; and its [`quality`], which is
//! measured and not judged. Pure; shares no code with `tin`.
//!
//! Everything is decided one [`Domain`] (a rectangle of samples) at a time, from the triangles
//! that touch it and the heights of it and of one sample around it. Each sample, cell, vertex,
//! edge and triangle is owned by exactly one domain, and every figure of a [`Tally`] is a count, a
//! maximum or an exact sum, so the outcome does not depend on how the grid was divided, nor on the
//! order in which domains were done.

mod between;
mod bits;
pub mod cloud;
mod domain;
mod edges;
mod exact;
mod expansion;
mod follow;
mod kept;
pub mod lines;
pub mod quality;
mod sections;
pub mod slope;
mod snap;
mod sum;
mod surface;
mod tally;
pub mod tiles;
mod triangle;
mod unit;
mod worst;

pub use domain::{Domain, Layout};
pub use edges::Open;
pub use follow::Line;
pub use snap::{Precision, Snap, Snapped, Snapper};
pub use sum::ExactSum;
pub use surface::{Followed, Run, Surface};
pub use tally::{Fault, Spot, Tally};
pub use triangle::{Position, Triangle, Vertex};

use std::mem::size_of;

/// One rectangle of samples to check, with all that touches it.
#[derive(Debug)]
pub struct Part<'a> {
    /// The samples it owns, in the grid they belong to.
    pub domain: Domain,
    /// Heights of [`Domain::apron`], row by row, NaN where void.
    pub heights: &'a [f64],
    /// Every triangle that touches the domain, in any order; others do no harm.
    pub triangles: &'a [Triangle],
    /// Positions of all stored vertices of the domain, sorted; `None` when the vertices of the
    /// format have no identity.
    pub vertices: Option<&'a [Position]>,
    /// Samples of the domain that have to be vertices if they belong to the surface, sorted.
    pub kept: &'a [Position],
    /// Breaklines that may come to the domain; others do no harm.
    pub lines: &'a [Line],
    /// What the angles of triangles are held to, if anything.
    pub min_angle: Option<AngleBound>,
    /// How the mesh stores heights.
    pub precision: Precision,
    /// Vertices inside the surface may have other heights than their samples.
    pub is_fitted: bool,
    /// Largest allowed vertical distance; `None` to measure only.
    pub tolerance: Option<f64>,
    /// +1 when a triangle that is counter-clockwise in the world is so in (column, row) axes too,
    /// -1 when it is clockwise there (a north-up grid).
    pub orientation: i128,
}

/// The smallest angle that triangles may have in plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleBound {
    /// In degrees.
    pub degrees: f64,
    /// By how much x and y change along a column's step (x first), and along a row's.
    pub steps: [[f64; 2]; 2],
}

impl AngleBound {
    /// Degrees that are rounding.
    const ROUNDING: f64 = 1e-7;

    /// True when a triangle has a smaller one.
    pub fn is_broken_by(&self, triangle: &Triangle) -> bool {
        triangle.smallest_angle_in(self.steps) < self.degrees - Self::ROUNDING
    }
}

/// Bytes [`check`] needs for a domain of `samples` samples touched by `triangles` triangles, with
/// `vertices` stored vertices; heights, triangles and positions included.
pub fn bytes_needed(samples: u64, triangles: u64, vertices: u64) -> u64 {
    let per_triangle = size_of::<Triangle>() + edges::BYTES_PER_TRIANGLE;
    samples * worst::BYTES_PER_SAMPLE
        + triangles * per_triangle as u64
        + vertices * size_of::<Position>() as u64
}

/// Checks one part and adds what it owns to `tally`. Returns the open edges that are on the
/// outline of the surface as far as this part can see; the caller follows the rest of them with
/// [`Surface::follow`] and counts those that leave the outline with [`Tally::crack`].
///
/// O(samples + triangles log triangles + samples covered by each triangle).
pub fn check(part: &Part<'_>, tally: &mut Tally) -> Vec<Open> {
    let apron = part.domain.apron();
    let surface = Surface::new(part.domain.grid, apron, part.heights);
    surface.count(&part.domain, tally);
    let mut worst = worst::Worst::new(part, &surface);
    for triangle in part.triangles {
        tally.triangle(triangle, part);
        worst.add(triangle);
    }
    worst.finish(tally);
    edges::check(part, &surface, tally)
}
