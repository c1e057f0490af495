//! Points that are added to a triangulation, one at a time, and the triangles that hold positions.
//!
//! Lawson's algorithm: the triangle of a new site is divided in three, then sides across from the site
//! are flipped until all around it are Delaunay. As a set has one triangulation, it is the one that the
//! whole set would have been given at once.

use super::divide_and_conquer::{GHOST, HalfEdge, next, prev};
use super::position::FixedPosition;
use super::predicates::{Site, in_circle, orient};
use super::triangulation::Triangulation;

/// Ways to look at the sides of a triangle.
const ORDERS: [[u32; 3]; 4] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

impl Triangulation {
    /// The number of the triangle that holds a position: a walk from one that has this number, or is
    /// beside it. A position on a side belongs to one of both triangles, as if it were moved north by an
    /// infinitesimal and west by a much smaller one; so each lies in exactly one triangle, whichever the
    /// walk begins with. `None` outside the hull.
    pub fn find(&self, at: Site, from: u32) -> Option<u32> {
        let at = self.relative(at);
        self.walk(from, |[a, b]| match orient(a, b, at) {
            0 => a > b,
            side => side < 0,
        })
    }

    /// The same for a finer position, one on a side being in the east of it (in the north, along x), as for
    /// [`TriangleFinder`](super::TriangleFinder); with `back` in the west (in the south).
    pub fn find_at(&self, at: FixedPosition, from: u32, back: bool) -> Option<u32> {
        let low = FixedPosition::of(self.ordered.low);
        let at = FixedPosition { x: at.x - low.x, y: at.y - low.y };
        self.walk(from, |[a, b]| !at.to(a).sees_left(at.to(b), back))
    }

    /// From triangle to triangle, each time over a side that the goal is beyond; `None` outside the hull. Where not
    /// all sides are Delaunay, a walk that looks at them in one order may go in circles: this one throws dice.
    fn walk(&self, from: u32, is_beyond: impl Fn([Site; 2]) -> bool) -> Option<u32> {
        let mut triangle = from;
        if self.is_ghost(triangle) {
            triangle = self.neighbours(triangle).into_iter().find(|t| !self.is_ghost(*t))?;
        }
        let (mut entered, mut dice) = (GHOST, 0_u32);
        loop {
            let sides = ORDERS[(dice >> 30) as usize].map(|i| 3 * triangle + i);
            // The side just crossed needs no test: the goal is beyond it from one triangle only, on it, too.
            let beyond = sides.into_iter().find(|&s| s != entered && is_beyond(self.ends(s)));
            let Some(side) = beyond else { return Some(triangle) };
            dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            entered = self.twin(side);
            triangle = entered / 3;
            if self.is_ghost(triangle) {
                return None;
            }
        }
    }

    /// Reserves capacity for additional points.
    pub fn reserve(&mut self, more: usize) {
        self.sides.reserve_exact(6 * more);
        self.ordered.sites.reserve_exact(more);
        self.ordered.ids.reserve_exact(more);
    }

    /// Adds a point with number `id` at a position inside the given triangle, as returned by [`find`](Self::find). Two
    /// more triangles get the next numbers; calls `changed` with the number of each changed triangle, possibly more
    /// than once. Returns false, without changes, if the position is occupied or is on the boundary of the hull.
    pub fn insert(
        &mut self,
        at: Site,
        id: u32,
        triangle: u32,
        changed: &mut impl FnMut(u32),
    ) -> bool {
        self.insert_beside(at, id, triangle, |_| false, changed)
    }

    /// As [`insert`](Self::insert), but triangles that are `frozen`, which their corners tell, stay as they are: nothing
    /// is done for a position within one or on its boundary either, and its sides are not flipped. A new triangle
    /// must not be frozen before the next point comes. So the triangulation is that of constraints: of all with these
    /// triangles in it the one that is Delaunay but for their sides.
    pub fn insert_beside(
        &mut self,
        at: Site,
        id: u32,
        triangle: u32,
        frozen: impl Fn([u32; 3]) -> bool,
        changed: &mut impl FnMut(u32),
    ) -> bool {
        let at = self.relative(at);
        if self.is_frozen(triangle, &frozen) || !self.takes(triangle, at, &frozen) {
            return false;
        }
        let site = self.ordered.sites.len() as u32;
        self.ordered.sites.push(at);
        self.ordered.ids.push(id);
        let mut open = self.divide(triangle, site);
        open.iter().for_each(|s| changed(s / 3));
        while let Some(s) = open.pop() {
            if self.is_to_flip(s, at) && !self.is_frozen(self.twin(s) / 3, &frozen) {
                changed(self.twin(s) / 3);
                open.extend(self.flip(s));
            }
        }
        true
    }

    /// A position as sites are kept.
    fn relative(&self, [x, y]: Site) -> Site {
        let low = self.ordered.low;
        [x - low[0], y - low[1]]
    }

    fn is_ghost(&self, triangle: u32) -> bool {
        (3 * triangle..3 * triangle + 3).any(|s| self.from(s) == GHOST)
    }

    fn ends(&self, s: u32) -> [Site; 2] {
        [s, next(s)].map(|s| self.site(self.from(s)))
    }

    /// True for a triangle of frozen corners; ghosts are never frozen.
    #[inline]
    pub(super) fn is_frozen(&self, triangle: u32, frozen: &impl Fn([u32; 3]) -> bool) -> bool {
        self.corners(triangle).is_some_and(frozen)
    }

    /// True if a new site may be at a position of a triangle: not on a side of a `frozen` triangle.
    fn takes(&self, triangle: u32, at: Site, frozen: &impl Fn([u32; 3]) -> bool) -> bool {
        let mut sides = 3 * triangle..3 * triangle + 3;
        !self.is_ghost(triangle) && sides.all(|s| self.allows_within(s, at, frozen))
    }

    /// True if a new site may be left of a side, or on it where the triangle beyond may be divided, too.
    fn allows_within(&self, s: u32, at: Site, frozen: &impl Fn([u32; 3]) -> bool) -> bool {
        let ([a, b], twin) = (self.ends(s), self.twin(s));
        match orient(a, b, at) {
            0 => a != at && self.from(prev(twin)) != GHOST && !self.is_frozen(twin / 3, frozen),
            side => side > 0,
        }
    }

    /// Makes three triangles of one, around a site inside; the sides across from it.
    ///
    /// ```text
    ///        c
    ///      / | \
    ///     /  v  \
    ///    / /   \ \
    ///   a --------- b
    /// ```
    fn divide(&mut self, triangle: u32, v: u32) -> Vec<u32> {
        let first = self.sides.len() as u32;
        let across = [3 * triangle, first, first + 3];
        let corners = [0, 1, 2].map(|i| self.from(across[0] + i));
        let twins = [0, 1, 2].map(|i| self.twin(across[0] + i));
        self.sides.resize(self.sides.len() + 6, HalfEdge::default());
        for (i, s) in across.into_iter().enumerate() {
            let ends = [corners[i], corners[(i + 1) % 3], v];
            for (k, from) in ends.into_iter().enumerate() {
                self.sides[s as usize + k].from = from;
            }
            self.join(s, twins[i]);
            self.join(s + 1, across[(i + 1) % 3] + 2);
        }
        across.to_vec()
    }

    /// True if the side across from a new site is not Delaunay. A site on it lies in no circle of it.
    fn is_to_flip(&self, s: u32, at: Site) -> bool {
        let beyond = self.from(prev(self.twin(s)));
        let [a, b] = self.ends(s);
        beyond != GHOST && (orient(a, b, at) == 0 || in_circle(a, b, at, self.site(beyond)))
    }

    /// Turns the side from a to b of the triangles (a, b, v) and (b, a, d) into one from d to v; the sides
    /// across from v.
    ///
    /// ```text
    ///      v              v
    ///    /   \          / | \
    ///   a --- b   ->   a  |  b
    ///    \   /          \ | /
    ///      d              d
    /// ```
    fn flip(&mut self, s: u32) -> [u32; 2] {
        let o = self.twin(s);
        let (v, b, d) = (self.from(prev(s)), self.from(o), self.from(prev(o)));
        let [to_a, to_b, to_v] = [next(o), prev(o), next(s)].map(|side| self.twin(side));
        for (side, from) in [(next(s), d), (o, d), (next(o), b), (prev(o), v)] {
            self.sides[side as usize].from = from;
        }
        self.join(s, to_a);
        self.join(o, to_b);
        self.join(next(o), to_v);
        self.join(next(s), prev(o));
        [s, o]
    }

    fn join(&mut self, s: u32, t: u32) {
        self.sides[s as usize].twin = t;
        self.sides[t as usize].twin = s;
    }
}

#[cfg(test)]
mod tests {
    use super::super::oracle::{self, Dice};
    use super::super::query::from_lowest;
    use super::*;
    use terrane_base::geom::Point;

    fn triangles(triangulation: &Triangulation, points: &[Point]) -> Vec<[Point; 3]> {
        triangulation.validate().unwrap();
        let corners = triangulation.triangles().map(|t| t.map(|i| points[i as usize]));
        let mut all: Vec<_> = corners.map(from_lowest).collect();
        all.sort();
        all
    }

    /// Points within four far ones, the last of which come one at a time.
    #[test]
    fn points_that_come_late_change_nothing() {
        for (n, (name, awkward)) in [5, 9, 16, 36, 400, 3_000]
            .into_iter()
            .flat_map(|n| oracle::awkward(n).into_iter().map(move |set| (n, set)))
        {
            let far = |x, y| Point::new(x * (1 << 28), y * (1 << 28), 0);
            let mut points = vec![far(-1, -1), far(1, -1), far(-1, 1), far(1, 1)];
            points.extend(awkward.into_iter().map(|p| Point::new(p.x / 4, p.y / 4, p.z)));
            points.sort_by_key(|p| (p.x.abs() < 1 << 28, p.z, p.x, p.y));
            let mut seen = std::collections::BTreeSet::new();
            points.retain(|p| seen.insert([p.x, p.y]));
            let whole = Triangulation::new(&points).unwrap();
            for first in [4, (points.len() / 2).max(4)] {
                let mut grown = Triangulation::new(&points[..first]).unwrap();
                let mut near = 0;
                for (id, p) in points.iter().enumerate().skip(first) {
                    let triangle = grown.find([p.x, p.y], near).unwrap();
                    let before: Vec<_> = (0..grown.numbers()).map(|t| grown.corners(t)).collect();
                    let mut changed = vec![];
                    let mut tell = |t| changed.push(t);
                    assert!(grown.insert([p.x, p.y], id as u32, triangle, &mut tell), "{name} {n}");
                    assert!(!grown.insert([p.x, p.y], 0, triangle, &mut |_| {}), "{name} {n}");
                    near = changed[0];
                    if n < 100 {
                        let differs = |t: &u32| before.get(*t as usize) != Some(&grown.corners(*t));
                        assert!((0..grown.numbers()).filter(differs).all(|t| changed.contains(&t)));
                    }
                }
                assert_eq!(triangles(&grown, &points), triangles(&whole, &points), "{name} {n}");
            }
        }
    }

    #[test]
    fn each_position_lies_in_one_triangle_wherever_it_is_looked_for() {
        let mut dice = Dice(4);
        for (name, points) in oracle::awkward(25) {
            let triangulation = Triangulation::new(&points).unwrap();
            // As if moved by an infinitesimal.
            let holds = |t: u32, at: Site| {
                triangulation.corners(t).is_some_and(|corners| {
                    let [a, b, c] = corners.map(|i| points[i as usize]).map(|p| [p.x, p.y]);
                    [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
                        let side = orient(from, to, at);
                        let moved = [to[0] - from[0], from[1] - to[1]];
                        side > 0 || (side == 0 && (moved[0] > 0 || (moved[0] == 0 && moved[1] < 0)))
                    })
                })
            };
            let sites: Vec<Site> = points.iter().map(|p| [p.x, p.y]).collect();
            let middle =
                |i: usize, k: usize| [0, 1].map(|axis| (sites[i][axis] + sites[k][axis]) / 2);
            let count = sites.len();
            let between = (0..count * count).map(|k| middle(k / count, k % count));
            for at in sites.iter().copied().chain(between) {
                let walk = |from| triangulation.find(at, from);
                let from = |dice: &mut Dice| dice.below(triangulation.numbers() as i32) as u32;
                if triangulation.is_flat() {
                    continue;
                }
                let found: Vec<_> = (0..6).map(|_| walk(from(&mut dice))).collect();
                assert!(found.iter().all(|t| *t == found[0]), "{name} {at:?}");
                let expected: Vec<_> =
                    (0..triangulation.numbers()).filter(|t| holds(*t, at)).collect();
                assert_eq!(found[0].as_slice(), expected, "{name} {at:?}");
            }
        }
    }

    #[test]
    fn the_boundary_of_the_hull_takes_no_points() {
        let points = [[0, 0], [8, 0], [8, 8], [0, 8]].map(|[x, y]| Point::new(x, y, 0));
        let mut square = Triangulation::new(&points).unwrap();
        for at in [[4, 0], [8, 4], [0, 4], [4, 8]] {
            for triangle in 0..square.numbers() {
                assert!(!square.insert(at, 9, triangle, &mut |_| {}), "{at:?}");
            }
        }
        assert_eq!(square.find([4, 9], 0), None);
        assert_eq!(square.positions(), 4);
    }
}
