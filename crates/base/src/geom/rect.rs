//! A rectangle of lattice samples.

/// Samples with columns `col .. col + width` and rows `row .. row + height` of a grid.
/// Row 0 is the first row of the file (north on a north-up grid).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// First column.
    pub col: u32,
    /// First row.
    pub row: u32,
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
}

impl Rect {
    /// The rectangle with the given first column, first row, width and height.
    pub fn new(col: u32, row: u32, width: u32, height: u32) -> Self {
        Self { col, row, width, height }
    }

    /// One past the last column.
    pub fn end_col(&self) -> u32 {
        self.col + self.width
    }

    /// One past the last row.
    pub fn end_row(&self) -> u32 {
        self.row + self.height
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// True when it holds no sample.
    pub fn is_empty(&self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// True when the sample (`col`, `row`) lies in it.
    pub fn contains(&self, col: u32, row: u32) -> bool {
        (self.col..self.end_col()).contains(&col) && (self.row..self.end_row()).contains(&row)
    }

    /// True when it lies within `width` columns and `height` rows.
    ///
    /// ```
    /// use terrane_base::geom::Rect;
    /// assert!(Rect::new(2, 1, 3, 4).fits(5, 5));
    /// assert!(!Rect::new(2, u32::MAX, 3, 4).fits(5, u32::MAX));
    /// ```
    pub fn fits(&self, width: u32, height: u32) -> bool {
        self.col.checked_add(self.width).is_some_and(|end| end <= width)
            && self.row.checked_add(self.height).is_some_and(|end| end <= height)
    }

    /// The samples in both; empty (width or height 0) when there are none.
    pub fn intersect(&self, other: &Rect) -> Rect {
        let col = self.col.max(other.col);
        let row = self.row.max(other.row);
        let width = self.end_col().min(other.end_col()).saturating_sub(col);
        let height = self.end_row().min(other.end_row()).saturating_sub(row);
        Rect { col, row, width, height }
    }
}
