//! The surface, which is the union of cells with four valid samples, and its outline.

use terrane_base::geom::Rect;

use super::bits::{BitGrid, ones};
use super::domain::GridDomain;
use super::totals::ProofTally;
use super::triangle::ProofPosition;

/// Valid samples and surface cells of a window of a grid.
#[derive(Clone, Debug)]
pub struct ProofSurface {
    grid: [u32; 2],
    rect: Rect,
    valid: BitGrid,
    cells: BitGrid,
}

/// A straight run of unit edges along a lattice line: from (`from`, `line`) to (`to`, `line`) in
/// (column, row) when horizontal, the other way round when vertical.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutlineRun {
    /// Along a column of samples.
    pub vertical: bool,
    /// The row (column when vertical).
    pub line: i64,
    /// First column (row).
    pub from: i64,
    /// Last column (row).
    pub to: i64,
}

/// Result of following a run along the outline of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineFollowing {
    /// All the way.
    On,
    /// It leaves the outline.
    Off,
    /// On it so far; the rest is not in this window.
    Rest(OutlineRun),
}

impl OutlineRun {
    /// Maximum number of unit edges in [`OutlineRun::window`].
    const WINDOW: i64 = 4096;

    /// The samples to read for following the first part of the run.
    pub fn window(&self, grid: [u32; 2]) -> Rect {
        let (along, across) = if self.vertical { (1, 0) } else { (0, 1) };
        let [from, to] =
            clamped_span(self.from, self.to.min(self.from + Self::WINDOW), grid[along]);
        let [low, high] = clamped_span(self.line - 1, self.line + 1, grid[across]);
        if self.vertical {
            Rect::new(low, from, high - low, to - from)
        } else {
            Rect::new(from, low, to - from, high - low)
        }
    }

    /// The cells (column, row) on the two sides of unit edge `unit`.
    fn sides(&self, unit: i64) -> [[i64; 2]; 2] {
        if self.vertical {
            [[self.line - 1, unit], [self.line, unit]]
        } else {
            [[unit, self.line - 1], [unit, self.line]]
        }
    }
}

/// Columns (rows) from `from` to `to` as far as a grid of `side` has them: first, and one past the last.
fn clamped_span(from: i64, to: i64, side: u32) -> [u32; 2] {
    let [from, to] = [from, to].map(|v| v.clamp(0, i64::from(side) - 1) as u32);
    [from, to + 1]
}

impl ProofSurface {
    /// From the heights of `rect` (inside the grid), row by row, NaN where void.
    pub fn new(grid: [u32; 2], rect: Rect, heights: &[f64]) -> Self {
        let (width, rows) = (rect.width as usize, rect.height as usize);
        let mut valid = BitGrid::new(width, rows);
        for (row, heights) in heights.chunks_exact(width).enumerate() {
            for (word, heights) in valid.row_mut(row).iter_mut().zip(heights.chunks(64)) {
                let bits = heights.iter().enumerate().map(|(i, h)| u64::from(!h.is_nan()) << i);
                *word = bits.fold(0, |all, bit| all | bit);
            }
        }
        let mut cells = BitGrid::new(width, rows);
        for row in 1..rows {
            mark_cells(cells.row_mut(row - 1), valid.row(row - 1), valid.row(row));
        }
        Self { grid, rect, valid, cells }
    }

    /// Cells of a row of the window (counted from its first); bit i is the cell whose upper left
    /// sample is column i of the window. Cells partly outside the window are clear.
    pub(crate) fn cells(&self, row: usize) -> &[u64] {
        self.cells.row(row)
    }

    /// Samples of a row of the window that belong to a surface cell.
    pub(crate) fn samples(&self, row: usize, out: &mut Vec<u64>) {
        out.clear();
        out.resize(self.cells.row(row).len(), 0);
        for row in [Some(row), row.checked_sub(1)].into_iter().flatten() {
            widen(out, self.cells.row(row));
        }
    }

    /// True for a sample of the window that belongs to a surface cell.
    pub(crate) fn has_sample(&self, at: ProofPosition) -> bool {
        self.cells_at(at).any(|is_surface| is_surface)
    }

    /// True for a sample of the window that is not on the outline: all four cells around it are surface.
    pub(crate) fn is_inside(&self, at: ProofPosition) -> bool {
        self.cells_at(at).filter(|is_surface| *is_surface).count() == 4
    }

    /// For each cell around a sample that the window may hold, whether it is surface.
    fn cells_at(&self, at: ProofPosition) -> impl Iterator<Item = bool> {
        let col = (at.col >> ProofPosition::FRACTION) - i64::from(self.rect.col);
        let row = (at.row >> ProofPosition::FRACTION) - i64::from(self.rect.row);
        let [width, height] = [self.rect.width, self.rect.height].map(i64::from);
        [[-1, -1], [0, -1], [-1, 0], [0, 0]]
            .into_iter()
            .map(move |[dx, dy]| [col + dx, row + dy])
            .filter(move |&[col, row]| (0..width).contains(&col) && (0..height).contains(&row))
            .map(move |[col, row]| self.cells.get(col as usize, row as usize))
    }

    /// Counts valid and isolated samples and surface cells of `domain`.
    pub(crate) fn count(&self, domain: &GridDomain, tally: &mut ProofTally) {
        let left = (domain.rect.col - self.rect.col) as usize;
        let above = (domain.rect.row - self.rect.row) as usize;
        let (width, height) = (domain.rect.width as usize, domain.rect.height as usize);
        let mut surface = Vec::new();
        for row in above..above + height {
            self.samples(row, &mut surface);
            for (word, mask) in super::bits::masks(left, left + width) {
                let valid = self.valid.row(row)[word] & mask;
                tally.valid += u64::from(valid.count_ones());
                tally.surface_samples += u64::from((valid & surface[word]).count_ones());
                tally.surface_cells += u64::from((self.cells(row)[word] & mask).count_ones());
            }
        }
    }

    /// True when a cell of the surface that the window holds is beside the unit edge between two samples.
    pub(crate) fn borders(&self, a: [i64; 2], b: [i64; 2]) -> bool {
        let low = [0, 1].map(|axis| a[axis].min(b[axis]));
        let across = if a[1] == b[1] { [0, 1] } else { [1, 0] };
        let beside = [low, [low[0] - across[0], low[1] - across[1]]];
        beside.into_iter().any(|cell| self.cell(cell) == Some(true))
    }

    /// Whether the cell is surface; `None` for a cell of the grid outside the window.
    fn cell(&self, [col, row]: [i64; 2]) -> Option<bool> {
        let [width, height] = self.grid.map(i64::from);
        if col < 0 || row < 0 || col >= width - 1 || row >= height - 1 {
            return Some(false);
        }
        let [col, row] = [col - i64::from(self.rect.col), row - i64::from(self.rect.row)];
        // The last column and row of the window are clear: their cells need samples beyond it.
        let is_known = (0..i64::from(self.rect.width) - 1).contains(&col)
            && (0..i64::from(self.rect.height) - 1).contains(&row);
        is_known.then(|| self.cells.get(col as usize, row as usize))
    }

    /// Unit edges that border a cell of the surface, by their first sample: those of rows, and those of
    /// columns.
    pub(crate) fn lines(&self) -> [BitGrid; 2] {
        let [mut right, mut down] = [self.cells.clone(), self.cells.clone()];
        for row in 0..self.rect.height as usize {
            widen(down.row_mut(row), self.cells.row(row));
            if let Some(above) = row.checked_sub(1) {
                let cells = right.row_mut(row).iter_mut().zip(self.cells.row(above));
                cells.for_each(|(line, cells)| *line |= cells);
            }
        }
        [right, down]
    }

    /// Follows `run` along the outline: each of its unit edges must have surface on exactly one
    /// side.
    pub fn follow(&self, run: OutlineRun) -> OutlineFollowing {
        for unit in run.from..run.to {
            match run.sides(unit).map(|side| self.cell(side)) {
                [Some(a), Some(b)] if a != b => {}
                [Some(_), Some(_)] => return OutlineFollowing::Off,
                _ => return OutlineFollowing::Rest(OutlineRun { from: unit, ..run }),
            }
        }
        OutlineFollowing::On
    }
}

/// A cell is surface when its own bit and the next are set in both rows of samples.
fn mark_cells(cells: &mut [u64], above: &[u64], below: &[u64]) {
    let mut next = 0;
    // From the last word on, as each needs the first bit of the one after it.
    for i in (0..cells.len()).rev() {
        let both = above[i] & below[i];
        cells[i] = both & (both >> 1 | next << 63);
        next = both;
    }
}

/// Adds to `out` the samples above and below the cells of a row: for each its own bit and the next.
fn widen(out: &mut [u64], cells: &[u64]) {
    let mut carry = 0;
    for (out, &cells) in out.iter_mut().zip(cells) {
        *out |= cells | cells << 1 | carry;
        carry = cells >> 63;
    }
}

/// Columns of the set bits of a row of words.
pub(crate) fn columns(words: &[u64]) -> impl Iterator<Item = usize> {
    words.iter().enumerate().flat_map(|(i, &word)| ones(word).map(move |bit| i * 64 + bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 x 3 samples with a void at (2, 0): the surface is the left column of cells and the
    /// lower row.
    fn notched() -> ProofSurface {
        let mut heights = [1.0; 12];
        heights[2] = f64::NAN;
        ProofSurface::new([4, 3], Rect::new(0, 0, 4, 3), &heights)
    }

    #[test]
    fn cells_need_four_samples() {
        let surface = notched();
        assert_eq!(surface.cells(0)[0], 0b001);
        assert_eq!(surface.cells(1)[0], 0b111);
        let mut samples = Vec::new();
        surface.samples(0, &mut samples);
        assert_eq!(samples[0], 0b0011);
        assert_eq!(columns(&samples).collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn cells_cross_words() {
        let surface = ProofSurface::new([200, 2], Rect::new(0, 0, 200, 2), &[0.0; 400]);
        assert_eq!(columns(surface.cells(0)).count(), 199);
    }

    #[test]
    fn outline_is_followed_to_its_end() {
        let surface = notched();
        let run =
            |vertical, line, from, to| surface.follow(OutlineRun { vertical, line, from, to });
        assert_eq!(run(false, 0, 0, 1), OutlineFollowing::On);
        assert_eq!(run(false, 0, 0, 2), OutlineFollowing::Off);
        assert_eq!(run(true, 1, 0, 1), OutlineFollowing::On);
        assert_eq!(run(true, 1, 0, 2), OutlineFollowing::Off);
        assert_eq!(run(false, 1, 1, 3), OutlineFollowing::On);
        assert_eq!(run(false, 2, 0, 3), OutlineFollowing::On);
        assert_eq!(run(true, 3, 1, 2), OutlineFollowing::On);
        assert_eq!(run(true, 3, 0, 1), OutlineFollowing::Off);
    }

    #[test]
    fn a_window_follows_its_part() {
        let grid = [9000, 2];
        let run = OutlineRun { vertical: false, line: 0, from: 10, to: 8999 };
        let window = run.window(grid);
        assert_eq!(window, Rect::new(10, 0, 4097, 2));
        let surface = ProofSurface::new(grid, window, &vec![0.0; window.len()]);
        assert_eq!(surface.follow(run), OutlineFollowing::Rest(OutlineRun { from: 4106, ..run }));
    }
}
