//! Which triangles a seam patch takes in, and whether the mesh beyond it agrees with the result.

use super::container::{Frame, Shift};
use super::layout::{Layout, Seam, TileId};
use crate::geom::Rect;
use crate::geom::predicates::{Lattice, in_circle};
use crate::tin::{Local, Triangle};

/// The triangles of a seam patch: those wholly inside its limits (no two patches of a kind share a
/// cell there) that touch a band around the seam. Where triangles are large, few are taken in; where
/// they are small, the band alone is.
///
/// A patch around a tile corner also takes in the triangles on the vertical line as far up and down
/// as the horizontal patches on its two sides would have gone on: each of them stopped there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zone {
    /// Positions are relative to these.
    limits: Rect,
    bands: [Bounds; 2],
}

/// First and last column, first and last row.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    cols: [i32; 2],
    rows: [i32; 2],
}

impl Zone {
    /// The zone of a seam of `tile`, `reach` cells on each side; around a corner, `along` cells up
    /// and down the vertical line.
    pub(super) fn new(layout: &Layout, seam: Seam, tile: TileId, reach: u32, along: u32) -> Self {
        let limits = layout.patch(seam, tile, layout.widest_reach());
        let around = |line: Option<u32>, size: u32, reach: u32| match line {
            Some(line) => [line as i32 - reach as i32, (line + reach) as i32],
            None => [0, size as i32],
        };
        let [col, row] = layout.seam_lines(seam, tile, limits);
        let cols = |reach| around(col, limits.width, reach);
        let rows = |reach| around(row, limits.height, reach);
        let band = Bounds { cols: cols(reach), rows: rows(reach) };
        let line = Bounds { cols: cols(0), rows: rows(along) };
        Self { limits, bands: [band, if seam == Seam::Corner { line } else { band }] }
    }

    /// The largest rectangle the triangles can fill.
    pub(super) fn limits(&self) -> Rect {
        self.limits
    }

    /// The rule for triangles with positions relative to `origin` (column, row).
    pub(super) fn seen_from(&self, origin: (u32, u32)) -> Membership {
        let Shift { cols, rows } = Shift::new((self.limits.col, self.limits.row), origin);
        let moved = |band: Bounds| Bounds {
            cols: band.cols.map(|col| col + cols),
            rows: band.rows.map(|row| row + rows),
        };
        Membership { limits: Frame::new(self.limits, origin), bands: self.bands.map(moved) }
    }
}

/// A [`Zone`] as seen from a tile.
pub(super) struct Membership {
    limits: Frame,
    bands: [Bounds; 2],
}

impl Membership {
    /// True when the patch takes the triangle in.
    #[inline]
    pub(super) fn contains(&self, triangle: &Triangle) -> bool {
        let bounds = Bounds::of(triangle.corners);
        self.is_within_limits(triangle) && self.bands.iter().any(|band| band.touches(&bounds))
    }

    /// True when the patch could take the triangle in.
    #[inline]
    pub(super) fn is_within_limits(&self, triangle: &Triangle) -> bool {
        triangle.corners.into_iter().fold(true, |all, at| all & self.limits.contains(at))
    }
}

impl Bounds {
    #[inline]
    fn of(corners: [Local; 3]) -> Self {
        let [a, b, c] = corners.map(|at| [at.col() as i32, at.row() as i32]);
        let span = |i: usize| [a[i].min(b[i]).min(c[i]), a[i].max(b[i]).max(c[i])];
        Self { cols: span(0), rows: span(1) }
    }

    #[inline]
    fn touches(&self, other: &Self) -> bool {
        let overlap = |a: [i32; 2], b: [i32; 2]| (a[0] <= b[1]) & (b[0] <= a[1]);
        overlap(self.cols, other.cols) & overlap(self.rows, other.rows)
    }
}

/// The rectangle that the triangles fill, with one more sample on each side where the grid goes on.
/// Their positions are relative to `limits`.
pub(super) fn rect_around(triangles: &[Triangle], limits: Rect, layout: &Layout) -> Option<Rect> {
    let bounds = triangles.iter().map(|triangle| Bounds::of(triangle.corners)).reduce(|a, b| {
        let join = |a: [i32; 2], b: [i32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Bounds { cols: join(a.cols, b.cols), rows: join(a.rows, b.rows) }
    })?;
    let first = [limits.col + bounds.cols[0] as u32, limits.row + bounds.rows[0] as u32];
    let last = [limits.col + bounds.cols[1] as u32, limits.row + bounds.rows[1] as u32];
    Some(layout.between(first.map(|at| at.saturating_sub(1)), last.map(|at| at + 1)))
}

/// The edges on the border of a mended patch beside which it changed, in search of the triangles
/// beyond them.
pub(super) struct Frontier {
    /// Edges in the direction of the triangle beyond, sorted, with the third corner on this side.
    edges: Vec<([Lattice; 2], Lattice)>,
    /// Which of them have a triangle beyond that the patch could have taken in.
    found: Vec<bool>,
    is_open: bool,
    bounds: [Lattice; 2],
}

impl Frontier {
    /// The border of a patch whose positions are relative to `from`, in positions relative to `to`.
    pub(super) fn new(border: &[[Local; 3]], from: (u32, u32), to: (u32, u32)) -> Self {
        let Shift { cols, rows } = Shift::new(from, to);
        let place = |at: Local| [at.col() as i32 + cols, at.row() as i32 + rows];
        let turned = |corners: &[Local; 3]| {
            let [a, b, c] = corners.map(place);
            ([b, a], c)
        };
        let mut edges: Vec<_> = border.iter().map(turned).collect();
        edges.sort_unstable();
        let mut bounds = [[i32::MAX; 2], [i32::MIN; 2]];
        for at in edges.iter().flat_map(|edge| edge.0) {
            bounds[0] = [bounds[0][0].min(at[0]), bounds[0][1].min(at[1])];
            bounds[1] = [bounds[1][0].max(at[0]), bounds[1][1].max(at[1])];
        }
        Self { found: vec![false; edges.len()], edges, is_open: false, bounds }
    }

    /// Looks at a triangle that the patch could have taken in, with positions relative to `origin`
    /// where the frontier's are relative to `to`.
    #[inline]
    pub(super) fn see(&mut self, triangle: &Triangle, shift: [i32; 2]) {
        let corners =
            triangle.corners.map(|at| [at.col() as i32 + shift[0], at.row() as i32 + shift[1]]);
        let [low, high] = self.bounds;
        let inside = |at: &Lattice| {
            (low[0] <= at[0]) & (at[0] <= high[0]) & (low[1] <= at[1]) & (at[1] <= high[1])
        };
        if corners.iter().filter(|&at| inside(at)).count() >= 2 {
            (0..3).for_each(|i| self.see_edge([corners[i], corners[(i + 1) % 3]], corners[(i + 2) % 3]));
        }
    }

    fn see_edge(&mut self, edge: [Lattice; 2], beyond: Lattice) {
        let Ok(at) = self.edges.binary_search_by_key(&edge, |entry| entry.0) else { return };
        let ([b, a], c) = self.edges[at];
        self.found[at] = true;
        self.is_open |= in_circle(a, b, c, beyond) > 0;
    }

    /// True when a triangle that the patch could have taken in is not Delaunay with the result.
    pub(super) fn is_open(&self) -> bool {
        self.is_open
    }

    /// How far from `row` the edges go beside which no larger patch could have changed anything.
    pub(super) fn closed_reach(&self, row: i32) -> u32 {
        let closed = self.edges.iter().zip(&self.found).filter(|&(_, found)| !found);
        let rows = closed.flat_map(|(edge, _)| edge.0.map(|at| at[1].abs_diff(row)));
        rows.max().unwrap_or(0)
    }
}
