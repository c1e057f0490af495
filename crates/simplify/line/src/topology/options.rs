//! How to untangle: when segments are tested, and what becomes of rings that collapse.

use terrane_base::Cancel;
use terrane_options::Choice;

/// What to do with rings that collapse: of which fewer than three vertices would be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum RingCollapse {
    /// Keep the smallest ring within the tolerance
    ///
    /// It has three vertices, or as many more as the rules ask for.
    #[default]
    Minimal,
    /// Remove them
    ///
    /// Nothing of a ring is kept, if it is one as a whole.
    Drop,
    /// Keep all their vertices
    Keep,
}

/// When a segment is tested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum Strategy {
    /// Simplify, then restore vertices where lines cross
    ///
    /// All chains are simplified, then what is wrong is refined, until nothing is.
    #[default]
    Retroactive,
    /// Test each segment before accepting it
    ///
    /// A segment is accepted only when all vertices that are there at the time are on the right side
    /// of it: those accepted so far, and all vertices of chains to come. Slower, and keeps more where
    /// chains are close, as a chain has to leave room for details that the next one loses.
    Proactive,
}

/// How to untangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct UntangleOptions<'a> {
    /// When segments are tested.
    pub strategy: Strategy,
    /// What becomes of rings that collapse.
    pub collapse: RingCollapse,
    /// Which chains are but loops of something longer, and are never dropped; none where it is shorter.
    pub loops: &'a [bool],
    /// What may stop the work.
    pub cancel: Option<&'a Cancel>,
}
