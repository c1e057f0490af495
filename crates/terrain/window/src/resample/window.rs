//! A part of a grid, and where in it a place lies.

use terrane_base::geom::Rect;

/// A position among samples: column and row of the whole grid, whole numbers at samples. NaN for none.
pub type Place = [f64; 2];

/// Less of a cell than this is rounding: places so near to a border between cells are on its right, or below it.
const HAIR: f64 = 1e-10;

/// Heights of a part of a grid.
#[derive(Clone, Copy, Debug)]
pub struct SourceWindow<'a> {
    /// Columns and rows of the grid.
    pub grid: [u32; 2],
    /// The part, inside the grid.
    pub rect: Rect,
    /// Its heights, row by row; voids are NaN.
    pub heights: &'a [f64],
}

impl SourceWindow<'_> {
    /// The height of a sample; NaN outside of the window.
    pub(crate) fn at(&self, [col, row]: [i64; 2]) -> f64 {
        let [col, row] = [col - i64::from(self.rect.col), row - i64::from(self.rect.row)];
        let (cols, rows) = (0..i64::from(self.rect.width), 0..i64::from(self.rect.height));
        if !cols.contains(&col) || !rows.contains(&row) {
            return f64::NAN;
        }
        self.heights[row as usize * self.rect.width as usize + col as usize]
    }

    /// `count` samples of a row, from a column on; `None` if not all are in the window.
    #[inline]
    pub(crate) fn row(&self, [col, row]: [i64; 2], count: usize) -> Option<&[f64]> {
        let col = usize::try_from(col - i64::from(self.rect.col)).ok()?;
        let row = usize::try_from(row - i64::from(self.rect.row)).ok()?;
        let (width, height) = (self.rect.width as usize, self.rect.height as usize);
        if col + count > width || row >= height {
            return None;
        }
        self.heights.get(row * width + col..)?.get(..count)
    }

    /// The height of the sample nearest to a position; NaN beyond the grid.
    #[inline]
    pub(crate) fn nearest(&self, place: Place) -> f64 {
        nearest(self.grid, place).map_or(f64::NAN, |at| self.at(at))
    }
}

/// The sample in whose cell a place lies; `None` beyond the cells of a grid.
#[inline]
pub(crate) fn nearest(grid: [u32; 2], place: Place) -> Option<[i64; 2]> {
    Some([nearest_index(place[0], grid[0])?, nearest_index(place[1], grid[1])?])
}

/// The same along one axis.
#[inline]
pub(crate) fn nearest_index(at: f64, side: u32) -> Option<i64> {
    let (cell, side) = (at + 0.5 + HAIR, f64::from(side));
    // Not below 0, so that this rounds down.
    (cell >= 0.0 && cell <= side + 2.0 * HAIR).then(|| cell.min(side - 0.5) as i64)
}
