//! Which triangles a seam patch has to take in from the start, and how far they reach.

use super::layout::{Layout, Seam, TileId};
use crate::tin::Triangle;

/// A seam as seen from some tile: tells how far the triangles beside it reach.
///
/// A patch across a seam starts with every triangle that touches the seam line. A patch around a
/// tile corner starts with those that touch the vertical line as far up and down as the horizontal
/// patches on its two sides could change things: each of them stopped at that line.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    seam: Seam,
    /// The seam lines (column, row).
    lines: [i64; 2],
    /// First and last column of the tile row's patch.
    cols: [i64; 2],
    /// Rows above and below a corner to look at.
    band: i64,
}

impl Beside {
    /// The seam of `tile` in grid positions.
    pub(super) fn new(layout: &Layout, seam: Seam, tile: TileId, band: u32) -> Self {
        let (col, row) = layout.origin(tile);
        let cells = i64::from(layout.tile_cells());
        let (first, above) = (i64::from(col), i64::from(row));
        let lines = [first + cells, above + cells];
        Self { seam, lines, cols: [first, first + cells], band: i64::from(band) }
    }

    /// The same in positions relative to `origin` (column, row).
    pub(super) fn seen_from(self, origin: (u32, u32)) -> Self {
        let (col, row) = (i64::from(origin.0), i64::from(origin.1));
        let lines = [self.lines[0] - col, self.lines[1] - row];
        Self { lines, cols: self.cols.map(|c| c - col), ..self }
    }

    /// How far the triangle reaches from the seam; 0 when the patch does not depend on it.
    pub(super) fn reach(&self, triangle: &Triangle) -> u32 {
        let cols = Span::of(triangle.corners.map(|at| i64::from(at.col())));
        let rows = Span::of(triangle.corners.map(|at| i64::from(at.row())));
        let [col, row] = self.lines;
        let reach = match self.seam {
            Seam::Vertical if cols.touches(col, 0) => cols.furthest(col),
            Seam::Horizontal if rows.touches(row, 0) && cols.lies_in(self.cols) => {
                rows.furthest(row)
            }
            Seam::Corner if cols.touches(col, 0) && rows.touches(row, self.band) => {
                cols.furthest(col).max(rows.furthest(row))
            }
            _ => 0,
        };
        reach as u32
    }
}

/// First and last of three coordinates.
#[derive(Clone, Copy)]
struct Span(i64, i64);

impl Span {
    fn of([a, b, c]: [i64; 3]) -> Self {
        Self(a.min(b).min(c), a.max(b).max(c))
    }

    fn touches(self, line: i64, band: i64) -> bool {
        self.0 <= line + band && self.1 >= line - band
    }

    fn furthest(self, line: i64) -> i64 {
        (line - self.0).max(self.1 - line)
    }

    fn lies_in(self, [first, last]: [i64; 2]) -> bool {
        self.0 >= first && self.1 <= last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tin::Local;

    #[test]
    fn only_triangles_beside_the_seam_count() {
        let layout = Layout::new(129, 129, 32).unwrap();
        let reach = |seam, band, corners: [(u32, u32); 3]| {
            let corners = corners.map(|(col, row)| Local::new(col, row));
            let triangle = Triangle { corners, max_error: 0.0, square_sum: 0.0 };
            let tile = TileId::new(1, 1);
            Beside::new(&layout, seam, tile, band).seen_from((32, 32)).reach(&triangle)
        };
        assert_eq!(reach(Seam::Vertical, 0, [(32, 0), (32, 9), (20, 4)]), 12);
        assert_eq!(reach(Seam::Vertical, 0, [(31, 0), (31, 9), (20, 4)]), 0);
        assert_eq!(reach(Seam::Horizontal, 0, [(5, 32), (9, 32), (7, 25)]), 7);
        assert_eq!(reach(Seam::Horizontal, 0, [(5, 32), (9, 32), (40, 25)]), 0);
        assert_eq!(reach(Seam::Corner, 3, [(32, 20), (32, 29), (30, 22)]), 12);
        assert_eq!(reach(Seam::Corner, 2, [(32, 20), (32, 29), (30, 22)]), 0);
    }
}
