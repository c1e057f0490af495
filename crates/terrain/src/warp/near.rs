//! Which of many grids may have a sample in a part of the output.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock};

use super::source::WarpedGrid;
use terrane_base::geom::Rect;
use terrane_files::lock;

/// Columns and rows of a cell of the output.
const CELL: u32 = 512;
/// Rows of cells in memory: outputs are written row by row.
const ROWS: usize = 4;

/// Numbers of the grids for each cell, as far as they were needed.
type CellRow = Arc<Vec<OnceLock<Arc<[u32]>>>>;

/// The grids near each cell of the output. What many pieces have in common is found once.
pub(super) struct NearLayers {
    across: u32,
    rows: Mutex<VecDeque<(u32, CellRow)>>,
}

impl NearLayers {
    /// For an output of this width.
    pub(super) fn new(width: u32) -> Self {
        Self { across: width.div_ceil(CELL), rows: Mutex::default() }
    }

    /// Whole cells that cover a rectangle, row by row.
    pub(super) fn cells(rect: Rect) -> impl Iterator<Item = Rect> {
        let columns = rect.col / CELL..rect.end_col().div_ceil(CELL);
        let rows = rect.row / CELL..rect.end_row().div_ceil(CELL);
        rows.flat_map(move |row| {
            columns.clone().map(move |col| Rect::new(col * CELL, row * CELL, CELL, CELL))
        })
    }

    /// The grids that may have a sample in a cell, in order.
    pub(super) fn of(&self, cell: Rect, bounds: Rect, grids: &[WarpedGrid]) -> Arc<[u32]> {
        let row = self.row(cell.row / CELL);
        let found = row[(cell.col / CELL) as usize].get_or_init(|| {
            let part = cell.intersect(&bounds);
            (0..).zip(grids).filter(|(_, grid)| grid.is_near(part)).map(|(at, _)| at).collect()
        });
        Arc::clone(found)
    }

    fn row(&self, number: u32) -> CellRow {
        let mut rows = lock(&self.rows);
        if let Some((_, row)) = rows.iter().find(|(own, _)| *own == number) {
            return Arc::clone(row);
        }
        let row: CellRow = Arc::new((0..self.across).map(|_| OnceLock::new()).collect());
        if rows.len() == ROWS {
            rows.pop_front();
        }
        rows.push_back((number, Arc::clone(&row)));
        row
    }
}
