//! The share of each cell of a lattice that a polygon covers.
//!
//! Positions are in cells: the cell of column c and row r spans c to c + 1 and r to r + 1. Each edge is cut at the
//! borders of tiles, and each piece adds the area between itself and the right border of its tile, signed by its
//! direction, to the cells of its rows: the sum of all pieces is the covered area, without a clipped polygon for any
//! cell. (Font rasterizers work that way.) The cost is that of the cells an edge passes through, and of the cells of the
//! tiles that are covered.

use terrane_base::geom::Rect;
use terrane_options::Choice;

/// Side of a tile, in cells.
pub const TILE: u32 = 256;

/// Shares of a cell this close to 0 or 1 are 0 or 1; what is farther below or above is covered more than once.
const NEARLY: f64 = 1e-9;
const TWICE: f64 = 1e-6;

/// Which cells belong to a polygon, and with which weight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum CellRule {
    /// all cells that the polygon covers a part of, weighted with the covered fraction
    #[default]
    Exact,
    /// cells whose centre is within the polygon or on its left or upper border, with weight 1
    Center,
    /// all cells that the polygon covers a part of, with weight 1
    Touched,
}

/// A piece of an edge within a tile, lower y first.
#[derive(Clone, Copy, Debug, PartialEq)]
struct EdgePiece {
    /// Row and column of its tile.
    tile: [u32; 2],
    from: [f64; 2],
    to: [f64; 2],
    /// 1 where the polygon is at greater x, else -1.
    sign: f64,
}

/// A polygon over a lattice.
///
/// ```
/// use terrane_window::coverage::{CellRule, CoverageScratch, PolygonCells};
///
/// let mut cells = PolygonCells::new([4, 3], CellRule::Exact);
/// cells.push(&[[0.5, 1.0], [2.0, 1.0], [2.0, 2.5], [0.5, 2.5]], false);
/// cells.finish();
/// let mut shares = Vec::new();
/// for strip in cells.strips() {
///     let done: Result<_, ()> = cells.strip(strip, cells.tiles(), &mut CoverageScratch::default(), |_, tile| {
///         shares.extend_from_slice(tile);
///         Ok(())
///     });
///     assert_eq!(done, Ok(true));
/// }
/// assert_eq!(shares, [0.5, 1.0, 0.25, 0.5]);
/// ```
#[derive(Clone, Debug)]
pub struct PolygonCells {
    size: [u32; 2],
    rule: CellRule,
    pieces: Vec<EdgePiece>,
    /// Least and greatest column and row, in cells.
    low: [f64; 2],
    high: [f64; 2],
    is_within: bool,
}

/// Buffers of [`PolygonCells::strip`].
#[derive(Debug, Default)]
pub struct CoverageScratch {
    /// The change of the covered share from the cell before, row by row, with one place more a row.
    steps: Vec<f64>,
    /// Of each row, the covered share at the left border of the tile.
    carried: Vec<f64>,
    shares: Vec<f64>,
}

impl PolygonCells {
    /// Bytes a piece of an edge takes; there is one for each edge and each border of a tile that it crosses.
    pub const PIECE_BYTES: u64 = size_of::<EdgePiece>() as u64;

    /// A polygon without rings over `size` columns and rows.
    pub fn new(size: [u32; 2], rule: CellRule) -> Self {
        let [low, high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        Self { size, rule, pieces: Vec::new(), low, high, is_within: true }
    }

    /// Adds a ring of positions of at most some 10^12, in any direction, with or without its first position again at the end.
    pub fn push(&mut self, ring: &[[f64; 2]], is_hole: bool) {
        let nexts = ring.iter().cycle().skip(1);
        let double_area = match ring.first() {
            // Relative to the first position: products of large coordinates cancel.
            Some([x0, y0]) => {
                let around = |[x, y]: &[f64; 2]| [x - x0, y - y0];
                let pairs = ring.iter().zip(nexts.clone());
                pairs.map(|(a, b)| cross(around(a), around(b))).sum::<f64>()
            }
            None => return,
        };
        let turn = if (double_area < 0.0) == is_hole { 1.0 } else { -1.0 };
        for (a, b) in ring.iter().zip(nexts) {
            let [width, height] = self.size.map(f64::from);
            self.is_within &= (0.0..=width).contains(&a[0]) && (0.0..=height).contains(&a[1]);
            self.low = [self.low[0].min(a[0]), self.low[1].min(a[1])];
            self.high = [self.high[0].max(a[0]), self.high[1].max(a[1])];
            // Neighbours share the edge in either direction, and have to find the same positions on it.
            match a[1] < b[1] {
                true => self.push_edge(*a, *b, -turn),
                false => self.push_edge(*b, *a, turn),
            }
        }
    }

    /// Sorts what was added. Call once, after the last ring.
    pub fn finish(&mut self) {
        self.pieces.sort_by_key(|piece| piece.tile);
    }

    /// True if no ring leaves the lattice.
    pub fn is_within(&self) -> bool {
        self.is_within
    }

    /// Bytes taken.
    pub fn bytes(&self) -> u64 {
        self.pieces.capacity() as u64 * Self::PIECE_BYTES
    }

    /// The cells within the bounds of the polygon and the lattice.
    pub fn bounds(&self) -> Rect {
        let [columns, rows] = [0, 1].map(|axis| {
            let size = f64::from(self.size[axis]);
            let ends = [self.low[axis].floor(), self.high[axis].ceil()];
            ends.map(|end| end.clamp(0.0, size) as u32)
        });
        let spans = [columns, rows].map(|[from, to]| [from, to.saturating_sub(from)]);
        let [[col, width], [row, height]] = spans;
        Rect::new(col, row, width, height)
    }

    /// The rows of tiles that it covers a part of.
    pub fn strips(&self) -> std::ops::Range<u32> {
        let bounds = self.bounds();
        match bounds.is_empty() {
            true => 0..0,
            false => bounds.row / TILE..bounds.end_row().div_ceil(TILE),
        }
    }

    /// The columns of tiles that it covers a part of.
    pub fn tiles(&self) -> std::ops::Range<u32> {
        let bounds = self.bounds();
        bounds.col / TILE..bounds.end_col().div_ceil(TILE)
    }

    /// Hands on the shares of the cells of some [`tiles`](Self::tiles) of a row of tiles, tile by tile from left to right and row by row, of tiles with
    /// a covered cell. False if rings cross or cover each other, so that shares would be below 0 or above 1.
    ///
    /// # Errors
    /// Those of `visit`.
    pub fn strip<E>(
        &self,
        strip: u32,
        tiles: std::ops::Range<u32>,
        scratch: &mut CoverageScratch,
        mut visit: impl FnMut(Rect, &[f64]) -> Result<(), E>,
    ) -> Result<bool, E> {
        let rows = Rect::new(0, strip * TILE, self.size[0], TILE);
        let bounds = self.bounds().intersect(&rows);
        scratch.carried.clear();
        scratch.carried.resize(bounds.height as usize, 0.0);
        let start = self.pieces.partition_point(|piece| piece.tile[0] < strip);
        let (left, mut pieces) = {
            let own = &self.pieces[start..];
            own.split_at(own.partition_point(|piece| piece.tile < [strip, tiles.start]))
        };
        left.iter().for_each(|piece| self.cover_to_right(piece, bounds.row, &mut scratch.carried));
        for tile in tiles {
            let count = pieces.partition_point(|piece| piece.tile <= [strip, tile]);
            let (own, others) = pieces.split_at(count);
            pieces = others;
            let rect = Rect::new(tile * TILE, bounds.row, TILE, bounds.height).intersect(&bounds);
            match self.tile(rect, own, scratch) {
                Some(true) => visit(rect, &scratch.shares)?,
                Some(false) => {}
                None => return Ok(false),
            }
            // As for the first tile, so that shares do not depend on where a call begins.
            own.iter()
                .for_each(|piece| self.cover_to_right(piece, bounds.row, &mut scratch.carried));
        }
        Ok(true)
    }

    /// Computes the shares of a tile: true if any is above 0, `None` if any is out of range.
    fn tile(&self, rect: Rect, own: &[EdgePiece], scratch: &mut CoverageScratch) -> Option<bool> {
        let CoverageScratch { steps, carried, shares } = scratch;
        if own.is_empty() && carried.iter().all(|share| share.abs() < NEARLY) {
            return Some(false);
        }
        let width = rect.width as usize;
        let pitch = width + 1;
        steps.clear();
        steps.resize(pitch * rect.height as usize, 0.0);
        let mut cells = TileSteps { steps, rect, pitch };
        match self.rule {
            CellRule::Center => own.iter().for_each(|piece| cells.cross_centres(piece)),
            _ => own.iter().for_each(|piece| cells.cover(piece)),
        }
        shares.clear();
        let (mut is_any, mut is_sound) = (false, true);
        for (row, carried) in steps.chunks_exact(pitch).zip(&*carried) {
            let mut share = *carried;
            shares.extend(row[..width].iter().map(|step| {
                share += step;
                is_sound &= (-TWICE..1.0 + TWICE).contains(&share);
                let own = match share {
                    _ if share < NEARLY => 0.0,
                    _ if share > 1.0 - NEARLY || self.rule == CellRule::Touched => 1.0,
                    _ => share,
                };
                is_any |= own > 0.0;
                own
            }));
        }
        is_sound.then_some(is_any)
    }

    /// Adds what a piece of a tile to the left covers of the rows from `row` on.
    fn cover_to_right(&self, piece: &EdgePiece, row: u32, carried: &mut [f64]) {
        let [low, high] = [piece.from[1], piece.to[1]].map(|y| (y - f64::from(row)).max(0.0));
        let rows = (low as usize..carried.len()).take_while(|row| (*row as f64) < high);
        for row in rows {
            let [top, bottom] = [row as f64, (row + 1) as f64];
            let share = match self.rule {
                CellRule::Center => f64::from(u8::from((low..high).contains(&(top + 0.5)))),
                _ => high.min(bottom) - low.max(top),
            };
            carried[row] += share * piece.sign;
        }
    }

    /// Adds an edge, lower y first.
    fn push_edge(&mut self, from: [f64; 2], to: [f64; 2], sign: f64) {
        let [width, height] = self.size.map(f64::from);
        let edge = Edge { from, to };
        let [low, high] = [from[1], to[1]].map(|y| y.clamp(0.0, height));
        // Cut at the rows of tiles, then at their columns and at both sides of the lattice.
        let mut below = low;
        while below < high {
            let above = next_border(below).min(high);
            let [a, b] = [below, above].map(|y| [edge.x(y), y]);
            self.push_part(&edge, a, b, sign, width);
            below = above;
        }
    }

    /// Adds the part of an edge within a row of tiles.
    fn push_part(&mut self, edge: &Edge, from: [f64; 2], to: [f64; 2], sign: f64, width: f64) {
        let is_rightward = from[0] <= to[0];
        let (mut at, mut x) = (from, from[0]);
        loop {
            // The border that comes next on the way.
            let border = match is_rightward {
                true if x < 0.0 => 0.0,
                true if x < width => next_border(x).min(width),
                true => f64::INFINITY,
                false if x > width => width,
                false => previous_border(x).max(0.0),
            };
            let is_last = match is_rightward {
                true => border >= to[0],
                false => border <= to[0] || x <= 0.0,
            };
            let end = if is_last { to } else { [border, edge.y(border).clamp(at[1], to[1])] };
            self.push_piece(at, end, sign, width);
            if is_last {
                return;
            }
            (at, x) = (end, border);
        }
    }

    fn push_piece(&mut self, from: [f64; 2], to: [f64; 2], sign: f64, width: f64) {
        let middle = (from[0] + to[0]) / 2.0;
        // All of the lattice is to the left of it.
        if middle >= width || from[1] >= to[1] {
            return;
        }
        let tile = [(from[1] + to[1]) / 2.0, middle.max(0.0)].map(|at| at as u32 / TILE);
        // What is left of the lattice counts at its border.
        let [from, to] = [from, to].map(|[x, y]| [x.clamp(0.0, width), y]);
        self.pieces.push(EdgePiece { tile, from, to, sign });
    }
}

fn cross([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    ax * by - ay * bx
}

/// The border of tiles above a coordinate.
fn next_border(at: f64) -> f64 {
    ((at / f64::from(TILE)).floor() + 1.0) * f64::from(TILE)
}

/// The border of tiles below a coordinate.
fn previous_border(at: f64) -> f64 {
    ((at / f64::from(TILE)).ceil() - 1.0) * f64::from(TILE)
}

/// An edge, lower y first.
struct Edge {
    from: [f64; 2],
    to: [f64; 2],
}

impl Edge {
    /// Its x at a height of it.
    fn x(&self, y: f64) -> f64 {
        let ([ax, ay], [bx, by]) = (self.from, self.to);
        if y <= ay {
            return ax;
        }
        if y >= by { bx } else { ax + (bx - ax) * ((y - ay) / (by - ay)) }
    }

    /// Its y at an x of it; the edge is not vertical.
    fn y(&self, x: f64) -> f64 {
        let ([ax, ay], [bx, by]) = (self.from, self.to);
        ay + (by - ay) * ((x - ax) / (bx - ax))
    }
}

/// Sums of a tile.
struct TileSteps<'a> {
    steps: &'a mut [f64],
    rect: Rect,
    pitch: usize,
}

impl TileSteps<'_> {
    /// Adds the area to the right of a piece, row by row and cell by cell.
    fn cover(&mut self, piece: &EdgePiece) {
        let [[x0, y0], [x1, y1]] = self.local(piece);
        let slope = (x1 - x0) / (y1 - y0);
        let (mut x, mut y) = (x0, y0);
        while y < y1 {
            let row = y as usize;
            let end = ((row + 1) as f64).min(y1);
            let next = if end == y1 { x1 } else { x0 + (end - y0) * slope };
            self.cover_row(row, [x, next], (end - y) * piece.sign);
            (x, y) = (next, end);
        }
    }

    /// Adds the area to the right of the part of a piece within a row, of a signed height.
    fn cover_row(&mut self, row: usize, [from, to]: [f64; 2], height: f64) {
        let [low, high] = if from <= to { [from, to] } else { [to, from] };
        let row = &mut self.steps[row * self.pitch..][..self.pitch];
        let last = row.len() - 2;
        let (mut left, mut cell) = (low, (low as usize).min(last));
        loop {
            let right = if cell == last { high } else { high.min((cell + 1) as f64) };
            let part = if high > low { height * ((right - left) / (high - low)) } else { height };
            let beyond = part * ((left + right) / 2.0 - cell as f64);
            row[cell] += part - beyond;
            row[cell + 1] += beyond;
            if right >= high {
                return;
            }
            (left, cell) = (right, cell + 1);
        }
    }

    /// Adds the piece at the centres of rows that it crosses, to the first cell with its centre to the right.
    fn cross_centres(&mut self, piece: &EdgePiece) {
        let [[x0, y0], [x1, y1]] = self.local(piece);
        let slope = (x1 - x0) / (y1 - y0);
        let rows = [y0, y1].map(|y| (y - 0.5).ceil().max(0.0) as usize);
        for row in rows[0]..rows[1] {
            let x = x0 + (row as f64 + 0.5 - y0) * slope;
            let cell = (x - 0.5).ceil().max(0.0) as usize;
            self.steps[row * self.pitch + cell.min(self.pitch - 1)] += piece.sign;
        }
    }

    /// The ends of a piece, from the corner of the rectangle.
    fn local(&self, piece: &EdgePiece) -> [[f64; 2]; 2] {
        let Rect { col, row, width, height } = self.rect;
        let (origin, size) = ([col, row].map(f64::from), [width, height].map(f64::from));
        [piece.from, piece.to]
            .map(|at| [0, 1].map(|axis| (at[axis] - origin[axis]).clamp(0.0, size[axis])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The shares of all cells.
    fn shares(size: [u32; 2], rings: &[(Vec<[f64; 2]>, bool)], rule: CellRule) -> Option<Vec<f64>> {
        let mut cells = PolygonCells::new(size, rule);
        rings.iter().for_each(|(ring, is_hole)| cells.push(ring, *is_hole));
        cells.finish();
        let mut shares = vec![0.0; (size[0] * size[1]) as usize];
        let mut scratch = CoverageScratch::default();
        for strip in cells.strips() {
            let done: Result<bool, ()> =
                cells.strip(strip, cells.tiles(), &mut scratch, |rect, own| {
                    for (row, values) in (rect.row..).zip(own.chunks_exact(rect.width as usize)) {
                        let at = (row * size[0] + rect.col) as usize;
                        shares[at..at + values.len()].copy_from_slice(values);
                    }
                    Ok(())
                });
            if !done.unwrap() {
                return None;
            }
        }
        Some(shares)
    }

    /// The area of a ring within a cell, by clipping it to each side in turn.
    fn clipped(ring: &[[f64; 2]], cell: [f64; 2]) -> f64 {
        let mut ring = ring.to_vec();
        for (axis, bound, keep) in [
            (0, cell[0], 1.0),
            (0, cell[0] + 1.0, -1.0),
            (1, cell[1], 1.0),
            (1, cell[1] + 1.0, -1.0),
        ] {
            let inside = |at: &[f64; 2]| (at[axis] - bound) * keep >= 0.0;
            let mut next = Vec::new();
            for (i, b) in ring.iter().enumerate() {
                let a = ring[(i + ring.len() - 1) % ring.len()];
                if inside(&a) != inside(b) {
                    let t = (bound - a[axis]) / (b[axis] - a[axis]);
                    next.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
                }
                if inside(b) {
                    next.push(*b);
                }
            }
            ring = next;
        }
        let nexts = ring.iter().cycle().skip(1);
        ring.iter().zip(nexts).map(|(a, b)| cross(*a, *b)).sum::<f64>().abs() / 2.0
    }

    /// A ring around a centre: no two of its edges cross, as angles ascend.
    fn star(center: [f64; 2], radii: &[f64], is_reversed: bool) -> Vec<[f64; 2]> {
        let turn = std::f64::consts::TAU / radii.len() as f64;
        let at = |(i, radius): (usize, &f64)| {
            let angle = i as f64 * turn;
            [center[0] + radius * angle.cos(), center[1] + radius * angle.sin()]
        };
        let mut ring: Vec<[f64; 2]> = radii.iter().enumerate().map(at).collect();
        if is_reversed {
            ring.reverse();
        }
        ring
    }

    proptest! {
        #[test]
        fn shares_are_those_of_clipped_polygons(
            center in [-20.0..320.0, -20.0..290.0],
            radii in prop::collection::vec(0.1..90.0, 3..12),
            is_reversed: bool,
            is_snapped: bool,
            has_hole: bool,
        ) {
            let size = [300, 270];
            let mut ring = star(center, &radii, is_reversed);
            if is_snapped {
                ring.iter_mut().flatten().for_each(|c| *c = c.round());
            }
            let hole: Vec<f64> = radii.iter().map(|radius| radius * 0.5).collect();
            let mut hole = star(center, &hole, !is_reversed);
            if is_snapped || !has_hole || radii.len() < 5 {
                hole.clear();
            }
            let Some(found) = shares(size, &[(ring.clone(), false), (hole.clone(), true)], CellRule::Exact) else {
                // Rounded corners may make edges cross.
                prop_assert!(is_snapped);
                return Ok(());
            };
            for (i, share) in found.iter().enumerate().filter(|_| !is_snapped) {
                let cell = [i as u32 % size[0], i as u32 / size[0]].map(f64::from);
                let expected = clipped(&ring, cell) - clipped(&hole, cell);
                prop_assert!((share - expected).abs() < 2e-9, "{cell:?}: {share} {expected}");
            }
            let centers = shares(size, &[(ring.clone(), false), (hole, true)], CellRule::Center).unwrap();
            let touched = found.iter().filter(|share| **share > 0.0).count();
            prop_assert!(centers.iter().zip(&found).all(|(center, share)| *center == 0.0 || *share > 0.0));
            prop_assert!(centers.iter().filter(|center| **center > 0.0).count() <= touched);
        }

        #[test]
        fn neighbours_leave_nothing_between_them(
            y in prop::collection::vec(0.0..270.0, 4..9),
        ) {
            // Two halves of the lattice on both sides of a line.
            let size = [300_u32, 270];
            let step = 300.0 / (y.len() - 1) as f64;
            let line: Vec<[f64; 2]> = y.iter().enumerate().map(|(i, y)| [i as f64 * step, *y]).collect();
            let half = |y: f64| {
                let mut ring = line.clone();
                ring.extend([[300.0, y], [0.0, y]]);
                ring
            };
            for rule in [CellRule::Exact, CellRule::Center] {
                let [above, below] = [0.0, 270.0].map(|y| shares(size, &[(half(y), false)], rule).unwrap());
                for (a, b) in above.iter().zip(&below) {
                    prop_assert!((a + b - 1.0).abs() < 1e-8, "{a} {b}");
                }
            }
        }
    }

    /// Shares do not depend on the tile at which a call begins, to the last bit.
    #[test]
    fn a_strip_is_that_of_its_parts() {
        let ring = star([600.7, 400.3], &[570.0, 210.0, 380.0, 90.0, 610.0, 333.0, 150.0], true);
        for rule in [CellRule::Exact, CellRule::Center] {
            let mut cells = PolygonCells::new([1100, 900], rule);
            cells.push(&ring, false);
            cells.finish();
            let mut scratch = CoverageScratch::default();
            let mut found = |strip, tiles| {
                let mut all = Vec::new();
                let done: Result<bool, ()> =
                    cells.strip(strip, tiles, &mut scratch, |rect, own| {
                        all.push((rect, own.to_vec()));
                        Ok(())
                    });
                assert!(done.unwrap());
                all
            };
            for strip in cells.strips() {
                let parts: Vec<_> =
                    cells.tiles().flat_map(|tile| found(strip, tile..tile + 1)).collect();
                assert!(
                    found(strip, cells.tiles()) == parts && !parts.is_empty(),
                    "{strip} {rule:?}"
                );
            }
        }
    }

    #[test]
    fn centres_are_those_within() {
        let ring = star([40.3, 30.2], &[28.0, 9.0, 25.0, 14.0, 21.0], false);
        let found = shares([90, 70], &[(ring.clone(), false)], CellRule::Center).unwrap();
        for (i, share) in found.iter().enumerate() {
            let [x, y] = [i % 90, i / 90].map(|at| at as f64 + 0.5);
            let edges = ring.iter().zip(ring.iter().cycle().skip(1));
            let crossed = edges.filter(|(a, b)| {
                (a[1] <= y) != (b[1] <= y)
                    && a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])) <= x
            });
            assert_eq!(*share, f64::from(u8::from(crossed.count() % 2 == 1)), "{x} {y}");
        }
    }

    #[test]
    fn overlapping_rings_are_detected() {
        let square = vec![[1.0, 1.0], [5.0, 1.0], [5.0, 5.0], [1.0, 5.0]];
        let other: Vec<[f64; 2]> = square.iter().map(|[x, y]| [x + 2.0, y + 2.0]).collect();
        let bow = vec![[1.0, 1.0], [9.0, 9.0], [9.0, 1.0], [1.0, 9.0]];
        assert_eq!(shares([10, 10], &[(square, false), (other, false)], CellRule::Exact), None);
        assert_eq!(shares([10, 10], &[(bow, false)], CellRule::Exact), None);
    }

    #[test]
    fn cells_of_cells_are_whole() {
        // Borders on borders of cells, tiles and the lattice, and beyond it on all sides.
        for [x, y, right, top] in [[0, 0, 256, 256], [255, 3, 257, 300], [-40, -7, 700, 900]] {
            let [x, y, right, top] = [x, y, right, top].map(f64::from);
            let ring = vec![[x, y], [right, y], [right, top], [x, top], [x, y]];
            for rule in [CellRule::Exact, CellRule::Center, CellRule::Touched] {
                let found = shares([600, 512], &[(ring.clone(), false)], rule).unwrap();
                for (i, share) in found.iter().enumerate() {
                    let [col, row] = [i % 600, i / 600].map(|at| at as f64);
                    let is_in = (x..right).contains(&col) && (y..top).contains(&row);
                    assert_eq!(*share, f64::from(u8::from(is_in)), "{col} {row} {rule:?}");
                }
            }
        }
    }
}
