//! One unit of work: a step for a tile.

use super::layout::{SeamKind, TileId};

/// Most rows or columns that a step lags.
pub(super) const MAX_LAG: u32 = 3;

/// What is done for a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum TileStep {
    /// Triangulate the tile.
    Tile,
    /// Mend the seam to the tile on the right.
    Vertical,
    /// Mend the seam to the tile below.
    Horizontal,
    /// Mend around the tile's last corner.
    Corner,
    /// Find the vertices in use that the tile owns, and write them.
    Gather,
    /// Fix the id of the tile's first vertex: one tile after the other.
    Number,
    /// Write the triangles kept with the tile.
    Emit,
    /// Save the container of the tile, for another run to continue from.
    Save,
}

impl TileStep {
    /// The seam a step mends.
    pub(super) fn seam(self) -> Option<SeamKind> {
        match self {
            Self::Vertical => Some(SeamKind::Vertical),
            Self::Horizontal => Some(SeamKind::Horizontal),
            Self::Corner => Some(SeamKind::Corner),
            _ => None,
        }
    }

    /// Offset in rows and columns (at most [`MAX_LAG`]) from its own tile to the last tile it waits for.
    pub(super) fn lag(self) -> (u32, u32) {
        match self {
            Self::Tile => (0, 0),
            Self::Vertical => (0, 1),
            Self::Horizontal => (1, 1),
            Self::Corner | Self::Gather | Self::Number | Self::Save => (1, 2),
            Self::Emit => (2, 3),
        }
    }
}

/// One unit of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct TileTask {
    pub(super) tile: TileId,
    pub(super) step: TileStep,
}

impl std::fmt::Display for TileTask {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.step.seam() {
            None => self.tile.fmt(f),
            Some(seam) => write!(f, "{seam:?} seam of {}", self.tile),
        }
    }
}
