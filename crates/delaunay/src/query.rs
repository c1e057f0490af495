//! The Delaunay triangle that contains a position, found without building a triangulation.
//!
//! Of all ways to write a position q as a convex combination of sites p, the one that minimises the
//! sum of lambda * |p - q|^2 uses the corners of the Delaunay triangle that contains q: a linear
//! programme with three rows, whose bases are triangles around q. The primal simplex method starts
//! from a triangle of near sites around q; while some site lies inside its circumscribed circle, that
//! site replaces the corner without which q stays inside. Ties follow [`super::predicates`], so the
//! triangle is that of the whole triangulation.

use super::disc::CircumscribedDisc;
use super::hull::{ConvexHull, HullLocation};
use super::position::{FixedPosition, SiteOffset};
use super::predicates::{in_circle, site};
use super::space::{NeededWindow, PointIndex};
use super::window::SiteWindow;
use terrane_base::geom::Point;

/// Location of a position in the triangulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// Inside a triangle: its corners counter-clockwise, from the lowest on. A position on an edge
    /// belongs to the triangle in the east of it (in the north, for an edge along x) unless it is
    /// on the boundary of the hull.
    Triangle([Point; 3]),
    /// At a point.
    At(Point),
    /// Beyond the convex hull, or anywhere but at a point if that has no area.
    Outside,
}

/// Finds triangles in a space; remembers the last one, because neighbours often share it.
#[derive(Debug)]
pub struct TriangleFinder<'a, S> {
    space: &'a S,
    hull: &'a ConvexHull,
    last: Option<[Point; 3]>,
}

/// Largest half side of the square searched for a first triangle, in pitches.
const FIRST_REACH: i32 = 16;

/// A disc up to this wide, in pitches, is searched in one go.
const WIDE: i64 = 12;

impl<'a, S: PointIndex> TriangleFinder<'a, S> {
    /// A finder in a space. `hull` is the hull of all points of the cloud, known or not.
    pub fn new(space: &'a S, hull: &'a ConvexHull) -> Self {
        Self { space, hull, last: None }
    }

    /// The Delaunay triangle of the whole cloud that contains `q`.
    ///
    /// # Errors
    /// The region to load if the known points do not suffice for certainty.
    pub fn find(&mut self, q: FixedPosition) -> Result<Location, NeededWindow> {
        if let Some(found) = self.last.and_then(|last| EnclosingTriangle::around(q, last, false)) {
            return Ok(found.result());
        }
        let mut basis = match self.first(q) {
            FinderStart::At(point) => return Ok(Location::At(point)),
            FinderStart::Outside => return Ok(Location::Outside),
            FinderStart::Basis(basis) => basis,
        };
        let disc = self.improve(&mut basis);
        if basis.arms.iter().any(|arm| arm.is_zero()) {
            return Ok(basis.result());
        }
        self.space.certify(&disc)?;
        self.last = Some(basis.corners);
        Ok(basis.result())
    }

    /// The same, but for a position on the side of two triangles of which only the one behind is small:
    /// that one. So what is made of small triangles alone has the sides of all of them.
    ///
    /// # Errors
    /// The errors of [`find`](Self::find).
    pub fn find_small(
        &mut self,
        q: FixedPosition,
        is_small: impl Fn(&[Point; 3]) -> bool,
    ) -> Result<Location, NeededWindow> {
        let location = self.find(q)?;
        match location {
            Location::Triangle(corners) if !is_small(&corners) && is_on_side(&corners, q) => {
                let behind = self.behind(q)?.filter(is_small);
                Ok(behind.map_or(location, Location::Triangle))
            }
            _ => Ok(location),
        }
    }

    /// The triangle that `q` lies in if it is moved backwards; `None` outside.
    fn behind(&self, q: FixedPosition) -> Result<Option<[Point; 3]>, NeededWindow> {
        let start =
            self.hull.start(q, true).and_then(|start| EnclosingTriangle::around(q, start, true));
        let Some(mut basis) = start else { return Ok(None) };
        let disc = self.improve(&mut basis);
        self.space.certify(&disc)?;
        Ok(Some(from_lowest(basis.corners)))
    }

    /// A triangle of known points around `q`.
    fn first(&self, q: FixedPosition) -> FinderStart {
        let (at, pitch) = (q.floor(), self.space.pitch());
        let here = SiteWindow { low: at, high: at };
        let mut reach = 1;
        while reach <= FIRST_REACH {
            let window = here.grown(pitch.saturating_mul(reach));
            let mut near = Quadrants::around(q);
            self.space.visit(&window, |run| run.iter().for_each(|p| near.offer(p)));
            if let Some(point) = near.at() {
                return FinderStart::At(point);
            }
            if let Some(basis) = near.basis(q) {
                return FinderStart::Basis(basis);
            }
            if reach == 1 && self.hull.locate(q) == HullLocation::Outside {
                return FinderStart::Outside;
            }
            reach *= 4;
        }
        self.first_of_hull(q)
    }

    /// A triangle of points of the hull around `q`.
    fn first_of_hull(&self, q: FixedPosition) -> FinderStart {
        match self.hull.locate(q) {
            HullLocation::Outside => return FinderStart::Outside,
            HullLocation::Boundary => {
                let mut ring = self.hull.ring().iter();
                if let Some(point) = ring.find(|p| FixedPosition::of(site(p)) == q) {
                    return FinderStart::At(*point);
                }
            }
            HullLocation::Inside => {}
        }
        let basis = [false, true]
            .into_iter()
            .find_map(|back| EnclosingTriangle::around(q, self.hull.start(q, back)?, back));
        basis.map_or(FinderStart::Outside, FinderStart::Basis)
    }

    /// Simplex: until no known point lies in the disc. Near points come first where the disc is
    /// large, so that it shrinks before it has to be searched.
    fn improve(&self, basis: &mut EnclosingTriangle) -> CircumscribedDisc {
        let (pitch, extent) = (self.space.pitch(), self.space.extent());
        let at = basis.q.floor();
        let mut reach = pitch.saturating_mul(2);
        loop {
            let disc = CircumscribedDisc::around(basis.corners.map(|p| site(&p)));
            let narrow = disc.radius() * 2.0 < (WIDE * i64::from(pitch)) as f64;
            let searched = match narrow {
                true => SiteWindow::ALL,
                false => match disc.clip(&extent) {
                    None => return disc,
                    Some(clipped) => clipped,
                },
            };
            let near = SiteWindow { low: at, high: at }.grown(reach);
            let window = if narrow { searched } else { near };
            match deepest(self.space, &disc, &window) {
                // Each pivot lowers the sum that the programme minimises, ties broken as in `in_circle`: no triangle
                // comes twice, and the loop ends.
                Some(point) => basis.pivot(point),
                None if window.covers(&searched) => return disc,
                None => reach = reach.saturating_mul(2),
            }
        }
    }
}

/// The known point in the window that lies deepest in the disc.
pub(super) fn deepest(
    space: &impl PointIndex,
    disc: &CircumscribedDisc,
    window: &SiteWindow,
) -> Option<Point> {
    let (mut best, mut point) = (disc.beyond(), None);
    space.visit_disc(disc, window, |run| {
        for p in run {
            let square = disc.square(site(p));
            if square <= best && disc.holds_at(site(p), square) {
                (best, point) = (square, Some(*p));
            }
        }
    });
    point
}

/// Start of the search.
enum FinderStart {
    At(Point),
    Outside,
    Basis(EnclosingTriangle),
}

/// The nearest point of each quadrant around a position, by (north of it) * 2 + (east of it). Points
/// on an axis belong to the quadrant that the moved position (see [`SiteOffset::sees_left`]) sees them in.
struct Quadrants {
    at: [f64; 2],
    /// Squared distances, in steps: rounded, since near enough is good enough.
    squares: [f64; 4],
    nearest: [Option<Point>; 4],
}

impl Quadrants {
    fn around(q: FixedPosition) -> Self {
        let at = q.steps();
        Self { at, squares: [f64::INFINITY; 4], nearest: [None; 4] }
    }

    #[inline(always)]
    fn offer(&mut self, p: &Point) {
        let (x, y) = (f64::from(p.x) - self.at[0], f64::from(p.y) - self.at[1]);
        let quadrant = usize::from(x > 0.0) + 2 * usize::from(y > 0.0);
        let square = x * x + y * y;
        if square < self.squares[quadrant] {
            self.squares[quadrant] = square;
            self.nearest[quadrant] = Some(*p);
        }
    }

    /// The point at the position: it is in the south-west, by the rule for axes.
    fn at(&self) -> Option<Point> {
        self.nearest[0].filter(|_| self.squares[0] == 0.0)
    }

    /// A triangle of the four points that contains the position: of the two beside the diagonal from
    /// first to third the one that does, or that beside the other diagonal where it is better.
    fn basis(&self, q: FixedPosition) -> Option<EnclosingTriangle> {
        let [south_west, south_east, north_west, north_east] = self.nearest;
        let [a, b, c, d] = [north_east?, north_west?, south_west?, south_east?];
        let [arm, across] = [a, c].map(|p| q.to(site(&p)));
        let (corners, fourth) = match arm.sees_left(across, false) {
            true => ([c, d, a], b),
            false => ([a, b, c], d),
        };
        let arms = corners.map(|p| q.to(site(&p)));
        let mut basis = EnclosingTriangle { q, back: false, corners, arms };
        if in_circle(site(&corners[0]), site(&corners[1]), site(&corners[2]), site(&fourth)) {
            basis.pivot(fourth);
        }
        Some(basis)
    }
}

/// A counter-clockwise triangle around a position.
struct EnclosingTriangle {
    q: FixedPosition,
    /// True if the position is moved backwards when it is on a line.
    back: bool,
    corners: [Point; 3],
    arms: [SiteOffset; 3],
}

impl EnclosingTriangle {
    /// The triangle, if it contains the position.
    #[inline]
    fn around(q: FixedPosition, corners: [Point; 3], back: bool) -> Option<Self> {
        let arms @ [a, b, c] = corners.map(|p| q.to(site(&p)));
        let inside = a.sees_left(b, back) && b.sees_left(c, back) && c.sees_left(a, back);
        inside.then_some(Self { q, back, corners, arms })
    }

    /// Takes in a point inside the circle, in place of the corner that leaves the position inside.
    fn pivot(&mut self, point: Point) {
        let arm = self.q.to(site(&point));
        let left = self.arms.map(|corner| arm.sees_left(corner, self.back));
        // The new triangle is (point, u, v) with the position left of point-u and right of point-v.
        let out = match left {
            [true, false, _] => 2,
            [_, true, false] => 0,
            _ => 1,
        };
        self.corners[out] = point;
        self.arms[out] = arm;
    }

    fn result(&self) -> Location {
        if let Some(corner) = self.arms.iter().position(|arm| arm.is_zero()) {
            return Location::At(self.corners[corner]);
        }
        Location::Triangle(from_lowest(self.corners))
    }
}

/// True if a position in a triangle is on one of its sides.
fn is_on_side(corners: &[Point; 3], q: FixedPosition) -> bool {
    let [a, b, c] = corners.map(|p| q.to(site(&p)));
    [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| from.cross(to) == 0)
}

/// The same triangle, turned so that its lowest corner comes first.
pub(super) fn from_lowest([a, b, c]: [Point; 3]) -> [Point; 3] {
    match a.min(b).min(c) {
        lowest if lowest == a => [a, b, c],
        lowest if lowest == b => [b, c, a],
        _ => [c, a, b],
    }
}

#[cfg(test)]
mod tests {
    use super::super::oracle::{self, Dice};
    use super::super::point_bins::PointBins;
    use super::super::space::{LoadedPoints, OccupancyGrid};
    use super::*;

    /// The location of a position, by testing every triangle.
    fn brute(
        points: &[Point],
        triangles: &[[Point; 3]],
        hull: &ConvexHull,
        q: FixedPosition,
    ) -> Location {
        let at = |p: &&Point| FixedPosition::of(site(p)) == q;
        if let Some(point) = points.iter().filter(at).min() {
            return Location::At(*point);
        }
        if hull.locate(q) == HullLocation::Outside {
            return Location::Outside;
        }
        let around = |back: bool| {
            let mut inside =
                triangles.iter().filter(|t| EnclosingTriangle::around(q, **t, back).is_some());
            let found = inside.next().map(|t| Location::Triangle(*t));
            assert!(inside.next().is_none());
            found
        };
        around(false).or_else(|| around(true)).unwrap_or(Location::Outside)
    }

    /// Positions over and around the points: anywhere, on half steps, on points, on edges.
    fn positions(points: &[Point], dice: &mut Dice) -> Vec<FixedPosition> {
        let window = SiteWindow::of(points.iter().map(site)).unwrap();
        let mut any = |axis: usize| {
            let (low, high) =
                (i64::from(window.low[axis]) * 256, i64::from(window.high[axis]) * 256);
            let span = high - low + 2_000;
            low - 1_000 + ((i128::from(dice.below(1 << 30)) * i128::from(span)) >> 30) as i64
        };
        let mut all = vec![];
        for i in 0..points.len().min(60) {
            let (x, y) = (any(0), any(1));
            let (a, b) = (points[i], points[(i * 7 + 1) % points.len()]);
            let middle = |u: i32, v: i32| (i64::from(u) + i64::from(v)) * 128;
            all.push(FixedPosition { x, y });
            all.push(FixedPosition { x: x & !127, y: y & !127 });
            all.push(FixedPosition::of(site(&a)));
            all.push(FixedPosition { x: middle(a.x, b.x), y: middle(a.y, b.y) });
        }
        all
    }

    #[test]
    fn finds_what_the_whole_triangulation_holds() {
        for n in [1, 2, 3, 4, 7, 20, 60] {
            for (name, points) in oracle::awkward(n) {
                let (bins, triangles) = (PointBins::new(&points), oracle::triangles(&points));
                let (space, hull) = (LoadedPoints::whole(&bins), ConvexHull::of(points.clone()));
                let mut finder = TriangleFinder::new(&space, &hull);
                for q in positions(&points, &mut Dice(7)) {
                    let expected = brute(&points, &triangles, &hull, q);
                    assert_eq!(finder.find(q), Ok(expected), "{name} {n} {q:?}");
                    let fresh = TriangleFinder::new(&space, &hull).find(q);
                    assert_eq!(fresh, Ok(expected), "{name} {n} {q:?}");
                }
            }
        }
    }

    /// Beside a look at every triangle: a position is covered by the small ones, their sides included.
    #[test]
    fn small_triangles_have_all_of_their_sides() {
        let mut mended = 0;
        for n in [4, 7, 20, 60] {
            for (name, points) in oracle::awkward(n) {
                let (bins, triangles) = (PointBins::new(&points), oracle::triangles(&points));
                let (space, hull) = (LoadedPoints::whole(&bins), ConvexHull::of(points.clone()));
                let mut finder = TriangleFinder::new(&space, &hull);
                // About half of the triangles, of no pattern.
                let is_small = |t: &[Point; 3]| (t[0].x ^ t[1].y ^ t[2].x.wrapping_mul(3)) & 1 == 0;
                let covers = |t: &[Point; 3], q: FixedPosition| {
                    let [a, b, c] = t.map(|p| q.to(site(&p)));
                    [(a, b), (b, c), (c, a)].into_iter().all(|(u, v)| u.cross(v) >= 0)
                };
                for q in positions(&points, &mut Dice(11)) {
                    let usual = finder.find(q).unwrap();
                    let found = finder.find_small(q, is_small).unwrap();
                    if matches!(usual, Location::At(_)) {
                        assert_eq!(found, usual, "{name} {n} {q:?}");
                        continue;
                    }
                    let small = |t: &&[Point; 3]| is_small(t) && covers(t, q);
                    let any = triangles.iter().any(|t| small(&t));
                    match found {
                        Location::Triangle(t) if is_small(&t) => assert!(any && covers(&t, q)),
                        _ => assert!(!any, "{name} {n} {q:?}"),
                    }
                    mended += u32::from(found != usual);
                }
            }
        }
        assert!(mended > 10, "{mended}");
    }

    /// With only a part loaded, every answer is either right or a call for more that helps.
    #[test]
    fn what_is_final_is_right_with_a_part_of_the_points() {
        let mut asked = 0;
        for (name, points) in oracle::awkward(60) {
            let (triangles, hull) = (oracle::triangles(&points), ConvexHull::of(points.clone()));
            let bounds = SiteWindow::of(points.iter().map(site)).unwrap();
            let mut coverage = OccupancyGrid::new(bounds, 1 + (bounds.high[0] - bounds.low[0]) / 9);
            points.iter().for_each(|p| coverage.add(site(p)));
            for (i, q) in positions(&points, &mut Dice(9)).into_iter().enumerate() {
                let expected = brute(&points, &triangles, &hull, q);
                let mut known =
                    SiteWindow { low: q.floor(), high: q.floor() }.grown(1 + i as i32 * 97);
                for round in 0.. {
                    assert!(round < 200, "{name}: does not end");
                    let inside = |p: &&Point| known.contains(site(p));
                    let bins =
                        PointBins::new(&points.iter().filter(inside).copied().collect::<Vec<_>>());
                    let coverage = (i % 2 == 0).then_some(&coverage);
                    let space = LoadedPoints { bins: &bins, known, bounds, coverage };
                    match TriangleFinder::new(&space, &hull).find(q) {
                        Ok(found) => {
                            assert_eq!(found, expected, "{name} {q:?} {known:?}");
                            break;
                        }
                        Err(NeededWindow(more)) => {
                            asked += 1;
                            assert!(!known.covers(&more), "{name} {q:?} {known:?}");
                            known = known.union(&more);
                        }
                    }
                }
            }
        }
        assert!(asked > 300, "{asked}");
    }
}
