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
        let difference = |a: u32, b: u32| (i64::from(a) - i64::from(b)) as i32;
        Self { cols: difference(from.0, to.0), rows: difference(from.1, to.1) }
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
        let span = |i: usize| [a[i].min(b[i]).min(c[i]), a[i].max(b[i]).max(c[i])];
        Self { cols: span(0), rows: span(1) }
    }

    #[inline]
    pub(super) fn touches(&self, other: &Self) -> bool {
        let overlap = |a: [i32; 2], b: [i32; 2]| (a[0] <= b[1]) & (b[0] <= a[1]);
        overlap(self.cols, other.cols) & overlap(self.rows, other.rows)
    }

    /// True when `other` is wholly inside.
    #[inline]
    pub(super) fn holds(&self, other: &Self) -> bool {
        let covers = |a: [i32; 2], b: [i32; 2]| (a[0] <= b[0]) & (b[1] <= a[1]);
        covers(self.cols, other.cols) & covers(self.rows, other.rows)
    }

    /// The box around an edge.
    pub(super) fn along([a, b]: [Lattice; 2]) -> Self {
        let span = |i: usize| [a[i].min(b[i]), a[i].max(b[i])];
        Self { cols: span(0), rows: span(1) }
    }

    /// The box around two.
    pub(super) fn join(self, other: Self) -> Self {
        let join = |a: [i32; 2], b: [i32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self { cols: join(self.cols, other.cols), rows: join(self.rows, other.rows) }
    }

    /// The same in positions moved by `cols` and `rows`.
    pub(super) fn moved(&self, cols: i32, rows: i32) -> Self {
        Self { cols: self.cols.map(|col| col + cols), rows: self.rows.map(|row| row + rows) }
    }
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
    let span = |count: u32| [margin, count as i32 - 1 - margin];
    SampleBounds { cols: span(rect.width), rows: span(rect.height) }
}
