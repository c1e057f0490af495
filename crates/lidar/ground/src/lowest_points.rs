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
        let height = |p: &Point| match p.z {
            EMPTY => f64::NAN,
            z => f64::from(z) * self.step[2],
        };
        self.points.iter().map(height).collect()
    }

    /// The point of a cell in metres from the corner; `None` where there is none.
    pub(crate) fn metres(&self, at: usize) -> Option<[f64; 3]> {
        let p = self.points[at];
        let along = |v: i32, i: usize| (f64::from(v) - self.corner[i]) * self.step[i];
        (p.z != EMPTY).then(|| [along(p.x, 0), along(p.y, 1), f64::from(p.z) * self.step[2]])
    }
}
