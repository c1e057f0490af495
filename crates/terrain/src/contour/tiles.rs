//! The tiles of a grid, and the rims between them.

use terrane_base::geom::Rect;
use terrane_raster::GridInfo;
use terrane_window::contour::ContourVertex;

/// Squares of cells; neighbours share the samples on their rim.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContourTiles {
    pub(super) width: u32,
    height: u32,
    cells: u32,
}

/// The four rims of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TileEdge {
    North,
    East,
    South,
    West,
}

impl ContourTiles {
    pub(super) fn new(info: &GridInfo, cells: u32) -> Self {
        Self { width: info.width, height: info.height, cells }
    }

    fn across(&self) -> u32 {
        (self.width - 1).div_ceil(self.cells).max(1)
    }

    pub(super) fn count(&self) -> u64 {
        let down = (self.height - 1).div_ceil(self.cells).max(1);
        u64::from(self.across()) * u64::from(down)
    }

    /// The samples of a tile.
    pub(super) fn rect(&self, tile: u64) -> Rect {
        let across = u64::from(self.across());
        let (col, row) = ((tile % across) as u32 * self.cells, (tile / across) as u32 * self.cells);
        let (width, height) = (self.width - col, self.height - row);
        Rect::new(col, row, width.min(self.cells + 1), height.min(self.cells + 1))
    }

    /// The samples of a tile that no later one in its row or column has.
    pub(super) fn done(&self, tile: u64) -> Rect {
        let rect = self.rect(tile);
        let is_last = [rect.end_col() == self.width, rect.end_row() == self.height];
        let [less_width, less_height] = is_last.map(|last| u32::from(!last));
        Rect::new(rect.col, rect.row, rect.width - less_width, rect.height - less_height)
    }

    /// The number of samples a tile accounts for.
    pub(super) fn owned(&self, tile: u64) -> u64 {
        self.done(tile).len() as u64
    }

    /// True for a row on which tiles meet.
    pub(super) fn is_rim_row(&self, row: u32) -> bool {
        row > 0 && row + 1 < self.height && row.is_multiple_of(self.cells)
    }

    /// True for a column on which tiles meet.
    pub(super) fn is_rim_col(&self, col: u32) -> bool {
        col > 0 && col + 1 < self.width && col.is_multiple_of(self.cells)
    }

    /// The rim of a tile, with another tile beyond it, that a vertex is on.
    pub(super) fn rim(&self, rect: Rect, vertex: &ContourVertex) -> Option<TileEdge> {
        let (col, row) = vertex.edge.first(self.width);
        let (east, south) = (rect.end_col() - 1, rect.end_row() - 1);
        match vertex.edge.is_down() {
            false if row == rect.row && row > 0 => Some(TileEdge::North),
            false if row == south && south + 1 < self.height => Some(TileEdge::South),
            true if col == rect.col && col > 0 => Some(TileEdge::West),
            true if col == east && east + 1 < self.width => Some(TileEdge::East),
            _ => None,
        }
    }
}

/// The vertex with the lowest edge.
pub(super) fn lowest(vertices: &[ContourVertex]) -> usize {
    (0..vertices.len()).min_by_key(|&at| vertices[at].edge).unwrap_or(0)
}
