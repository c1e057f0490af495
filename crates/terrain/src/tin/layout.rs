//! The tiling of a grid, and the rectangle of samples of each task.
//!
//! A grid of W x H samples has (W-1) x (H-1) cells. Tiles are squares of T x T cells from the first
//! sample on; the last column and row of tiles may be narrower. A tile's rectangle holds its rim on
//! all four sides, so neighbours share a line of samples.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// Fewest and most cells along a tile's side. A triangle stored with its tile reaches at most 1.5
/// tiles beyond the tile's first sample, which must stay below the 2^14 of [`terrane_tin::TilePosition`].
pub const TILE_CELLS: std::ops::RangeInclusive<u32> = 16..=8192;
const _: () = assert!(*TILE_CELLS.end() * 3 / 2 < 1 << 14);

/// Default number of cells along a tile's side.
pub const USUAL_TILE: u32 = 512;
const _: () = assert!(*TILE_CELLS.start() <= USUAL_TILE && USUAL_TILE <= *TILE_CELLS.end());

/// First reach of a seam patch, in cells on each side of the seam; it doubles while the kernel asks
/// for more. Changes rarely go further than the triangles that touch the rim, and a narrow patch
/// keeps the re-read samples to a few per cent.
const FIRST_REACH: u32 = 16;

/// A tile by its row and column among the tiles; ordered row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct TileId {
    pub(super) row: u32,
    pub(super) col: u32,
}

impl std::fmt::Display for TileId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tile {},{}", self.row, self.col)
    }
}

impl TileId {
    pub(super) fn new(row: u32, col: u32) -> Self {
        Self { row, col }
    }
}

/// Where a seam patch lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SeamKind {
    /// Along the line of samples between a tile and the one on its right.
    Vertical,
    /// Along the line of samples between a tile and the one below.
    Horizontal,
    /// Around the corner where four tiles meet.
    Corner,
}

/// Checks the number of cells along a tile's side.
pub(super) fn checked_tile(tile: u32) -> Result<u32> {
    if TILE_CELLS.contains(&tile) {
        return Ok(tile);
    }
    let (min, max) = (TILE_CELLS.start(), TILE_CELLS.end());
    Err(Error::usage(format!("a tile size of {tile} cells is out of range"))
        .remedy(format!("pass {min} to {max}")))
}

/// The tiling of one grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileLayout {
    width: u32,
    height: u32,
    tile: u32,
    spacing: u32,
    /// Tiles along a row.
    pub(super) cols: u32,
    /// Rows of tiles.
    pub(super) rows: u32,
}

impl TileLayout {
    /// The tiling of `width` x `height` samples into tiles of `tile` cells.
    pub(super) fn new(width: u32, height: u32, tile: u32) -> Result<Self> {
        checked_tile(tile)?;
        if width < 2 || height < 2 {
            return Err(Error::bad_input(format!(
                "a surface needs at least 2 x 2 samples, the grid has {width} x {height}"
            )));
        }
        // A tile larger than the grid would only reserve more memory.
        let tile = tile.min((width.max(height) - 1).max(*TILE_CELLS.start()));
        let (cols, rows) = ((width - 1).div_ceil(tile), (height - 1).div_ceil(tile));
        Ok(Self { width, height, tile, spacing: tile / 4, cols, rows })
    }

    /// Cells along a tile's side.
    pub(super) fn side(&self) -> u32 {
        self.tile
    }

    /// The tiling of the same grid into tiles of at most `max_cells` cells, with anchor vertices no closer than
    /// here: a tile is a few times their spacing wide, or a fraction of it.
    pub(super) fn finer(&self, max_cells: u32) -> Result<Self> {
        if self.tile <= max_cells {
            return Ok(*self);
        }
        let spacing = self.spacing;
        let side = match max_cells / spacing {
            0 => spacing / spacing.div_ceil(max_cells),
            times => times * spacing,
        };
        let finer = Self::new(self.width, self.height, side)?;
        Ok(Self { spacing, ..finer })
    }

    /// Number of tiles.
    pub(super) fn tiles(&self) -> u64 {
        u64::from(self.cols) * u64::from(self.rows)
    }

    /// Number of samples of the grid.
    pub(super) fn samples(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Number of cells of the grid.
    pub(super) fn cells(&self) -> u64 {
        u64::from(self.width - 1) * u64::from(self.height - 1)
    }

    /// Position of `tile` in row-by-row order.
    pub(super) fn index(&self, tile: TileId) -> u64 {
        u64::from(tile.row) * u64::from(self.cols) + u64::from(tile.col)
    }

    /// The tile at position `index` of row-by-row order.
    pub(super) fn tile_at(&self, index: u64) -> TileId {
        let cols = u64::from(self.cols);
        TileId::new((index / cols) as u32, (index % cols) as u32)
    }

    /// The tile at an offset in rows and columns, if it exists.
    pub(super) fn step(&self, tile: TileId, rows: i32, cols: i32) -> Option<TileId> {
        let row = tile.row.checked_add_signed(rows).filter(|&r| r < self.rows)?;
        let col = tile.col.checked_add_signed(cols).filter(|&c| c < self.cols)?;
        Some(TileId { row, col })
    }

    /// `tile` moved down and right, but not beyond the last row and column.
    pub(super) fn clamp(&self, tile: TileId, rows: u32, cols: u32) -> TileId {
        let row = (tile.row + rows).min(self.rows - 1);
        TileId { row, col: (tile.col + cols).min(self.cols - 1) }
    }

    /// Grid position (column, row) of the tile's first sample.
    pub(super) fn origin(&self, tile: TileId) -> (u32, u32) {
        (tile.col * self.tile, tile.row * self.tile)
    }

    /// The samples of a tile, rim included on all sides.
    pub(super) fn rect(&self, tile: TileId) -> Rect {
        let (col, row) = self.origin(tile);
        self.between([col, row], [col + self.tile, row + self.tile])
    }

    /// The tile's samples with one more on each side where the grid goes on.
    pub(super) fn apron(&self, tile: TileId) -> Rect {
        let (col, row) = self.origin(tile);
        // No clamp on this side: `between` cuts off at the end of the grid.
        let last = [col + self.tile + 1, row + self.tile + 1];
        self.between([col.saturating_sub(1), row.saturating_sub(1)], last)
    }

    /// The tile that owns the sample at (`col`, `row`), which is also the tile that keeps the
    /// triangles whose bounding box starts there: tiles are half-open, the last ones closed.
    pub(super) fn owner(&self, col: u32, row: u32) -> TileId {
        let (row, col) = (row / self.tile, col / self.tile);
        TileId { row: row.min(self.rows - 1), col: col.min(self.cols - 1) }
    }

    /// The samples a tile owns.
    pub(super) fn owned(&self, tile: TileId) -> Rect {
        let all = self.rect(tile);
        let width = all.width - u32::from(tile.col + 1 < self.cols);
        Rect { width, height: all.height - u32::from(tile.row + 1 < self.rows), ..all }
    }

    /// All tiles that own a sample of `rect`.
    pub(super) fn owners(&self, rect: Rect) -> impl Iterator<Item = TileId> + use<> {
        let first = self.owner(rect.col, rect.row);
        let last = self.owner(rect.end_col() - 1, rect.end_row() - 1);
        (first.row..=last.row)
            .flat_map(move |row| (first.col..=last.col).map(move |col| TileId { row, col }))
    }

    /// All tiles that may keep a triangle wholly inside `rect`.
    pub(super) fn keepers(&self, rect: Rect) -> impl Iterator<Item = TileId> + use<> {
        // A triangle is kept by the first corner of its bounding box, and no triangle inside begins in the
        // last column or row.
        self.owners(Rect { width: rect.width - 1, height: rect.height - 1, ..rect })
    }

    /// The last tile whose vertices a triangle kept with `tile` can use.
    pub(super) fn furthest_vertex(&self, tile: TileId) -> TileId {
        self.clamp(tile, 1, 1)
    }

    /// The rectangle of the seam patch below and/or right of `tile`, `reach` cells wide on each
    /// side of the seam.
    pub(super) fn patch(&self, seam: SeamKind, tile: TileId, reach: u32) -> Rect {
        let (col, row) = self.origin(tile);
        let (mut first, mut last) = ([col, row], [col + self.tile, row + self.tile]);
        if seam != SeamKind::Horizontal {
            (first[0], last[0]) = (last[0] - reach, last[0] + reach);
        }
        if seam != SeamKind::Vertical {
            (first[1], last[1]) = (last[1] - reach, last[1] + reach);
        }
        self.between(first, last)
    }

    /// The seam lines (column, row) of a patch, relative to `rect`, where they cross it.
    pub(super) fn seam_lines(&self, seam: SeamKind, tile: TileId, rect: Rect) -> [Option<u32>; 2] {
        let (col, row) = self.origin(tile);
        let col = (seam != SeamKind::Horizontal).then_some(col + self.tile);
        let row = (seam != SeamKind::Vertical).then_some(row + self.tile);
        [(col, rect.col), (row, rect.row)].map(|(line, first)| line?.checked_sub(first))
    }

    /// Which sides (left, right, above, below) of `rect` are ends of the grid.
    pub(super) fn grid_ends(&self, rect: Rect) -> [bool; 4] {
        let (right, below) = (rect.end_col() == self.width, rect.end_row() == self.height);
        [rect.col == 0, right, rect.row == 0, below]
    }

    /// The reaches to try for a seam patch, narrow to wide.
    pub(super) fn reaches(&self) -> impl Iterator<Item = u32> + use<> {
        let widest = self.widest_reach();
        std::iter::successors(Some(FIRST_REACH.min(widest)), move |&reach| {
            (reach < widest).then(|| (reach * 2).min(widest))
        })
    }

    /// The most a patch may reach: beyond half a tile two patches of one phase would overlap.
    pub(super) fn widest_reach(&self) -> u32 {
        self.tile / 2
    }

    /// Largest spacing of the anchor vertices of a tile. It limits triangles to about a third of a tile, so
    /// that a patch of half a tile holds all triangles at its seam.
    pub(super) fn spacing(&self) -> u32 {
        self.spacing
    }

    /// The rows of a finished tile that no narrow patch will read again.
    pub(super) fn middle(&self, tile: TileId) -> Rect {
        let rect = self.rect(tile);
        let margin = FIRST_REACH.min(rect.height / 2);
        Rect { row: rect.row + margin, height: rect.height - 2 * margin, ..rect }
    }

    /// The rectangle from `first` to `last` (column, row; inclusive), cut off at the grid's end.
    pub(super) fn between(&self, first: [u32; 2], last: [u32; 2]) -> Rect {
        let end = [last[0].min(self.width - 1) + 1, last[1].min(self.height - 1) + 1];
        Rect::new(first[0], first[1], end[0] - first[0], end[1] - first[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_own_every_sample_once() {
        for (width, height) in [(2, 2), (17, 33), (18, 40), (100, 16)] {
            let layout = TileLayout::new(width, height, 16).unwrap();
            let owned: u64 =
                (0..layout.tiles()).map(|i| layout.owned(layout.tile_at(i)).len() as u64).sum();
            assert_eq!(owned, layout.samples());
            for (col, row) in [(0, 0), (width - 1, height - 1), (width / 2, height / 2)] {
                assert!(layout.owned(layout.owner(col, row)).contains(col, row));
            }
        }
    }

    #[test]
    fn reaches_double_up_to_half_a_tile() {
        let reaches =
            |tile| -> Vec<u32> { TileLayout::new(9000, 9000, tile).unwrap().reaches().collect() };
        assert_eq!(reaches(16), [8]);
        assert_eq!(reaches(100), [FIRST_REACH, 2 * FIRST_REACH, 50]);
        assert_eq!(reaches(512).last(), Some(&256));
    }

    #[test]
    fn finer_tiles_have_posts_no_closer() {
        for tile in 16..=2000 {
            let layout = TileLayout::new(9000, 9000, tile).unwrap();
            let finer = layout.finer(128).unwrap();
            let [side, spacing] = [finer.side(), finer.spacing()];
            assert_eq!(spacing, layout.spacing());
            assert!(side <= 128 && side >= 64.min(tile), "{tile}");
            assert!(side == tile || side < spacing || side % spacing == 0, "{tile}");
        }
    }

    #[test]
    fn patches_of_a_phase_share_no_cell() {
        let layout = TileLayout::new(100, 100, 17).unwrap();
        let widest = layout.widest_reach();
        for col in 0..layout.cols - 2 {
            let here = layout.patch(SeamKind::Vertical, TileId::new(0, col), widest);
            let next = layout.patch(SeamKind::Vertical, TileId::new(0, col + 1), widest);
            assert!(here.end_col() - 1 <= next.col);
        }
        assert_eq!(layout.patch(SeamKind::Corner, TileId::new(4, 4), 8), Rect::new(77, 77, 17, 17));
        assert_eq!(
            layout.patch(SeamKind::Horizontal, TileId::new(4, 5), 8),
            Rect::new(85, 77, 15, 17)
        );
    }

    #[test]
    fn the_grid_ends_at_its_borders() {
        let layout = TileLayout::new(129, 129, 64).unwrap();
        let ends = |seam, row, col| layout.grid_ends(layout.patch(seam, TileId::new(row, col), 8));
        assert_eq!(ends(SeamKind::Vertical, 0, 0), [false, false, true, false]);
        assert_eq!(ends(SeamKind::Vertical, 1, 0), [false, false, false, true]);
        assert_eq!(ends(SeamKind::Horizontal, 0, 1), [false, true, false, false]);
        assert_eq!(ends(SeamKind::Corner, 0, 0), [false; 4]);
    }

    #[test]
    fn too_small_a_grid_is_refused() {
        for (width, height) in [(1, 1), (1, 9), (9, 1), (0, 0)] {
            let error = TileLayout::new(width, height, 16).unwrap_err();
            assert_eq!(error.kind(), terrane_base::ErrorKind::BadInput);
        }
    }
}
