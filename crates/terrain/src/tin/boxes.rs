//! Boxes of positions, and positions seen from other tiles.

use super::layout::{TileId, TileLayout};
use terrane_base::geom::Rect;
use terrane_base::geom::predicates::Lattice;
use terrane_tin::{TilePosition, TileTriangle};

/// Moves positions by a fixed number of columns and rows.
#[derive(Clone, Copy)]
pub(super) struct PositionShift {
    pub(super) cols: i32,
    pub(super) rows: i32,
}

impl PositionShift {
    /// From positions relative to grid position `from` to positions relative to `to`
    /// (column, row).
    pub(super) fn new(from: (u32, u32), to: (u32, u32)) -> Self {
        let [cols, rows] = [(from.0, to.0), (from.1, to.1)]
            .map(|(from, to)| (i64::from(from) - i64::from(to)) as i32);
        Self { cols, rows }
    }

    /// The moved position; it must be one (no coordinate below zero).
    #[inline]
    pub(super) fn apply(self, at: TilePosition) -> TilePosition {
        TilePosition::new(
            at.col().wrapping_add_signed(self.cols),
            at.row().wrapping_add_signed(self.rows),
        )
    }

    /// The moved triangle.
    pub(super) fn triangle(self, triangle: &TileTriangle) -> TileTriangle {
        TileTriangle { corners: triangle.corners.map(|at| self.apply(at)), ..*triangle }
    }
}

/// A box of positions in some frame that may begin before its zero.
#[derive(Clone, Copy)]
pub(super) struct OffsetFrame {
    first: [i32; 2],
    size: [u32; 2],
}

impl OffsetFrame {
    /// The samples of `rect` as positions relative to grid position `origin` (column, row).
    pub(super) fn new(rect: Rect, origin: (u32, u32)) -> Self {
        let PositionShift { cols, rows } = PositionShift::new((rect.col, rect.row), origin);
        Self { first: [cols, rows], size: [rect.width, rect.height] }
    }

    /// True when `at` is one of the samples.
    #[inline]
    pub(super) fn contains(&self, at: TilePosition) -> bool {
        let col = at.col().wrapping_add_signed(self.first[0].wrapping_neg());
        let row = at.row().wrapping_add_signed(self.first[1].wrapping_neg());
        (col < self.size[0]) & (row < self.size[1])
    }
}

/// First and last column, first and last row.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleBounds {
    pub(super) cols: [i32; 2],
    pub(super) rows: [i32; 2],
}

impl SampleBounds {
    /// The box around a triangle.
    #[inline]
    pub(super) fn of(corners: [TilePosition; 3]) -> Self {
        let [a, b, c] = corners.map(|at| [at.col() as i32, at.row() as i32]);
        let [cols, rows] = [0, 1]
            .map(|axis| [a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis])]);
        Self { cols, rows }
    }

    #[inline]
    pub(super) fn touches(&self, other: &Self) -> bool {
        overlaps(self.cols, other.cols) & overlaps(self.rows, other.rows)
    }

    /// True when `other` is wholly inside.
    #[inline]
    pub(super) fn holds(&self, other: &Self) -> bool {
        covers(self.cols, other.cols) & covers(self.rows, other.rows)
    }

    /// The box around an edge.
    pub(super) fn along([a, b]: [Lattice; 2]) -> Self {
        let [cols, rows] = [0, 1].map(|axis| [a[axis].min(b[axis]), a[axis].max(b[axis])]);
        Self { cols, rows }
    }

    /// The box around two.
    pub(super) fn join(self, other: Self) -> Self {
        let [cols, rows] = [(self.cols, other.cols), (self.rows, other.rows)]
            .map(|(a, b)| [a[0].min(b[0]), a[1].max(b[1])]);
        Self { cols, rows }
    }

    /// The same in positions moved by `cols` and `rows`.
    pub(super) fn moved(&self, cols: i32, rows: i32) -> Self {
        Self { cols: self.cols.map(|col| col + cols), rows: self.rows.map(|row| row + rows) }
    }
}

/// True when two closed intervals share a number.
#[inline]
fn overlaps(a: [i32; 2], b: [i32; 2]) -> bool {
    // Without a branch: patches test all triangles of a tile.
    (a[0] <= b[1]) & (b[0] <= a[1])
}

/// True when a closed interval contains another.
#[inline]
fn covers(outer: [i32; 2], inner: [i32; 2]) -> bool {
    (outer[0] <= inner[0]) & (inner[1] <= outer[1])
}

/// Triangles at least this many cells away from the sides of their tile are its inner ones.
const MARGIN: u32 = 40;

/// The samples of a tile that are [`MARGIN`] cells away from its sides.
pub(super) fn inner_bounds(layout: &TileLayout, tile: TileId) -> SampleBounds {
    bounds_within(layout.rect(tile), MARGIN as i32)
}

/// The samples of a tile.
pub(super) fn all_bounds(layout: &TileLayout, tile: TileId) -> SampleBounds {
    bounds_within(layout.rect(tile), 0)
}

fn bounds_within(rect: Rect, margin: i32) -> SampleBounds {
    let [cols, rows] = [rect.width, rect.height].map(|count| [margin, count as i32 - 1 - margin]);
    SampleBounds { cols, rows }
}
