//! Independent proof of a mesh's promises: error bound, coverage, topology; and its [`quality`], which is
//! measured and not judged. Pure; shares no code with `tin`.
//!
//! Everything is decided one [`GridDomain`] (a rectangle of samples) at a time, from the triangles
//! that touch it and the heights of it and of one sample around it. Each sample, cell, vertex,
//! edge and triangle is owned by exactly one domain, and every figure of a [`ProofTally`] is a count, a
//! maximum or an exact sum, so the outcome does not depend on how the grid was divided, nor on the
//! order in which domains were done.

mod bits;
mod breaklines;
pub mod cloud;
mod domain;
mod edges;
mod exact;
mod expansion;
mod lattice_position;
pub mod lines;
mod part;
pub mod quality;
mod required_vertices;
mod sample_error;
mod sections;
pub mod slope;
mod sum;
mod surface;
mod surface_error;
pub mod tiles;
mod totals;
mod triangle;
mod unit;

pub use breaklines::ProofBreakline;
pub use domain::{DomainLayout, GridDomain};
pub use edges::UnpairedEdge;
pub use lattice_position::{HeightPrecision, Snap, SnapOutcome, Snapper};
pub use part::{GridProofPart, ProofAngleBound};
pub use sum::ExactSum;
pub use surface::{OutlineFollowing, OutlineRun, ProofSurface};
pub use totals::{ErrorSpot, FaultCount, ProofTally};
pub use triangle::{ProofPosition, ProofTriangle, ProofVertex};

use std::mem::size_of;

/// Bytes [`check`] needs for a domain of `samples` samples touched by `triangles` triangles, with
/// `vertices` stored vertices; heights, triangles and positions included.
pub fn bytes_needed(samples: u64, triangles: u64, vertices: u64) -> u64 {
    let per_triangle = size_of::<ProofTriangle>() + edges::BYTES_PER_TRIANGLE;
    samples * sample_error::BYTES_PER_SAMPLE
        + triangles * per_triangle as u64
        + vertices * size_of::<ProofPosition>() as u64
}

/// Checks one part and adds what it owns to `tally`. Returns the open edges that are on the
/// outline of the surface as far as this part can see; the caller follows the rest of them with
/// [`ProofSurface::follow`] and counts those that leave the outline with [`ProofTally::crack`].
///
/// O(samples + triangles log triangles + samples covered by each triangle).
pub fn check(part: &GridProofPart<'_>, tally: &mut ProofTally) -> Vec<UnpairedEdge> {
    let apron = part.domain.apron();
    let surface = ProofSurface::new(part.domain.grid, apron, part.heights);
    surface.count(&part.domain, tally);
    let mut worst = sample_error::WorstErrors::new(part, &surface);
    for triangle in part.triangles {
        part.triangle(triangle, tally);
        worst.add(triangle);
    }
    worst.finish(tally);
    edges::check(part, &surface, tally)
}
