//! From points to the cells whose centres are near them.
//!
//! Distances from the centres of cells are counted in halves of the last decimal of all inputs, as `u128`, so
//! that ties are exact.

use super::block::CellBlock;
use super::grid_frame::{CellLattice, DistanceUnit};
use super::plane::CellHits;
use terrane_base::error::Result;
use terrane_base::geom::{Point, Rect};

/// Adds points to all cells whose centres are within a radius.
#[derive(Debug)]
pub struct DiscScatter {
    unit: DistanceUnit,
    /// Least squared distance that is not within the radius.
    limit: u128,
    /// Largest distance in columns and rows from the cell of a point to a cell within the radius.
    across: i64,
    down: i64,
    cells: Vec<u32>,
    points: Vec<Point>,
    squares: Vec<u128>,
    filled: usize,
    /// Squared distances of a point from the columns and rows around it.
    columns: Vec<u128>,
    rows: Vec<u128>,
}

/// The target of points.
#[derive(Debug)]
pub struct BlockTarget<'a> {
    /// The block.
    pub block: &'a mut CellBlock,
    /// The region of the recipe.
    pub region: usize,
    /// Real values, as in [`CellHits`].
    pub reals: &'a [f64],
}

/// Hits added at once.
const MAX_HITS: usize = 4096;

impl DiscScatter {
    /// For cells of `lattice`.
    pub fn new(lattice: &CellLattice, radius: f64) -> Self {
        let [across, down] = [lattice.x.world_cell(), lattice.y.world_cell()]
            .map(|cell| (radius / cell + 0.5).min(f64::from(i32::MAX)) as i64);
        let unit = lattice.unit(radius);
        Self {
            unit,
            limit: unit.square(radius),
            across,
            down,
            cells: vec![0; MAX_HITS],
            points: vec![Point::default(); MAX_HITS],
            squares: vec![0; MAX_HITS],
            filled: 0,
            columns: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Columns and rows around a point's own that it may reach.
    pub fn reach(&self) -> (i64, i64) {
        (self.across, self.down)
    }

    /// Adds `points`, in the cells (column, row) `places`, to the cells of a block: those of `window`, with
    /// rows `stride` apart.
    ///
    /// # Errors
    /// As for [`CellBlock::add`].
    pub fn add(
        &mut self,
        lattice: &CellLattice,
        window: Rect,
        stride: u32,
        points: &[Point],
        places: &[(i32, i32)],
        mut to: BlockTarget<'_>,
    ) -> Result<()> {
        for (point, (col, row)) in points.iter().zip(places) {
            let cols = clip(i64::from(*col), self.across, window.col, window.width);
            let rows = clip(i64::from(*row), self.down, window.row, window.height);
            let first = (cols.start - i64::from(window.col)) as u32;
            let down = (rows.start - i64::from(window.row)) as u32;
            lattice.x.squares(point.x, cols, self.unit, &mut self.columns);
            lattice.y.squares(point.y, rows, self.unit, &mut self.rows);
            for i in 0..self.rows.len() {
                let first = (down + i as u32) * stride + first;
                self.row(*point, first, self.rows[i], &mut to)?;
            }
        }
        self.flush(&mut to)
    }

    /// The cells of one row, from place `first` on.
    fn row(
        &mut self,
        point: Point,
        first: u32,
        down: u128,
        to: &mut BlockTarget<'_>,
    ) -> Result<()> {
        // Blocks are narrower: a row always fits into an empty buffer.
        if self.filled + self.columns.len() > MAX_HITS {
            self.flush(to)?;
        }
        let mut at = self.filled;
        for (cell, across) in (first..).zip(&self.columns) {
            let square = across + down;
            self.cells[at] = cell;
            self.points[at] = point;
            self.squares[at] = square;
            at += usize::from(square < self.limit);
        }
        self.filled = at;
        Ok(())
    }

    fn flush(&mut self, to: &mut BlockTarget<'_>) -> Result<()> {
        let filled = std::mem::take(&mut self.filled);
        let (cells, points) = (&self.cells[..filled], &self.points[..filled]);
        let (squares, unit) = (&self.squares[..filled], self.unit.size);
        to.block.add(to.region, CellHits { cells, points, squares, unit, reals: to.reals })
    }
}

/// The numbers within `reach` of `at` that lie in `count` from `first`.
fn clip(at: i64, reach: i64, first: u32, count: u32) -> std::ops::Range<i64> {
    let (first, end) = (i64::from(first), i64::from(first) + i64::from(count));
    let start = (at - reach).clamp(first, end);
    start..(at + reach + 1).clamp(start, end)
}
