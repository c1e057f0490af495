//! Natural neighbour interpolation (Sibson 1981), final or not at all.
//!
//! A position q, were it a site, would take area from the Voronoi cells of its natural neighbours; the
//! areas are their weights. The triangles whose circles hold q make a cavity (Bowyer, Watson 1981);
//! its border are the neighbours, and the areas taken lie between the centres of its circles and
//! those of q with each edge of the border. A disc of q with such an edge lies in the union of the
//! discs of the two triangles beside the edge, so the result is final when the triangles of the
//! cavity and those around it are.

use super::disc::CircumscribedDisc;
use super::divide_and_conquer::{GHOST, next, prev};
use super::hull::{ConvexHull, HullLocation};
use super::interpolate::{float, interpolate};
use super::position::{FixedPosition, SiteOffset};
use super::predicates::site;
use super::query::{deepest, from_lowest};
use super::space::{NeededWindow, PointIndex};
use super::stars::within;
use super::triangulation::Triangulation;
use super::window::SiteWindow;
use terrane_base::error::Result;
use terrane_base::geom::Point;

/// Pitches of margin around the window at first.
const MARGIN: i32 = 8;

/// Natural neighbour heights in a window. Positions in it may be asked for in any order; near ones
/// after each other are found fast.
#[derive(Debug)]
pub struct Natural<'a, S> {
    space: &'a S,
    hull: &'a ConvexHull,
    /// All known points in here are triangulated.
    window: SiteWindow,
    points: Vec<Point>,
    triangulation: Triangulation,
    /// By triangle, whether it is known to be final.
    finals: Vec<bool>,
    /// A side of the triangle found last.
    last: u32,
    /// Room for what a position takes.
    cavity: NaturalNeighborCavity,
}

/// Reason for a missing value.
enum MissingPoints {
    /// A known point lies in a disc but not in the window.
    Grow,
    Needs(NeededWindow),
}

impl<'a, S: PointIndex> Natural<'a, S> {
    /// Prepares a window: triangulates the known points in it and around it. `hull` is that of all
    /// points of the cloud.
    ///
    /// # Errors
    /// More points than [`Triangulation::new`] takes.
    pub fn new(space: &'a S, hull: &'a ConvexHull, window: &SiteWindow) -> Result<Self> {
        let window = window.grown(space.pitch().saturating_mul(MARGIN));
        let mut points = within(space, &window);
        points.extend_from_slice(hull.ring());
        let triangulation = Triangulation::new(&points)?;
        let finals = vec![false; triangulation.numbers() as usize];
        let mut triangles = 0..triangulation.numbers();
        let last = 3 * triangles.find(|&t| triangulation.corners(t).is_some()).unwrap_or(0);
        let cavity = NaturalNeighborCavity::default();
        Ok(Self { space, hull, window, points, triangulation, finals, last, cavity })
    }

    /// The height at `q` in steps; at a point its z, and `None` outside the hull. A plane is
    /// reproduced. On the boundary of the hull the height is linear along the edge.
    ///
    /// The inner error is what has to be known in addition.
    ///
    /// # Errors
    /// More points than [`Triangulation::new`] takes.
    pub fn height(
        &mut self,
        q: FixedPosition,
    ) -> Result<std::result::Result<Option<f64>, NeededWindow>> {
        loop {
            match self.try_height(q) {
                Ok(height) => return Ok(Ok(height)),
                Err(MissingPoints::Needs(needs)) => return Ok(Err(needs)),
                Err(MissingPoints::Grow) => {
                    let longest = (0..2).map(|i| self.window.high[i] / 2 - self.window.low[i] / 2);
                    let margin = longest.max().unwrap_or(1).max(self.space.pitch());
                    let window = self.window.grown(margin);
                    // Gone before the larger one is made.
                    self.points = Vec::new();
                    self.triangulation = Triangulation::new(&[])?;
                    *self = Self::new(self.space, self.hull, &window)?;
                }
            }
        }
    }

    fn try_height(&mut self, q: FixedPosition) -> std::result::Result<Option<f64>, MissingPoints> {
        if self.triangulation.is_flat() || self.hull.locate(q) == HullLocation::Outside {
            return Ok(self.point_at(q).map(|p| p.z.into()));
        }
        let s = self.locate(q);
        let corners = from_lowest(self.corners(s));
        let arms = corners.map(|p| q.to(site(&p)));
        if let Some(corner) = arms.iter().position(|arm| arm.is_zero()) {
            return Ok(Some(corners[corner].z.into()));
        }
        let mut cavity = std::mem::take(&mut self.cavity);
        let found = cavity.open(self, q, s).map(|()| Some(cavity.height(&corners)));
        self.cavity = cavity;
        found
    }

    fn point_at(&self, q: FixedPosition) -> Option<Point> {
        let mut point = None;
        let window = SiteWindow { low: q.floor(), high: q.floor() };
        self.space.visit(&window, |run| {
            point = point.or(run.iter().find(|p| FixedPosition::of(site(p)) == q).copied());
        });
        point
    }

    fn point(&self, s: u32) -> Option<Point> {
        match self.triangulation.from(s) {
            GHOST => None,
            v => Some(self.points[self.triangulation.id(v) as usize]),
        }
    }

    /// Corners of a triangle that is not a ghost, from the start of side `s`.
    fn corners(&self, s: u32) -> [Point; 3] {
        [s, next(s), prev(s)].map(|s| self.point(s).unwrap_or_default())
    }

    fn is_ghost(&self, s: u32) -> bool {
        [s, next(s), prev(s)].iter().any(|s| self.triangulation.from(*s) == GHOST)
    }

    /// The side from the lowest corner of the triangle that contains `q`, which is not outside the
    /// hull: a walk towards it.
    fn locate(&mut self, q: FixedPosition) -> u32 {
        // On the boundary the moved position may be outside; it is inside when moved the other way.
        for back in [false, true] {
            if let Some(s) = self.walk(q, back) {
                self.last = s;
                break;
            }
        }
        let lowest = [self.last, next(self.last), prev(self.last)];
        lowest.into_iter().min_by_key(|s| self.point(*s)).unwrap_or(self.last)
    }

    fn walk(&self, q: FixedPosition, back: bool) -> Option<u32> {
        let mut s = self.last;
        loop {
            let sides = [s, next(s), prev(s)];
            let arms = self.corners(s).map(|p| q.to(site(&p)));
            let beyond = (0..3).find(|&i| !arms[i].sees_left(arms[(i + 1) % 3], back));
            let Some(beyond) = beyond else { return Some(s) };
            s = self.triangulation.twin(sides[beyond]);
            if self.is_ghost(s) {
                return None;
            }
        }
    }

    /// True if the triangle of a side is part of the whole triangulation.
    fn check_final(
        &mut self,
        s: u32,
        disc: &CircumscribedDisc,
    ) -> std::result::Result<(), MissingPoints> {
        let triangle = (s / 3) as usize;
        if self.finals[triangle] {
            return Ok(());
        }
        if !disc.lies_in(&self.window) && deepest(self.space, disc, &SiteWindow::ALL).is_some() {
            return Err(MissingPoints::Grow);
        }
        self.space.certify(disc).map_err(MissingPoints::Needs)?;
        self.finals[triangle] = true;
        Ok(())
    }
}

/// Neighbour weights at a position. Lengths in steps, relative to the position.
#[derive(Debug, Default)]
struct NaturalNeighborCavity {
    q: FixedPosition,
    /// The neighbours counter-clockwise, and twice the area taken from each.
    border: Vec<(Point, f64)>,
    /// Centres of the circles of the position and each edge of the border, from each neighbour on.
    centres: Vec<[f64; 2]>,
    /// Voronoi edges inside.
    edges: Vec<VoronoiEdge>,
    /// An edge of the hull that the position lies on.
    on: Option<[Point; 2]>,
    /// Sides to cross, each with the centre on this side of it.
    open: Vec<(u32, [f64; 2])>,
}

/// An edge between the Voronoi cells of two neighbours, from one centre to the other.
#[derive(Clone, Copy, Debug)]
struct VoronoiEdge {
    from: [f64; 2],
    to: [f64; 2],
    left: Point,
    right: Point,
}

impl NaturalNeighborCavity {
    /// Becomes the cavity of a position around the triangle of side `s`.
    fn open<S: PointIndex>(
        &mut self,
        of: &mut Natural<'_, S>,
        q: FixedPosition,
        s: u32,
    ) -> std::result::Result<(), MissingPoints> {
        (self.q, self.on) = (q, None);
        self.border.clear();
        self.centres.clear();
        self.edges.clear();
        self.open.clear();
        let disc = CircumscribedDisc::around(of.corners(s).map(|p| site(&p)));
        of.check_final(s, &disc)?;
        let centre = disc.centre_from(q);
        self.open.extend([(prev(s), centre), (next(s), centre), (s, centre)]);
        while let Some((s, centre)) = self.open.pop() {
            let [u, v] = [s, next(s)].map(|s| of.point(s).unwrap_or_default());
            let twin = of.triangulation.twin(s);
            let mut beyond = None;
            if !of.is_ghost(twin) {
                let corners = of.corners(twin).map(|p| site(&p));
                let disc = CircumscribedDisc::around(corners);
                of.check_final(twin, &disc)?;
                beyond = disc.holds_position(q).then(|| disc.centre_from(q));
            }
            match beyond {
                Some(other) => {
                    self.edges.push(VoronoiEdge { from: centre, to: other, left: v, right: u });
                    self.open.extend([(prev(twin), other), (next(twin), other)]);
                }
                None => self.close(centre, u, v),
            }
        }
        Ok(())
    }

    /// Takes an edge into the border.
    fn close(&mut self, centre: [f64; 2], u: Point, v: Point) {
        let arms = [u, v].map(|p| self.q.to(site(&p)));
        match centre_with(arms) {
            Some(other) => {
                self.edges.push(VoronoiEdge { from: centre, to: other, left: v, right: u });
                self.centres.push(other);
            }
            None => self.on = Some([u, v]),
        }
        self.border.push((u, 0.0));
    }

    /// The height: that of the plane of the triangle around the position, plus the weighted deviation
    /// of the neighbours from it. That is the weighted height, but rounding of the weights does not
    /// touch what is plane.
    fn height(&mut self, corners: &[Point; 3]) -> f64 {
        if let Some([u, v]) = self.on {
            return along_edge(u, v, self.q);
        }
        self.weigh();
        let weighted = self.border.iter().map(|(p, weight)| {
            let plane = interpolate(corners, FixedPosition::of(site(p)));
            weight * (f64::from(p.z) - plane)
        });
        let total: f64 = self.border.iter().map(|(_, weight)| weight).sum();
        let change = weighted.sum::<f64>() / total;
        interpolate(corners, self.q) + if change.is_finite() { change } else { 0.0 }
    }

    /// The areas: each cell's share is a polygon, whose edges are summed up by the shoelace formula.
    fn weigh(&mut self) {
        let count = self.border.len();
        for i in 0..count {
            let (before, after) = (self.centres[(i + count - 1) % count], self.centres[i]);
            self.border[i].1 += cross(before, after);
        }
        for VoronoiEdge { from, to, left, right } in &self.edges {
            let area = cross(*from, *to);
            for (point, taken) in &mut self.border {
                if point == left {
                    *taken += area;
                } else if point == right {
                    *taken -= area;
                }
            }
        }
    }
}

fn cross(u: [f64; 2], v: [f64; 2]) -> f64 {
    u[0] * v[1] - u[1] * v[0]
}

/// Centre of the circle through a position and two sites seen from it, in steps from the position;
/// `None` where they are collinear.
fn centre_with([u, v]: [SiteOffset; 2]) -> Option<[f64; 2]> {
    let area = u.cross(v);
    let [a, b] = [u, v].map(SiteOffset::steps);
    let (aa, bb) = (a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1]);
    let double = 2.0 * float(area) / f64::from(1u32 << (2 * super::position::FRACTION));
    (area != 0).then(|| [(b[1] * aa - a[1] * bb) / double, (a[0] * bb - b[0] * aa) / double])
}

/// The height on the edge between two points, at a position on it; the same from either end.
fn along_edge(u: Point, v: Point, q: FixedPosition) -> f64 {
    let (low, high) = (u.min(v), u.max(v));
    let from = q.to(site(&low)).steps();
    let length = f64::from(high.x - low.x).hypot(f64::from(high.y - low.y));
    let rise = f64::from(high.z) - f64::from(low.z);
    f64::from(low.z) + rise * (from[0].hypot(from[1]) / length)
}

#[cfg(test)]
mod tests {
    use super::super::oracle::{self, Dice};
    use super::super::point_bins::PointBins;
    use super::super::space::LoadedPoints;
    use super::*;

    /// Area of the cell of `centre` among `others`, cut out of a large square by half planes.
    fn cell(centre: [f64; 2], others: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut cell = vec![[-1e7, -1e7], [1e7, -1e7], [1e7, 1e7], [-1e7, 1e7]];
        for other in others {
            cell = clip(&cell, centre, *other);
        }
        cell
    }

    /// The part of a polygon nearer to `a` than to `b`.
    fn clip(polygon: &[[f64; 2]], a: [f64; 2], b: [f64; 2]) -> Vec<[f64; 2]> {
        let normal = [b[0] - a[0], b[1] - a[1]];
        let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        let side = |p: [f64; 2]| (p[0] - middle[0]) * normal[0] + (p[1] - middle[1]) * normal[1];
        let mut kept = vec![];
        for (i, p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (s, t) = (side(*p), side(q));
            if s <= 0.0 {
                kept.push(*p);
            }
            if (s < 0.0 && t > 0.0) || (s > 0.0 && t < 0.0) {
                let at = s / (s - t);
                kept.push([p[0] + (q[0] - p[0]) * at, p[1] + (q[1] - p[1]) * at]);
            }
        }
        kept
    }

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let next = |i: usize| polygon[(i + 1) % polygon.len()];
        (0..polygon.len()).map(|i| cross(polygon[i], next(i))).sum::<f64>() / 2.0
    }

    /// Sibson's definition, word for word: what the cell of q takes from each old cell.
    fn brute(points: &[Point], q: FixedPosition) -> f64 {
        let at = |p: &Point| q.to(site(p)).steps();
        let all: Vec<_> = points.iter().map(at).collect();
        let new = cell([0.0, 0.0], &all);
        let (mut sum, mut total) = (0.0, 0.0);
        for (i, p) in points.iter().enumerate() {
            let mut taken = new.clone();
            for (j, other) in all.iter().enumerate() {
                if i != j && !taken.is_empty() {
                    taken = clip(&taken, all[i], *other);
                }
            }
            let weight = if taken.is_empty() { 0.0 } else { area(&taken) };
            sum += weight * f64::from(p.z);
            total += weight;
        }
        sum / total
    }

    fn positions(n: usize, most: i32) -> Vec<FixedPosition> {
        let mut dice = Dice(5);
        let mut any = || f64::from(dice.below(most * 16)) / 16.0;
        (0..n).map(|_| FixedPosition::from_steps(any(), any())).collect()
    }

    #[test]
    fn areas_are_those_of_voronoi_cells() {
        let mut dice = Dice(1);
        for most in [12, 2_000] {
            let mut any = |most: i32| dice.below(most);
            let mut points: Vec<_> =
                (0..60).map(|_| Point::new(any(most), any(most), any(100))).collect();
            points.sort();
            points.dedup_by_key(|p| site(p));
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let space = LoadedPoints::whole(&bins);
            let mut natural = Natural::new(&space, &hull, &bins.window()).unwrap();
            for q in positions(200, most) {
                // Near the hull the cells are cut off by the square.
                let reach = 64 * i64::from(most);
                let inner = [[-1, -1], [-1, 1], [1, -1], [1, 1]].iter().all(|[x, y]| {
                    hull.locate(FixedPosition { x: q.x + x * reach, y: q.y + y * reach })
                        == HullLocation::Inside
                });
                if inner {
                    let (found, expected) =
                        (natural.height(q).unwrap().unwrap().unwrap(), brute(&points, q));
                    let at_point = points.iter().any(|p| FixedPosition::of(site(p)) == q);
                    assert!(
                        (found - expected).abs() < 1e-6 || at_point,
                        "{q:?} {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn collinear_points_have_heights_at_themselves_alone() {
        let points: Vec<_> = (0..50).map(|i| Point::new(i * 6, i * 4, 100 - i)).collect();
        let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
        let space = LoadedPoints::whole(&bins);
        let mut natural = Natural::new(&space, &hull, &bins.window()).unwrap();
        let mut height = |q: FixedPosition| natural.height(q).unwrap().unwrap();
        for p in &points {
            assert_eq!(height(FixedPosition::of(site(p))), Some(f64::from(p.z)));
        }
        for off in [[3.0, 2.0], [0.5, 0.0], [0.0, 1.0], [-6.0, -4.0]] {
            assert_eq!(height(FixedPosition::from_steps(off[0], off[1])), None);
        }
    }

    #[test]
    fn planes_are_reproduced_up_to_the_hull() {
        let plane = |x: f64, y: f64| 3.0 * x - 2.0 * y + 11.0;
        for (name, mut points) in oracle::awkward(300) {
            if name == "all of the reach" || name == "clusters" || name == "parabola" {
                continue;
            }
            for p in &mut points {
                p.z = plane(p.x.into(), p.y.into()) as i32;
            }
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let space = LoadedPoints::whole(&bins);
            let mut natural = Natural::new(&space, &hull, &bins.window()).unwrap();
            let middles = points.windows(2).map(|p| FixedPosition {
                x: i64::from(p[0].x + p[1].x) * 128,
                y: i64::from(p[0].y + p[1].y) * 128,
            });
            for q in middles.chain(positions(300, 20_000)) {
                let Some(found) = natural.height(q).unwrap().unwrap() else {
                    assert!(hull.locate(q) != HullLocation::Inside);
                    continue;
                };
                let [x, y] = q.steps();
                let expected = plane(x, y);
                let error = (found - expected).abs();
                assert!(error <= 1e-9 * expected.abs().max(1e3), "{name} {q:?} {found} {expected}");
            }
        }
    }

    /// A triangle of the points in a window may hold others, which are known as well.
    #[test]
    fn the_window_makes_no_difference() {
        for (name, points) in oracle::awkward(1500) {
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let space = LoadedPoints::whole(&bins);
            let mut natural = Natural::new(&space, &hull, &bins.window()).unwrap();
            for q in positions(25, 400_000).into_iter().chain(positions(25, 20_000)) {
                let here = SiteWindow { low: q.floor(), high: q.floor() };
                let found = Natural::new(&space, &hull, &here).unwrap().height(q).unwrap().unwrap();
                let expected = natural.height(q).unwrap().unwrap();
                assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{name} {q:?}");
            }
        }
    }

    #[test]
    fn positions_that_need_more_leave_no_trace() {
        let (mut asked, mut found) = (0, 0);
        for (name, points) in oracle::awkward(400) {
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let all = LoadedPoints::whole(&bins);
            let mut whole = Natural::new(&all, &hull, &bins.window()).unwrap();
            let bounds = bins.window();
            let middle = i32::midpoint(bounds.low[0], bounds.high[0]);
            let known = SiteWindow { low: bounds.low, high: [middle, bounds.high[1]] };
            let inside: Vec<_> =
                points.iter().filter(|p| known.contains(site(p))).copied().collect();
            let bins = PointBins::new(&inside);
            let space = LoadedPoints { bins: &bins, known, bounds, coverage: None };
            let mut part = Natural::new(&space, &hull, &known).unwrap();
            for q in positions(1000, 20_000).into_iter().filter(|q| known.contains(q.floor())) {
                match part.height(q).unwrap() {
                    Err(_) => asked += 1,
                    Ok(height) => {
                        let expected = whole.height(q).unwrap().unwrap();
                        assert_eq!(
                            height.map(f64::to_bits),
                            expected.map(f64::to_bits),
                            "{name} {q:?}"
                        );
                        found += 1;
                    }
                }
            }
        }
        assert!(asked > 100 && found > 100, "{asked} {found}");
    }

    #[test]
    fn what_is_final_is_the_same_to_the_last_bit() {
        let mut asked = 0;
        for (name, points) in oracle::awkward(400) {
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let whole = LoadedPoints::whole(&bins);
            let mut natural = Natural::new(&whole, &hull, &bins.window()).unwrap();
            for q in positions(40, 20_000).into_iter().chain(positions(40, 300)) {
                let expected = natural.height(q).unwrap().unwrap();
                let mut known = SiteWindow { low: q.floor(), high: q.floor() }.grown(50);
                loop {
                    let inside = points.iter().filter(|p| known.contains(site(p))).copied();
                    let bins = PointBins::new(&inside.collect::<Vec<_>>());
                    let bounds = SiteWindow::of(points.iter().map(site)).unwrap();
                    let space = LoadedPoints { bins: &bins, known, bounds, coverage: None };
                    let here = SiteWindow { low: q.floor(), high: q.floor() };
                    match Natural::new(&space, &hull, &here).unwrap().height(q).unwrap() {
                        Ok(found) => {
                            let bits = |v: Option<f64>| v.map(f64::to_bits);
                            assert_eq!(bits(found), bits(expected), "{name} {q:?}");
                            break;
                        }
                        Err(NeededWindow(more)) => {
                            asked += 1;
                            assert!(!known.covers(&more));
                            known = known.union(&more);
                        }
                    }
                }
            }
        }
        assert!(asked > 100, "{asked}");
    }
}
