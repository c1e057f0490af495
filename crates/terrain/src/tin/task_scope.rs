//! The part of the work of one run: all of it, or a unit that other runs continue from.
//!
//! A single run and a plan share the code: the graph of steps is computed, a part is a filter on tasks, and
//! each step has the same input as in a single run.

use super::layout::{TileId, TileLayout};
use super::task::{TileStep, TileTask};

/// The part of the work one run does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RunScope {
    /// From heights to the written mesh.
    Whole,
    /// Tiles of the rows `first .. end`, and the seams between them, to saved containers.
    Strip { first: u32, end: u32 },
    /// The seams below the row of tiles `above`, from saved containers of it and the next to saved
    /// ones.
    Seam { above: u32 },
    /// From saved containers, all seams mended, to the written mesh.
    Write,
}

/// A part of the work on a layout.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayoutWork {
    pub(super) layout: TileLayout,
    pub(super) scope: RunScope,
}

impl LayoutWork {
    /// True when `task` is one of this part: of its rows, of its steps, and with a seam the layout
    /// has (the last column has none on its right, and so on).
    pub(super) fn has(&self, TileTask { tile, step }: TileTask) -> bool {
        let right = tile.col + 1 < self.layout.cols;
        let below = self.has_row(tile.row + 1);
        self.has_row(tile.row)
            && self.has_step(step)
            && match step {
                TileStep::Vertical => right,
                TileStep::Horizontal => below,
                TileStep::Corner => right && below,
                _ => true,
            }
    }

    fn has_row(&self, row: u32) -> bool {
        let [first, end] = self.rows();
        (first..end).contains(&row)
    }

    fn has_step(&self, step: TileStep) -> bool {
        use RunScope::{Seam, Strip, Whole, Write};
        match step {
            TileStep::Tile => true,
            TileStep::Vertical => matches!(self.scope, Whole | Strip { .. }),
            TileStep::Horizontal | TileStep::Corner => self.scope != Write,
            TileStep::Gather | TileStep::Number | TileStep::Emit => {
                matches!(self.scope, Whole | Write)
            }
            TileStep::Save => matches!(self.scope, Strip { .. } | Seam { .. }),
        }
    }

    /// The first step that needs a tile to be final.
    pub(super) fn last_touch(&self) -> TileStep {
        if self.has_step(TileStep::Save) { TileStep::Save } else { TileStep::Gather }
    }

    /// True when tiles come from saved containers, not from heights.
    pub(super) fn loads(&self) -> bool {
        matches!(self.scope, RunScope::Seam { .. } | RunScope::Write)
    }

    /// The first row of tiles, and the one after the last.
    fn rows(&self) -> [u32; 2] {
        match self.scope {
            RunScope::Whole | RunScope::Write => [0, self.layout.rows],
            RunScope::Strip { first, end } => [first, end],
            RunScope::Seam { above } => [above, above + 2],
        }
    }

    /// Number of tiles.
    pub(super) fn tiles(&self) -> u64 {
        let [first, end] = self.rows();
        u64::from(self.layout.cols) * u64::from(end - first)
    }

    /// Number of samples its tiles own.
    pub(super) fn samples(&self) -> u64 {
        let [first, end] = self.rows();
        let [top, bottom] =
            [first, end - 1].map(|row| self.layout.owned(TileId::new(row, self.layout.cols - 1)));
        u64::from(bottom.end_col()) * u64::from(bottom.end_row() - top.row)
    }

    /// Position of `tile` among those of this part, row by row.
    pub(super) fn position(&self, tile: TileId) -> u64 {
        self.layout.index(tile) - self.layout.index(TileId::new(self.rows()[0], 0))
    }

    /// The tile at a position.
    pub(super) fn tile_at(&self, position: u64) -> TileId {
        let tile = self.layout.tile_at(position);
        TileId::new(tile.row + self.rows()[0], tile.col)
    }
}
