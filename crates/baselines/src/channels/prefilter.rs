//! Prefilter for the exact measure: a floating-point scan of a row of a triangle, in one channel, that detects rows
//! whose samples are all within the bound.

use crate::grid::{HeightGrid, PackedSample};

/// Relative rounding of a sum of a few products, with a safety margin.
const DOUBT: f64 = 1e-14;

/// One channel over one triangle, as its slopes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChannelSlopeFilter<'a> {
    grid: &'a HeightGrid<'a>,
    first: [f64; 2],
    height: f64,
    slopes: [f64; 2],
    /// Bound of the rounding error of a difference between the plane and a sample at 0, here and where it is measured.
    doubt: f64,
}

impl<'a> ChannelSlopeFilter<'a> {
    pub(super) fn new(grid: &'a HeightGrid<'a>, corners: [PackedSample; 3]) -> Self {
        let [a, b, c] = corners.map(|at| [at.col(), at.row()].map(f64::from));
        let heights = corners.map(|at| grid.vertex(at));
        let (p, q) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let [y, z] = [heights[1] - heights[0], heights[2] - heights[0]];
        let area = p[0] * q[1] - p[1] * q[0];
        // In a needle triangle the products cancel: the error bound needs both.
        let (x_terms, y_terms) = ([y * q[1], z * p[1]], [z * p[0], y * q[0]]);
        let extent = [0, 1].map(|i| p[i].abs().max(q[i].abs()).max((p[i] - q[i]).abs()));
        let sizes = [x_terms, y_terms].map(|[u, v]| (u.abs() + v.abs()) / area.abs());
        let slopes = [x_terms, y_terms].map(|[u, v]| (u - v) / area);
        let size = 2.0 * heights.iter().map(|height| height.abs()).sum::<f64>()
            + sizes[0] * extent[0]
            + sizes[1] * extent[1];
        Self { grid, first: a, height: heights[0], slopes, doubt: DOUBT * size }
    }

    /// True if a sample in these columns of a row may be at `limit` or more from the plane.
    /// Time linear in the columns.
    pub(super) fn may_reach(&self, limit: f64, row: i32, low: i64, high: i64) -> bool {
        let values = self.grid.row(row as u32, low as u32, high as u32);
        let [dx, dy] = [low as f64 - self.first[0], f64::from(row) - self.first[1]];
        let start = self.height + self.slopes[1] * dy + self.slopes[0] * dx;
        let limit = limit - self.doubt;
        // No branch in the loop, and NaN counts as far.
        !(0_i32..).zip(values).fold(true, |all, (column, value)| {
            let plane = start + self.slopes[0] * f64::from(column);
            all & ((plane - value).abs() + 2.0 * DOUBT * value.abs() < limit)
        })
    }
}
