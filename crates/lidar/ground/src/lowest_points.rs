//! The lowest point of each cell: the input of ground methods.

use terrane_base::geom::Point;

/// Marks a cell without a height.
pub const EMPTY: i32 = i32::MAX;

/// A cell without points.
pub const NO_POINT: Point = Point::new(EMPTY, EMPTY, EMPTY);

/// The lowest points of a window of square cells, row by row from the south, each row from the west.
#[derive(Clone, Copy, Debug)]
pub struct LowestPoints<'a> {
    /// Of each cell, in steps; [`NO_POINT`] where there is none.
    pub points: &'a [Point],
    /// Cells of a row.
    pub width: usize,
    /// Side of a cell in metres.
    pub cell: f64,
    /// Where the first cell begins, in steps east and north.
    pub corner: [f64; 2],
    /// Metres to a step along each axis.
    pub step: [f64; 3],
}

impl LowestPoints<'_> {
    /// Heights in metres, NaN for no point.
    pub(crate) fn heights(&self) -> Vec<f64> {
        let heights = self.points.iter().map(|p| match p.z {
            EMPTY => f64::NAN,
            z => f64::from(z) * self.step[2],
        });
        heights.collect()
    }

    /// The point of a cell in metres from the corner; `None` where there is none.
    pub(crate) fn metres(&self, at: usize) -> Option<[f64; 3]> {
        let ([x, y, z], [west, south]) = (self.step, self.corner);
        let p = Some(self.points[at]).filter(|p| p.z != EMPTY)?;
        Some([(f64::from(p.x) - west) * x, (f64::from(p.y) - south) * y, f64::from(p.z) * z])
    }
}
