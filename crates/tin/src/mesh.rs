//! The triangle store: 32-byte triangles in one flat array, Delaunay insertion, and validation.
//!
//! A half-edge is `4 * triangle + edge`; edge `i` of a triangle runs from `corners[i]` to
//! `corners[i + 1]`. A half-edge without a twin lies on the border and is never flipped.
//!
//! ```text
//!          b                         b
//!        / | \                     /   \
//!       /  |  \                   /  u  \
//!      p t | u d   -- flip -->   p ----- d
//!       \  |  /                   \  t  /
//!        \ | /                     \   /
//!          a                         a
//! ```

use super::lattice_position::TilePosition;
use terrane_base::geom::predicates::{Lattice, in_circle, orient};

/// "No half-edge": the border of the mesh.
pub(super) const NONE: u32 = u32::MAX;

/// Scan state of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TriangleScanState {
    /// Scanned at the stride `2^level`; no sample beyond the tolerance was found.
    Passed(u8),
    /// All its samples are within the tolerance, as are its edges between samples.
    Kept,
    /// Changed since it was last scanned.
    Dirty,
    /// Scanned; a sample to insert is known.
    Waiting,
    /// Outside the surface: never scanned, not part of the result.
    Outside,
    /// Not in use.
    Free,
}

/// One triangle; corners are counter-clockwise in (column, row) axes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct LatticeTriangle {
    pub(super) corners: [TilePosition; 3],
    pub(super) twins: [u32; 3],
    /// The input triangle or another identifier until it changes: then [`NONE`].
    pub(super) source: u32,
    pub(super) state: TriangleScanState,
}

/// Border edges that must not be split.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum FixedBorder {
    /// None, during initialization.
    #[default]
    Nothing,
    /// All except those on the sides (left, right, above, below) of a rectangle of `cells` where the grid ends.
    Inside { ends: [bool; 4], cells: [u32; 2] },
}

/// A triangulation of lattice positions.
#[derive(Debug, Default)]
pub(super) struct LatticeMesh {
    pub(super) tris: Vec<LatticeTriangle>,
    free: Vec<u32>,
    stack: Vec<u32>,
    /// Border edges that must not be split.
    pub(super) fixed: FixedBorder,
}

/// The next edge or corner of a triangle, without a division.
#[inline(always)]
pub(super) fn next(i: u32) -> u32 {
    // The mask is 0 for 2 and all ones for 0 and 1.
    (i + 1) & (((i >> 1) & 1) ^ 1).wrapping_neg()
}

/// The previous edge or corner.
#[inline(always)]
pub(super) fn prev(i: u32) -> u32 {
    if i == 0 { 2 } else { i - 1 }
}

/// Location of a position within its triangle.
enum LocationInTriangle {
    Inside,
    Edge(u32),
    Corner,
}

impl FixedBorder {
    /// True if the border may be split at `p`.
    fn allows(self, p: TilePosition) -> bool {
        match self {
            Self::Nothing => true,
            Self::Inside { ends: [left, right, above, below], cells: [cols, rows] } => {
                (left && p.col() == 0)
                    || (right && p.col() == cols)
                    || (above && p.row() == 0)
                    || (below && p.row() == rows)
            }
        }
    }
}

impl LatticeMesh {
    /// Empties the mesh, keeping its memory.
    pub(super) fn clear(&mut self) {
        self.tris.clear();
        self.free.clear();
        self.stack.clear();
        self.fixed = FixedBorder::Nothing;
    }

    /// Resets the mesh to the two triangles of a rectangle (`cols` x `rows` cells).
    pub(super) fn reset_to_rectangle(&mut self, cols: u32, rows: u32) {
        self.clear();
        let [a, b] = [TilePosition::new(0, 0), TilePosition::new(cols, 0)];
        let [c, d] = [TilePosition::new(cols, rows), TilePosition::new(0, rows)];
        self.tris.push(LatticeTriangle::new([a, b, c], [NONE, NONE, 4]));
        self.tris.push(LatticeTriangle::new([a, c, d], [2, NONE, NONE]));
    }

    /// The corner of triangle `t` from which edge `e` starts.
    #[inline(always)]
    pub(super) fn origin(&self, half_edge: u32) -> TilePosition {
        self.tris[(half_edge >> 2) as usize].corners[(half_edge & 3) as usize]
    }

    /// The corner at which a half-edge ends.
    #[inline(always)]
    pub(super) fn end(&self, half_edge: u32) -> TilePosition {
        self.tris[(half_edge >> 2) as usize].corners[next(half_edge & 3) as usize]
    }

    /// True if a position is left of a half-edge or on its line.
    #[inline(always)]
    pub(super) fn is_left(&self, half_edge: u32, at: Lattice) -> bool {
        orient(self.origin(half_edge).lattice(), self.end(half_edge).lattice(), at) >= 0
    }

    /// The opposite half-edge, or [`NONE`].
    #[inline(always)]
    pub(super) fn twin(&self, half_edge: u32) -> u32 {
        self.tris[(half_edge >> 2) as usize].twins[(half_edge & 3) as usize]
    }

    /// Ids of triangles in use.
    pub(super) fn ids(&self) -> impl Iterator<Item = u32> + '_ {
        let tris = self.tris.iter().enumerate();
        tris.filter(|(_, tri)| tri.state != TriangleScanState::Free).map(|(id, _)| id as u32)
    }

    /// A fresh or recycled slot holding `tri`.
    pub(super) fn add(&mut self, tri: LatticeTriangle) -> u32 {
        if let Some(id) = self.free.pop() {
            self.tris[id as usize] = tri;
            return id;
        }
        self.tris.push(tri);
        (self.tris.len() - 1) as u32
    }

    /// Releases a slot.
    pub(super) fn remove(&mut self, id: u32) {
        self.tris[id as usize].state = TriangleScanState::Free;
        self.free.push(id);
    }

    /// Marks all triangles as unchanged.
    pub(super) fn forget_changes(&mut self) {
        self.tris.iter_mut().for_each(|tri| tri.source = 0);
    }

    /// Marks all triangles for a new test, after changes of heights or of the tolerance.
    pub(super) fn judge_again(&mut self) {
        for tri in self.tris.iter_mut().filter(|tri| {
            !matches!(tri.state, TriangleScanState::Free | TriangleScanState::Outside)
        }) {
            tri.state = TriangleScanState::Dirty;
        }
    }

    /// Collects the half-edges that start at the same vertex as `half_edge`, counter-clockwise from it. Returns false
    /// if they do not form a closed star inside the surface, or exceed `max_degree`: the list is then incomplete.
    pub(super) fn star(&self, half_edge: u32, max_degree: usize, star: &mut Vec<u32>) -> bool {
        star.clear();
        let mut at = half_edge;
        loop {
            let tri = &self.tris[(at >> 2) as usize];
            if tri.state == TriangleScanState::Outside || star.len() == max_degree {
                return false;
            }
            star.push(at);
            at = tri.twins[prev(at & 3) as usize];
            if at == half_edge || at == NONE {
                return at == half_edge;
            }
        }
    }

    /// Makes `a` and `b` (either may be [`NONE`]) twins.
    #[inline(always)]
    pub(super) fn link(&mut self, a: u32, b: u32) {
        if a != NONE {
            self.tris[(a >> 2) as usize].twins[(a & 3) as usize] = b;
        }
        if b != NONE {
            self.tris[(b >> 2) as usize].twins[(b & 3) as usize] = a;
        }
    }

    /// Locates the triangle that contains `p`, walking from `start`. The mesh must be convex.
    pub(super) fn locate(&self, p: TilePosition, start: u32) -> u32 {
        let target = p.lattice();
        let mut at = start;
        'walk: loop {
            let tri = &self.tris[at as usize];
            for edge in 0..3_u32 {
                let a = tri.corners[edge as usize].lattice();
                let b = tri.corners[next(edge) as usize].lattice();
                // Any edge that the target is beyond will do: in a Delaunay triangulation such a walk never meets a
                // triangle twice (Devillers, Pion & Teillaud, "Walking in a triangulation", 2002).
                if orient(a, b, target) < 0 {
                    at = tri.twins[edge as usize] >> 2;
                    continue 'walk;
                }
            }
            return at;
        }
    }

    /// The triangle that contains `to`, seen from the edge crossing of the segment from its neighbour `from`, with the
    /// two on both sides; `None` if the mesh ends in between.
    pub(super) fn follow(
        &self,
        half_edge: u32,
        from: TilePosition,
        to: TilePosition,
    ) -> Option<u32> {
        let target = to.lattice();
        // The line is a unit step, so on one axis both ends have one coordinate. A corner's tells its side.
        let axis = usize::from(from.row() == to.row());
        let mut at = if self.is_left(half_edge, target) { half_edge } else { self.twin(half_edge) };
        while at != NONE {
            let id = at >> 2;
            let [after, before] = [next(at & 3), prev(at & 3)].map(|edge| 4 * id + edge);
            if self.is_left(after, target) && self.is_left(before, target) {
                return Some(id);
            }
            // The apex is where `after` ends: the line leaves by the edge whose ends it parts.
            let [apex, origin] = [self.end(after), self.origin(at)]
                .map(|corner| corner.lattice()[axis].cmp(&target[axis]));
            at = self.twin(if apex == origin { after } else { before });
        }
        None
    }

    fn place(&self, t: u32, p: TilePosition) -> Option<LocationInTriangle> {
        let [a, b, c] = self.tris[t as usize].corners.map(TilePosition::lattice);
        let q = p.lattice();
        let sides = [orient(a, b, q), orient(b, c, q), orient(c, a, q)];
        match sides {
            _ if sides.iter().any(|&side| side < 0) => None,
            [0, 0, _] | [0, _, 0] | [_, 0, 0] => Some(LocationInTriangle::Corner),
            [0, ..] => Some(LocationInTriangle::Edge(0)),
            [_, 0, _] => Some(LocationInTriangle::Edge(1)),
            [_, _, 0] => Some(LocationInTriangle::Edge(2)),
            _ => Some(LocationInTriangle::Inside),
        }
    }

    /// Inserts `p` into its triangle `t` and restores the Delaunay property. Appends the triangles around `p`, all
    /// dirty and with `p` as corner 0, to `star`. Returns false if `p` is already a vertex, is outside `t`, or is on a
    /// fixed border.
    ///
    /// Expected constant time (Lawson's flips; the number of flips is the degree of `p` minus 3).
    pub(super) fn insert(&mut self, t: u32, p: TilePosition, star: &mut Vec<u32>) -> bool {
        match self.place(t, p) {
            Some(LocationInTriangle::Inside) => self.split_inside(t, p),
            Some(LocationInTriangle::Edge(edge)) if self.may_split(t, edge, p) => {
                self.split_edge(t, edge, p)
            }
            _ => return false,
        }
        self.legalise(star);
        true
    }

    fn may_split(&self, t: u32, edge: u32, p: TilePosition) -> bool {
        self.tris[t as usize].twins[edge as usize] != NONE || self.fixed.allows(p)
    }

    fn split_inside(&mut self, t: u32, p: TilePosition) {
        let LatticeTriangle { corners: [a, b, c], twins: [ab, bc, ca], .. } = self.tris[t as usize];
        self.tris[t as usize] = LatticeTriangle::new([p, a, b], [NONE; 3]);
        let u = self.add(LatticeTriangle::new([p, b, c], [NONE; 3]));
        let w = self.add(LatticeTriangle::new([p, c, a], [NONE; 3]));
        self.link_fan(&[(t, ab), (u, bc), (w, ca)], true);
    }

    /// Splits the triangles beside an edge in two each; on the border there is one.
    fn split_edge(&mut self, t: u32, edge: u32, p: TilePosition) {
        let tri = self.tris[t as usize];
        let [(a, twin), (b, bc), (c, ca)] = [edge, next(edge), prev(edge)].map(|i| tri.side(i));
        self.tris[t as usize] = LatticeTriangle::new([p, b, c], [NONE; 3]);
        let w = self.add(LatticeTriangle::new([p, c, a], [NONE; 3]));
        if twin == NONE {
            return self.link_fan(&[(t, bc), (w, ca)], false);
        }
        let (u, j) = (twin >> 2, twin & 3);
        let other = self.tris[u as usize];
        let [(_, ad), (d, db)] = [next(j), prev(j)].map(|i| other.side(i));
        self.tris[u as usize] = LatticeTriangle::new([p, a, d], [NONE; 3]);
        let x = self.add(LatticeTriangle::new([p, d, b], [NONE; 3]));
        self.link_fan(&[(t, bc), (w, ca), (u, ad), (x, db)], true);
    }

    /// Links the spokes of a fan of triangles with a common corner 0, and their outer edges.
    fn link_fan(&mut self, fan: &[(u32, u32)], closed: bool) {
        for (i, &(t, outer)) in fan.iter().enumerate() {
            self.link(4 * t + 1, outer);
            match fan.get(i + 1) {
                Some(&(following, _)) => self.link(4 * t + 2, 4 * following),
                None if closed => self.link(4 * t + 2, 4 * fan[0].0),
                None => {}
            }
            self.stack.push(t);
        }
    }

    /// Flips until every edge opposite the new corner 0 of the stacked triangles is Delaunay.
    fn legalise(&mut self, star: &mut Vec<u32>) {
        while let Some(t) = self.stack.pop() {
            let LatticeTriangle { corners: [p, a, b], twins: [_, outer, last], .. } =
                self.tris[t as usize];
            if outer == NONE {
                star.push(t);
                continue;
            }
            let (u, j) = (outer >> 2, outer & 3);
            let other = self.tris[u as usize];
            let d = other.corners[prev(j) as usize];
            // Four corners on one circle stay as they are; two triangles that flip on a tie flip for ever.
            if in_circle(p.lattice(), a.lattice(), b.lattice(), d.lattice()) <= 0 {
                star.push(t);
                continue;
            }
            let first = self.tris[t as usize].twins[0];
            self.tris[t as usize] = LatticeTriangle::new([p, a, d], [first, NONE, 4 * u]);
            self.tris[u as usize] = LatticeTriangle::new([p, d, b], [4 * t + 2, NONE, NONE]);
            self.link(4 * t + 1, other.twins[next(j) as usize]);
            self.link(4 * u + 1, other.twins[prev(j) as usize]);
            self.link(4 * u + 2, last);
            self.stack.push(t);
            self.stack.push(u);
        }
    }

    /// Flips the edge of `half_edge` if the corner across it is strictly inside the circle of its
    /// triangle; both triangles become dirty. Returns the two triangles flipped.
    pub(super) fn flip_if_illegal(&mut self, half_edge: u32) -> Option<[u32; 2]> {
        let (t, i) = (half_edge >> 2, half_edge & 3);
        let tri = self.tris[t as usize];
        let twin = tri.twins[i as usize];
        if twin == NONE {
            return None;
        }
        let (u, j) = (twin >> 2, twin & 3);
        let other = self.tris[u as usize];
        let (a, b) = (tri.corners[i as usize], tri.corners[next(i) as usize]);
        let (p, d) = (tri.corners[prev(i) as usize], other.corners[prev(j) as usize]);
        if in_circle(p.lattice(), a.lattice(), b.lattice(), d.lattice()) <= 0 {
            return None;
        }
        self.tris[t as usize] = LatticeTriangle::new([p, a, d], [NONE; 3]);
        self.tris[u as usize] = LatticeTriangle::new([p, d, b], [NONE; 3]);
        self.link(4 * t, tri.twins[prev(i) as usize]);
        self.link(4 * t + 1, other.twins[next(j) as usize]);
        self.link(4 * t + 2, 4 * u);
        self.link(4 * u + 1, other.twins[prev(j) as usize]);
        self.link(4 * u + 2, tri.twins[next(i) as usize]);
        Some([t, u])
    }
}

impl LatticeTriangle {
    /// A dirty triangle.
    pub(super) fn new(corners: [TilePosition; 3], twins: [u32; 3]) -> Self {
        Self { corners, twins, source: NONE, state: TriangleScanState::Dirty }
    }

    /// A corner, and the half-edge beyond the edge that begins there.
    #[inline(always)]
    pub(super) fn side(&self, edge: u32) -> (TilePosition, u32) {
        (self.corners[edge as usize], self.twins[edge as usize])
    }
}

#[cfg(test)]
impl LatticeMesh {
    /// Panics unless the mesh is [sound](Self::validate_links) and every interior edge is Delaunay.
    pub(super) fn validate(&self) {
        self.validate_links();
        for half_edge in self.ids().flat_map(|id| 4 * id..4 * id + 3) {
            let twin = self.twin(half_edge);
            if twin != NONE {
                let far = self.end((twin & !3) + next(twin & 3));
                let [a, b, c] =
                    self.tris[(half_edge >> 2) as usize].corners.map(TilePosition::lattice);
                let is_delaunay = in_circle(a, b, c, far.lattice()) <= 0;
                assert!(is_delaunay, "half-edge {half_edge} is not Delaunay");
            }
        }
    }

    /// Panics unless twins are mutual and share their edge, and every triangle has positive area.
    pub(super) fn validate_links(&self) {
        for id in self.ids() {
            let tri = &self.tris[id as usize];
            let [a, b, c] = tri.corners.map(TilePosition::lattice);
            assert!(
                orient(a, b, c) > 0,
                "triangle {id} {:?} is not counter-clockwise",
                tri.corners
            );
            for edge in 0..3 {
                self.validate_edge(id, edge);
            }
        }
    }

    fn validate_edge(&self, id: u32, edge: u32) {
        let tri = &self.tris[id as usize];
        let twin = tri.twins[edge as usize];
        if twin == NONE {
            return;
        }
        let other = &self.tris[(twin >> 2) as usize];
        assert_ne!(other.state, TriangleScanState::Free, "triangle {id} borders a free slot");
        assert_eq!(other.twins[(twin & 3) as usize], 4 * id + edge, "twins of {id} disagree");
        let end = tri.corners[next(edge) as usize];
        assert_eq!(self.origin(twin), end, "twins of {id} have different ends");
    }

    /// Twice the area covered.
    pub(super) fn double_area(&self) -> i64 {
        let area = |id| {
            let [a, b, c] = self.tris[id as usize].corners.map(TilePosition::lattice);
            orient(a, b, c)
        };
        self.ids().map(area).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn next_and_prev_cycle() {
        assert_eq!([0, 1, 2].map(next), [1, 2, 0]);
        assert_eq!([0, 1, 2].map(prev), [2, 0, 1]);
    }

    /// Wherever it is asked of: the triangle, its edges, its corners, and what is beyond.
    #[test]
    fn a_triangle_takes_what_it_holds_and_no_other() {
        let mesh = || {
            let mut mesh = LatticeMesh::default();
            mesh.reset_to_rectangle(6, 5);
            for (col, row) in [(2, 1), (4, 3), (1, 4)] {
                let p = TilePosition::new(col, row);
                mesh.insert(mesh.locate(p, 0), p, &mut Vec::new());
            }
            mesh
        };
        let tris = mesh().tris;
        for p in (0..42).map(|i| TilePosition::new(i % 7, i / 7)) {
            let is_vertex = tris.iter().any(|tri| tri.corners.contains(&p));
            for (t, tri) in (0..).zip(&tris) {
                let [a, b, c] = tri.corners.map(TilePosition::lattice);
                let is_left = |from, to| orient(from, to, p.lattice()) >= 0;
                let is_held = is_left(a, b) && is_left(b, c) && is_left(c, a);
                let mut mesh = mesh();
                let is_inserted = mesh.insert(t, p, &mut Vec::new());
                assert_eq!(is_inserted, is_held && !is_vertex, "{p:?} {t}");
                mesh.validate();
                assert_eq!(mesh.double_area(), 2 * 6 * 5);
            }
        }
    }

    proptest! {
        #[test]
        fn insertion_keeps_the_mesh_delaunay(
            points in proptest::collection::vec((0_u32..=20, 0_u32..=13), 1..200)
        ) {
            let mut mesh = LatticeMesh::default();
            mesh.reset_to_rectangle(20, 13);
            let mut star = Vec::new();
            for (col, row) in points {
                let p = TilePosition::new(col, row);
                let t = mesh.locate(p, 0);
                star.clear();
                mesh.insert(t, p, &mut star);
                for &id in &star {
                    prop_assert_eq!(mesh.tris[id as usize].corners[0], p);
                }
            }
            mesh.validate();
            prop_assert_eq!(mesh.double_area(), 2 * 20 * 13);
        }
    }
}
