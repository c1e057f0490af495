//! The lowest points of cells in whole millimetres.

use crate::lowest_points::LowestPoints;
use terrane_base::geom::Point;

/// Millimetres to a metre.
pub(crate) const MILLI: f64 = 1000.0;
/// Widest cell in metres: millimetres of a square of the lattice have 32 bits.
pub(crate) const WIDEST: f64 = 1000.0;

/// The lowest point of each cell, in millimetres from the corner; no two at one position.
#[derive(Debug)]
pub(crate) struct LowestCells {
    pub(crate) points: Vec<Option<Point>>,
    /// Cells of a row.
    pub(crate) width: usize,
    /// Side of a cell in metres.
    pub(crate) cell: f64,
}

impl LowestCells {
    pub(crate) fn of(lows: &LowestPoints<'_>) -> Self {
        let points = (0..lows.points.len()).map(|at| {
            let [x, y, z] = lows.metres(at)?.map(|metres| (metres * MILLI).round() as i32);
            Some(Point::new(x, y, z))
        });
        let mut cells = Self { points: points.collect(), width: lows.width, cell: lows.cell };
        cells.separate();
        cells
    }

    /// Keeps only the lowest of points that rounding has moved to the same position on the line between cells.
    fn separate(&mut self) {
        let count = self.points.len();
        for at in 0..count {
            let east = at % self.width + 1 < self.width;
            let after = [(east, 1), (true, self.width), (east, self.width + 1)];
            let after = after.into_iter().filter(|(exists, _)| *exists).map(|(_, on)| at + on);
            let west = (at % self.width > 0).then_some(at + self.width - 1);
            for other in after.chain(west).filter(|other| *other < count) {
                if let (Some(a), Some(b)) = (self.points[at], self.points[other])
                    && [a.x, a.y] == [b.x, b.y]
                {
                    self.points[if a.z <= b.z { other } else { at }] = None;
                }
            }
        }
    }

    pub(crate) fn rows(&self) -> usize {
        self.points.len() / self.width
    }

    /// The cells with the lowest points of squares of `side` cells, sorted. An incomplete square at the end of
    /// a row or column is merged with the one before, so that no square is smaller than the objects to remove.
    pub(crate) fn lowest(&self, side: usize) -> Vec<usize> {
        let [across, up] = [self.width, self.rows()].map(|count| (count / side).max(1));
        let mut lowest: Vec<Option<(Point, usize)>> = vec![None; across * up];
        for (at, point) in self.points.iter().enumerate() {
            let Some(point) = point else { continue };
            let (col, row) = (at % self.width / side, at / self.width / side);
            let square = row.min(up - 1) * across + col.min(across - 1);
            let known = lowest[square].map(|(low, _)| [low.z, low.x, low.y]);
            if known.is_none_or(|known| [point.z, point.x, point.y] < known) {
                lowest[square] = Some((*point, at));
            }
        }
        let mut seeds: Vec<usize> = lowest.into_iter().flatten().map(|(_, at)| at).collect();
        seeds.sort_unstable();
        seeds
    }

    /// Keeps only the lowest points of squares of `side` cells.
    pub(crate) fn thinned(&self, side: usize) -> Self {
        let mut points = vec![None; self.points.len()];
        self.lowest(side).into_iter().for_each(|at| points[at] = self.points[at]);
        Self { points, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_points_that_rounding_puts_together_the_lowest_is_left() {
        let at = |x, y, z| Some(Point::new(x, y, z));
        let cells = |points: Vec<Option<Point>>| {
            let mut cells = LowestCells { points, width: 2, cell: 1.0 };
            cells.separate();
            cells.points.iter().map(|p| p.map(|p| p.z)).collect::<Vec<_>>()
        };
        assert_eq!(
            cells(vec![at(1000, 5, 7), at(1000, 5, 6), None, at(1000, 6, 1)]),
            [None, Some(6), None, Some(1)]
        );
        let corner = |z: [i32; 4]| cells(z.map(|z| at(1000, 1000, z)).to_vec());
        assert_eq!(corner([4, 3, 2, 1]), [None, None, None, Some(1)]);
        assert_eq!(corner([4, 3, 1, 2]), [None, None, Some(1), None]);
        assert_eq!(corner([1, 1, 1, 1]), [Some(1), None, None, None]);
        let mut none = LowestCells { points: vec![], width: 3, cell: 1.0 };
        none.separate();
    }
}
