//! A triangle with heights: its plane, its edges, and the samples in it.

use super::heights::FieldLevel;
use super::lattice_position::TilePosition;
use terrane_base::geom::predicates::{Lattice, orient};

/// Slack of the row ends: more than their rounding error, less than the distance of any lattice
/// point from an edge it is not on (2^-18 for coordinates below 2^13 at stride 32).
pub(super) const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// A triangle with heights: its plane and its box, in lattice units.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneFacet {
    /// Plane: height = `base` + `gx` * column + `gy` * row.
    pub(super) base: f64,
    pub(super) gx: f64,
    pub(super) gy: f64,
    /// Corners as [column, row].
    pub(super) corners: [Lattice; 3],
    /// First and last column.
    pub(super) cols: [i32; 2],
    /// First and last row.
    pub(super) rows: [i32; 2],
}

/// The edges of a triangle as bounds of its rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowBounds {
    /// Edges as columns: `offset` + `slope` * row.
    pub(super) slopes: [f64; 3],
    pub(super) offsets: [f64; 3],
    /// The side of a row that each edge bounds.
    pub(super) sides: [EdgeSide; 3],
}

/// Twice the area of an edge and a sample, by the position of the sample in a decimated lattice: not negative inside,
/// exact as coordinates are below 2^14.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeFunction {
    /// At the first sample.
    pub(super) start: i32,
    pub(super) per_column: i32,
    pub(super) per_row: i32,
}

impl EdgeFunction {
    /// A value that stays negative in all rows, for columns that are not scanned: those of tiles are below 2^29.
    pub(super) const FAR_OUTSIDE: i32 = -(1 << 30);
}

/// Position of an edge relative to the interior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EdgeSide {
    Left,
    Right,
    Level,
}

impl PlaneFacet {
    /// The facet with corners `p` (counter-clockwise in (column, row) axes) at heights `z`.
    #[inline(always)]
    pub(super) fn new(p: [TilePosition; 3], z: [f64; 3]) -> Self {
        let q = p.map(TilePosition::lattice);
        let [ax, ay] = q[0].map(f64::from);
        let [bx, by] = [q[1][0] - q[0][0], q[1][1] - q[0][1]].map(f64::from);
        let [cx, cy] = [q[2][0] - q[0][0], q[2][1] - q[0][1]].map(f64::from);
        let (zb, zc) = (z[1] - z[0], z[2] - z[0]);
        let scale = 1.0 / (bx * cy - by * cx);
        let gx = (zb * cy - zc * by) * scale;
        let gy = (bx * zc - cx * zb) * scale;
        let [cols, rows] = [0, 1].map(|axis| {
            let [a, b, c] = [q[0][axis], q[1][axis], q[2][axis]];
            [a.min(b).min(c), a.max(b).max(c)]
        });
        let base = z[0] - gx * ax - gy * ay;
        Self { base, gx, gy, corners: q, cols, rows }
    }

    /// First and last decimated row to scan.
    #[inline(always)]
    pub(super) fn row_range(&self, level: &FieldLevel<'_>) -> [i32; 2] {
        decimated(self.rows, level.shift, [level.bounds[2], level.bounds[3]])
    }

    /// First and last decimated column to scan in any row. Runs of lanes begin at the first.
    #[inline(always)]
    pub(super) fn column_range(&self, level: &FieldLevel<'_>) -> [i32; 2] {
        decimated(self.cols, level.shift, [level.bounds[0], level.bounds[1]])
    }

    /// Functions of the edges opposite each corner. The first sample is given in decimated units.
    #[inline(always)]
    pub(super) fn edge_functions(&self, stride: i32, [col, row]: [i32; 2]) -> [EdgeFunction; 3] {
        let [a, b, c] = self.corners;
        [[b, c], [c, a], [a, b]].map(|[from, to]| {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let start = dx * (row * stride - from[1]) - dy * (col * stride - from[0]);
            EdgeFunction { start, per_column: -dy * stride, per_row: dx * stride }
        })
    }

    #[inline(always)]
    pub(super) fn edges(&self) -> RowBounds {
        let (mut slopes, mut offsets, mut sides) = ([0.0; 3], [0.0; 3], [EdgeSide::Level; 3]);
        for i in 0..3 {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % 3]);
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]].map(f64::from);
            let slope = if dy == 0.0 { 0.0 } else { dx / dy };
            slopes[i] = slope;
            offsets[i] = f64::from(from[0]) - f64::from(from[1]) * slope;
            sides[i] = match dy {
                _ if dy > 0.0 => EdgeSide::Right,
                _ if dy < 0.0 => EdgeSide::Left,
                _ => EdgeSide::Level,
            };
        }
        RowBounds { slopes, offsets, sides }
    }
}

/// The decimated positions in a range of lattice positions and inside the bounds.
#[inline(always)]
fn decimated([first, last]: [i32; 2], shift: u32, bounds: [i32; 2]) -> [i32; 2] {
    let stride_less_one = (1 << shift) - 1;
    [((first + stride_less_one) >> shift).max(bounds[0]), (last >> shift).min(bounds[1])]
}

impl RowBounds {
    /// True if one of the tested edges, other than edges along a row, passes through a sample.
    #[inline(always)]
    pub(super) fn any_through(&self, tested: &[bool; 3], col: i32, row: i32) -> bool {
        let through = |i: usize| {
            let off = self.offsets[i] + self.slopes[i] * f64::from(row) - f64::from(col);
            tested[i] & (self.sides[i] != EdgeSide::Level) & (off.abs() <= SLACK)
        };
        through(0) | through(1) | through(2)
    }

    /// First and last decimated column of a decimated row; first > last if empty.
    #[inline(always)]
    pub(super) fn columns(&self, level: &FieldLevel<'_>, row: i32) -> [i32; 2] {
        let shrink = 1.0 / f64::from(1_u32 << level.shift);
        let mut low = f64::from(level.bounds[0]);
        let mut high = f64::from(level.bounds[1]);
        for edge in 0..3 {
            let at = self.offsets[edge] * shrink + self.slopes[edge] * f64::from(row);
            match self.sides[edge] {
                EdgeSide::Left => low = low.max(at - SLACK),
                EdgeSide::Right => high = high.min(at + SLACK),
                EdgeSide::Level => {}
            }
        }
        [low.ceil() as i32, high.floor() as i32]
    }
}

/// Twice the area of a triangle in cells.
#[inline(always)]
pub(super) fn double_area(corners: [TilePosition; 3]) -> i64 {
    let [a, b, c] = corners.map(TilePosition::lattice);
    orient(a, b, c)
}

/// The level at which a triangle of this area holds about `samples` samples.
#[inline(always)]
pub(super) fn level_for(corners: [TilePosition; 3], samples: i64, levels: usize) -> u8 {
    let ratio = (double_area(corners) / (2 * samples)).max(1) as u64;
    let level = (u64::BITS - 1 - ratio.leading_zeros()).div_ceil(2);
    level.min(levels as u32 - 1) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::LEVELS;

    #[test]
    fn levels_grow_with_the_area() {
        let triangle = |side| [(0, 0), (side, 0), (0, side)].map(|(c, r)| TilePosition::new(c, r));
        let levels = [2, 8, 9, 16, 40, 512].map(|side| level_for(triangle(side), 32, LEVELS));
        assert_eq!(levels, [0, 0, 0, 1, 2, 5]);
    }
}
