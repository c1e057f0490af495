//! How to untangle: when segments are tested, and what becomes of rings that collapse.

use terrane_base::Cancel;
use terrane_options::Choice;

/// Handling of rings that collapse to fewer than three vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum RingCollapse {
    /// Keep the smallest ring within the tolerance
    ///
    /// It has three vertices, or more if the rules require it.
    #[default]
    Minimal,
    /// Remove them
    ///
    /// A closed ring is removed as a whole.
    Drop,
    /// Keep all their vertices
    Keep,
}

/// Time of the test of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum Strategy {
    /// Simplify, then restore vertices where lines cross
    ///
    /// All chains are simplified, then refined where they violate the rules, until none does.
    #[default]
    Retroactive,
    /// Test each segment before accepting it
    ///
    /// A segment is accepted only if all present vertices are on its correct side: accepted vertices, and all vertices
    /// of chains not yet simplified. Slower, and keeps more vertices where chains are close, because a chain avoids
    /// details that the next chain loses.
    Proactive,
}

/// How to untangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct UntangleOptions<'a> {
    /// When segments are tested.
    pub strategy: Strategy,
    /// Handling of rings that collapse.
    pub collapse: RingCollapse,
    /// Which chains are but loops of something longer, and are never dropped; none where it is shorter.
    pub loops: &'a [bool],
    /// Cancellation.
    pub cancel: Option<&'a Cancel>,
}
