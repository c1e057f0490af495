//! The Delaunay triangulation of a set of points, with its adjacency.

use super::divide_and_conquer::{self, GHOST, HalfEdge, MortonRun, next, prev};
use super::order::{MortonSites, order};
use super::parallel::{ForkJoin, SerialJoin};
use super::predicates::{Site, in_circle, orient};
use std::cell::Cell;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

/// Most points: their sides are numbered in 32 bits.
pub const MAX_POINTS: usize = (u32::MAX / 6) as usize;

/// Most sides of which a thread keeps the room from one triangulation to the next: as many as those of half a million
/// points.
const MAX_KEPT: usize = 3 << 20;

thread_local! {
    /// Room for sides: to have it anew for each of many parts of a cloud costs more than to fill it.
    static SIDES: Cell<Vec<HalfEdge>> = const { Cell::new(Vec::new()) };
}

/// Room for `count` sides, which hold anything.
fn allocate(count: usize) -> Vec<HalfEdge> {
    let mut sides = SIDES.take();
    if sides.capacity() < count {
        // Gone before the larger one is made.
        drop(sides);
        return vec![HalfEdge::default(); count];
    }
    sides.resize(count, HalfEdge::default());
    sides
}

impl Drop for Triangulation {
    fn drop(&mut self) {
        if self.sides.capacity() <= MAX_KEPT {
            SIDES.set(std::mem::take(&mut self.sides));
        }
    }
}

/// The Delaunay triangulation of points: unique for a set of positions (see
/// [`in_circle`](super::in_circle)), whatever order they come in and however the work is forked.
///
/// Of several points at one (x, y) the lowest stands for all. Fewer than three positions, or only
/// collinear ones, have no triangles but still a hull. Triangles are numbered, some of the numbers
/// being *ghosts*: the outside beyond an edge of the hull. About 60 bytes a point.
#[derive(Debug)]
pub struct Triangulation {
    pub(super) sides: Vec<HalfEdge>,
    pub(super) ordered: MortonSites,
}

impl Triangulation {
    /// Triangulates points; n log n, on one thread.
    ///
    /// # Errors
    /// More than [`MAX_POINTS`] points.
    pub fn new(points: &[Point]) -> Result<Self> {
        Self::forked(points, &SerialJoin)
    }

    /// Triangulates points with the threads of the caller.
    ///
    /// # Errors
    /// More than [`MAX_POINTS`] points.
    pub fn forked(points: &[Point], fork: &impl ForkJoin) -> Result<Self> {
        if points.len() > MAX_POINTS {
            return Err(Error::limit(
                "the number of points to triangulate",
                points.len(),
                MAX_POINTS,
            ));
        }
        let mut ordered = order(points, fork);
        let mut sides = vec![];
        if ordered.sites.len() >= 2 {
            sides = allocate(divide_and_conquer::sides_of(ordered.sites.len()));
            let (sites, ids) = (&mut ordered.sites[..], &mut ordered.ids[..]);
            divide_and_conquer::triangulate(
                &mut MortonRun { first: 0, sites, ids, sides: &mut sides },
                fork,
            );
        }
        Ok(Self { sides, ordered })
    }

    /// Numbers of triangles, ghosts among them, are below this.
    pub fn numbers(&self) -> u32 {
        (self.sides.len() / 3) as u32
    }

    /// Corners of a triangle, counter-clockwise, as indices of the points it was made from; `None` for
    /// a ghost.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Option<[u32; 3]> {
        let sides = &self.sides[3 * triangle as usize..][..3];
        let corners = [sides[0].from, sides[1].from, sides[2].from];
        (!corners.contains(&GHOST)).then(|| corners.map(|v| self.ordered.ids[v as usize]))
    }

    /// The numbers of the triangles beyond the sides of a triangle: that beyond the side from the
    /// first to the second corner comes first. They may be ghosts.
    pub fn neighbours(&self, triangle: u32) -> [u32; 3] {
        [0, 1, 2].map(|i| self.sides[3 * triangle as usize + i].twin / 3)
    }

    /// All triangles.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        (0..self.numbers()).filter_map(|triangle| self.corners(triangle))
    }

    /// The boundary of the hull, counter-clockwise, every point on it, from the lowest on; collinear
    /// points there and back.
    pub fn hull(&self) -> Vec<u32> {
        let ghosts = (0..self.sides.len() as u32).filter(|&s| self.from(prev(s)) == GHOST);
        let Some(first) = ghosts.min_by_key(|&s| self.site(self.from(s))) else {
            return self.ordered.ids.clone();
        };
        let (mut hull, mut s) = (vec![], first);
        loop {
            hull.push(self.ordered.ids[self.from(s) as usize]);
            s = prev(self.twin(prev(s)));
            if s == first {
                return hull;
            }
        }
    }

    /// Points left out because another, lower one has the same (x, y): pairs of the index left out and
    /// the one that stands for it, sorted.
    pub fn duplicates(&self) -> &[[u32; 2]] {
        &self.ordered.duplicates
    }

    /// Number of different positions.
    pub fn positions(&self) -> usize {
        self.ordered.sites.len()
    }

    #[inline(always)]
    pub(super) fn from(&self, s: u32) -> u32 {
        self.sides[s as usize].from
    }

    #[inline(always)]
    pub(super) fn twin(&self, s: u32) -> u32 {
        self.sides[s as usize].twin
    }

    /// The index that a corner, which is not that at infinity, has in the points.
    #[inline(always)]
    pub(super) fn id(&self, v: u32) -> u32 {
        self.ordered.ids[v as usize]
    }

    /// Position of a corner, which is not that at infinity, relative to the lowest x and y.
    #[inline(always)]
    pub(super) fn site(&self, v: u32) -> Site {
        self.ordered.sites[v as usize]
    }

    /// Checks everything that makes this the Delaunay triangulation of its positions: that sides meet
    /// their twins, triangles turn left, the hull is convex, the outside and the triangles make a
    /// sphere, and each edge is Delaunay, from which it follows that all triangles are. Linear.
    ///
    /// # Errors
    /// The first thing found wrong.
    pub fn validate(&self) -> std::result::Result<(), String> {
        self.validate_beside(|_| false)
    }

    /// The same, but that sides of triangles that are `frozen` need not be Delaunay.
    ///
    /// # Errors
    /// The first thing found wrong.
    pub fn validate_beside(
        &self,
        frozen: impl Fn([u32; 3]) -> bool,
    ) -> std::result::Result<(), String> {
        let positions = self.positions();
        if positions < 2 {
            return check(self.sides.is_empty(), || "triangles without sites".to_owned());
        }
        check(self.sides.len() == divide_and_conquer::sides_of(positions), || {
            "wrong number of sides".to_owned()
        })?;
        let mut used = vec![false; positions];
        for s in 0..self.sides.len() as u32 {
            self.validate_side(s, &frozen)?;
            if let Some(used) = used.get_mut(self.from(s) as usize) {
                *used = true;
            }
        }
        check(used.iter().all(|&used| used), || "a site is in no triangle".to_owned())
    }

    fn validate_side(
        &self,
        s: u32,
        frozen: &impl Fn([u32; 3]) -> bool,
    ) -> std::result::Result<(), String> {
        let twin = self.twin(s);
        let meet = self.twin(twin) == s && self.from(twin) == self.from(next(s));
        check(meet && self.from(next(twin)) == self.from(s), || {
            format!("side {s} has a wrong twin")
        })?;
        let (corners, beyond) = (self.sites([s, next(s), prev(s)]), self.from(prev(twin)));
        match corners {
            Some([a, b, c]) => {
                check(orient(a, b, c) > 0, || {
                    format!("the triangle of side {s} does not turn left")
                })?;
                let is_legal = beyond == GHOST
                    || !in_circle(a, b, c, self.site(beyond))
                    || [s, twin].iter().any(|s| self.is_frozen(s / 3, frozen));
                check(is_legal, || format!("side {s} is not Delaunay"))
            }
            None if self.from(prev(s)) == GHOST => self.validate_hull(s),
            None => Ok(()),
        }
    }

    /// At the end of a ghost's side on the hull, the hull turns right (as seen clockwise) or goes
    /// straight on; it goes back only where all sites are collinear.
    fn validate_hull(&self, s: u32) -> std::result::Result<(), String> {
        let after = next(self.twin(next(s)));
        let Some([a, b, c]) = self.sites([s, next(s), next(after)]) else {
            return Err(format!("side {s} is not on the hull"));
        };
        let turn = orient(a, b, c);
        let [ahead_x, ahead_y] =
            [0, 1].map(|axis| i64::from(b[axis] - a[axis]) * i64::from(c[axis] - b[axis]));
        let goes_on = turn < 0 || (turn == 0 && (ahead_x + ahead_y > 0 || self.is_flat()));
        check(goes_on, || format!("the hull is not convex at the end of side {s}"))
    }

    /// True when there is no triangle.
    pub fn is_flat(&self) -> bool {
        self.triangles().next().is_none()
    }

    fn sites(&self, sides: [u32; 3]) -> Option<[Site; 3]> {
        let corners = sides.map(|s| self.from(s));
        (!corners.contains(&GHOST)).then(|| corners.map(|v| self.site(v)))
    }
}

fn check(holds: bool, or: impl FnOnce() -> String) -> std::result::Result<(), String> {
    if holds { Ok(()) } else { Err(or()) }
}

#[cfg(test)]
mod tests {
    use super::super::hull::ConvexHull;
    use super::super::oracle::{self, Dice};
    use super::super::query::from_lowest;
    use super::*;
    use spade::Triangulation as _;

    fn triangles(points: &[Point]) -> Vec<[Point; 3]> {
        let triangulation = Triangulation::new(points).unwrap();
        triangulation.validate().unwrap();
        let corners = triangulation.triangles().map(|t| t.map(|i| points[i as usize]));
        let mut all: Vec<_> = corners.map(from_lowest).collect();
        all.sort();
        all
    }

    #[test]
    fn small_sets_match_brute_force() {
        for n in (0..=16).chain([25, 36, 60]) {
            for (name, points) in oracle::awkward(n) {
                assert_eq!(triangles(&points), oracle::triangles(&points), "{name} {n}");
            }
        }
    }

    #[test]
    fn every_order_of_a_lattice_gives_the_same_triangles() {
        let lattice = |i: i32| Point::new(i % 3, i / 3, i);
        let mut points: Vec<_> = (0..6).map(lattice).collect();
        let expected = oracle::triangles(&points);
        let mut state = vec![0; points.len()];
        let mut i = 0;
        // Heap's method, once through all 720 permutations.
        while i < points.len() {
            if state[i] < i {
                points.swap(if i % 2 == 0 { 0 } else { state[i] }, i);
                assert_eq!(triangles(&points), expected);
                state[i] += 1;
                i = 0;
            } else {
                state[i] = 0;
                i += 1;
            }
        }
    }

    #[test]
    fn every_subset_of_a_small_lattice_matches_brute_force() {
        for mask in 0u32..1 << 12 {
            let chosen = (0..12).filter(|i| mask >> i & 1 == 1);
            let points: Vec<_> = chosen.map(|i| Point::new(i % 4, i / 4, 0)).collect();
            assert_eq!(triangles(&points), oracle::triangles(&points), "{mask:b}");
        }
    }

    #[test]
    fn larger_sets_are_valid_in_any_order_and_have_the_right_hull() {
        for n in [1_000, 9_000] {
            for (name, mut points) in oracle::awkward(n) {
                let all = triangles(&points);
                let triangulation = Triangulation::new(&points).unwrap();
                let hull: Vec<_> =
                    triangulation.hull().iter().map(|&i| points[i as usize]).collect();
                assert_eq!(hull, ConvexHull::of(points.clone()).ring(), "{name}");
                let mut dice = Dice(5);
                (1..points.len())
                    .rev()
                    .for_each(|i| points.swap(i, dice.below(i as i32 + 1) as usize));
                assert_eq!(triangles(&points), all, "{name}");
            }
        }
    }

    #[test]
    fn agrees_with_another_implementation() {
        let mut dice = Dice(11);
        let points: Vec<_> =
            (0..20_000).map(|i| Point::new(dice.below(1 << 29), dice.below(1 << 29), i)).collect();
        let sites = points.iter().map(|p| spade::Point2::new(f64::from(p.x), f64::from(p.y)));
        let other: spade::DelaunayTriangulation<_> =
            spade::DelaunayTriangulation::bulk_load_stable(sites.collect()).unwrap();
        let corners = other.inner_faces().map(|face| face.vertices().map(|v| points[v.index()]));
        let mut expected: Vec<_> = corners.map(from_lowest).collect();
        expected.sort();
        assert_eq!(triangles(&points), expected);
    }

    #[test]
    fn neighbours_lie_beyond_the_sides_they_are_told_for() {
        for (name, points) in oracle::awkward(60) {
            let triangulation = Triangulation::new(&points).unwrap();
            let hull = triangulation.hull();
            let ends = (0..hull.len()).map(|i| [hull[i], hull[(i + 1) % hull.len()]]);
            let rim: std::collections::BTreeSet<_> = ends.collect();
            for t in 0..triangulation.numbers() {
                let Some(corners) = triangulation.corners(t) else { continue };
                for (i, beyond) in triangulation.neighbours(t).into_iter().enumerate() {
                    let side = [corners[i], corners[(i + 1) % 3]];
                    match triangulation.corners(beyond) {
                        None => assert!(rim.contains(&side), "{name}"),
                        Some(other) => {
                            let turned = |k: usize| [other[(k + 1) % 3], other[k]] == side;
                            assert!((0..3).any(turned), "{name}");
                        }
                    }
                }
            }
        }
    }

    /// Counts how often work was divided.
    #[derive(Default)]
    struct Joins(std::sync::atomic::AtomicU32);

    impl ForkJoin for Joins {
        fn join<A: Send, B: Send>(
            &self,
            a: impl FnOnce() -> A + Send,
            b: impl FnOnce() -> B + Send,
        ) -> (A, B) {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            (a(), b())
        }
    }

    #[test]
    fn large_sets_are_divided_and_small_ones_are_not() {
        let mut dice = Dice(2);
        let points: Vec<_> =
            (0..40_000).map(|_| Point::new(dice.below(1 << 29), dice.below(1 << 29), 0)).collect();
        for (count, joins) in [(16_383, 0), (16_384, 1), (32_000, 1), (33_000, 4)] {
            let fork = Joins::default();
            let divided = Triangulation::forked(&points[..count], &fork).unwrap();
            divided.validate().unwrap();
            let counted = fork.0.into_inner();
            // Of two quarters of a random set one may be above the bound, and the other below.
            assert!(counted >= joins && counted <= 2 * joins, "{count}: {counted}");
        }
    }

    #[test]
    fn duplicates_are_reported_with_the_lowest() {
        let points = [[0, 0, 5], [9, 0, 1], [0, 0, 3], [4, 7, 1], [0, 0, 3], [9, 0, 1]];
        let points = points.map(|[x, y, z]| Point::new(x, y, z));
        let triangulation = Triangulation::new(&points).unwrap();
        assert_eq!(triangulation.duplicates(), [[0, 2], [4, 2], [5, 1]]);
        assert_eq!(triangulation.triangles().count(), 1);
        assert_eq!(triangulation.hull(), [2, 1, 3]);
    }

    #[test]
    fn validation_sees_a_dent_in_the_hull() {
        let points = [[0, 0], [10, 0], [20, 0], [10, 10]].map(|[x, y]| Point::new(x, y, 0));
        let mut triangulation = Triangulation::new(&points).unwrap();
        assert!(triangulation.validate().is_ok());
        // Its two triangles turn left and are Delaunay all the same.
        let middle = triangulation.ordered.sites.iter().position(|site| *site == [10, 0]).unwrap();
        triangulation.ordered.sites[middle] = [10, 1];
        assert!(triangulation.validate().unwrap_err().contains("convex"));
        triangulation.ordered.sites[middle] = [10, -1];
        assert!(triangulation.validate().is_ok());
    }

    #[test]
    fn validation_sees_damage() {
        let points: Vec<_> =
            (0..30).map(|i| Point::new(i % 6 * 10, i / 6 * 11 + i % 4, 0)).collect();
        let mut triangulation = Triangulation::new(&points).unwrap();
        for s in 0..triangulation.sides.len() {
            let sound = triangulation.sides[s];
            triangulation.sides[s].twin = (sound.twin + 3) % triangulation.sides.len() as u32;
            assert!(triangulation.validate().is_err());
            triangulation.sides[s] = HalfEdge { from: sound.from.wrapping_add(1) % 30, ..sound };
            assert!(triangulation.validate().is_err());
            triangulation.sides[s] = sound;
        }
        let middle = points.len() / 2;
        let site = triangulation.ordered.sites[middle];
        triangulation.ordered.sites[middle] = [site[0] + 9, site[1] - 9];
        assert!(triangulation.validate().is_err());
    }
}
