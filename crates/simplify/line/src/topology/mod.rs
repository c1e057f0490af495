//! Removes crossings introduced by simplification.
//!
//! A simplification method considers one chain at a time. [`untangle`] takes chains and their kept vertices,
//! and keeps more vertices until
//!
//! 1. no two segments cross, touch or overlap, but for common end vertices;
//! 2. no ring has collapsed or turned over;
//! 3. every kept vertex, and every given point, is on the side of every chain that it was on.
//!
//! A *piece* is a chain's part C from one kept vertex a to the next, b. The closed curve of C and the segment
//! ba must not wind around a kept vertex of any chain or a given point, and none of them may lie on the
//! segment. This is the consistency of M. de Berg, M. van Kreveld and S. Schirra, "Topologically correct
//! subdivision simplification using the bandwidth criterion" (1998). A piece that violates a rule is split at
//! its vertex farthest from the segment, and the caller's method simplifies both halves again, so its tolerance
//! holds for the result. Vertices are never removed, and a chain with all its vertices violates no rule that
//! the input satisfied: the process always ends.
//!
//! **Why this is sufficient.** The winding number of a ring around a point is that of the simplified ring plus
//! those of its pieces' curves; the latter are 0, so points stay inside or outside each ring. For a connected
//! part K of the input without crossings it is sufficient that one of its points keeps its side: K crosses the
//! ring neither before nor after. Testing each kept vertex, and not one for each K, also preserves the order of
//! arcs around a common vertex: if arc D moved to the other side of arc C between common ends without a
//! crossing, a kept vertex of one would lie in a region of the other; without kept vertices their segments
//! would overlap. Omitted vertices need no test: the rest of their chain is tested.
//!
//! **Violations of the input.** Where original segments cross, touch or overlap, pieces are refined down to
//! them; then the pair is counted and left. Vertices at one position are identical: chains that touch at common
//! vertices should be cut there first ([`super::arcs`]), so that these are kept.

mod chains;
mod cross;
mod options;
mod proactive;
mod region;
mod rings;
mod round;
mod scan;
mod settle;
#[cfg(test)]
mod tests;
mod tree;

pub use chains::{Chains, Refine, RetainedChainVertices, open_at, refining};
pub use cross::conflict;
pub use options::{RingCollapse, Strategy, UntangleOptions};
pub use round::{RoundedPositions, round};

use scan::SidePoints;
use terrane_base::error::Result;
use terrane_base::geom::plane::Xy;

/// Simplified chains without new crossings, and statistics.
#[derive(Clone, Debug, Default)]
pub struct UntangledChains {
    /// Kept vertices.
    pub kept: RetainedChainVertices,
    /// Pairs of original segments in the result that cross, touch or overlap off a common vertex, each
    /// identified by its first vertex.
    pub crossings: Vec<[u32; 2]>,
    /// Number of split pieces.
    pub refined: u64,
    /// Collapsed rings, treated as the option says.
    pub collapsed: u64,
    /// Rings without area in the input.
    pub flat: u64,
    /// Number of rounds.
    pub rounds: u64,
}

/// Keeps more vertices of `chains` than `kept`, until the rules of this module hold; `points` keep their sides.
/// `refine` is the method and tolerance of `kept`.
///
/// O(n log n) for n vertices, plus the pairs of pieces with intersecting boxes, plus the time of `refine`.
/// Memory is linear: about 60 bytes per kept vertex and a quarter of a byte per vertex, besides the arguments.
/// The result depends on the arguments only.
///
/// # Errors
/// Errors of [`Chains::check`]; `Usage` if `kept` is not a subset of `chains`; `BadInput` for a non-finite
/// point; `Interrupted` on cancellation.
pub fn untangle(
    chains: &Chains<'_>,
    kept: &RetainedChainVertices,
    points: &[Xy],
    options: &UntangleOptions<'_>,
    refine: &mut Refine<'_>,
) -> Result<UntangledChains> {
    untangle_within(chains, kept, points, options, usize::MAX, refine)
}

/// Largest memory in bytes of [`untangle`] per piece, and largest number of pieces per vertex.
pub const PIECE_BYTES: u64 = 170;
/// As each is made of one that goes.
pub const PIECES: u64 = 2;

/// As [`untangle`], with a limited number of pieces.
///
/// # Errors
/// `Resource` for more pieces; otherwise errors of [`untangle`].
pub fn untangle_within(
    chains: &Chains<'_>,
    kept: &RetainedChainVertices,
    points: &[Xy],
    options: &UntangleOptions,
    most: usize,
    refine: &mut Refine<'_>,
) -> Result<UntangledChains> {
    chains.check()?;
    kept.check(chains)?;
    let points = SidePoints::new(points)?;
    let (mut kept, mended) = rings::mend(chains, kept, options, refine);
    let mut refined = 0;
    if options.strategy == Strategy::Proactive {
        (kept, refined) = proactive::accept(chains, &kept, &points, options.cancel, refine)?;
    }
    let mut settling = settle::UntangleState::new(chains, &kept);
    if refined > 0 {
        settling.unturned = 0;
    }
    settling.run(&points, most, options.cancel, refine)?;
    Ok(UntangledChains {
        crossings: std::mem::take(&mut settling.crossings),
        refined: refined + settling.refined,
        collapsed: mended.collapsed,
        flat: mended.flat,
        rounds: settling.rounds,
        kept: settling.into_retained(&kept),
    })
}
