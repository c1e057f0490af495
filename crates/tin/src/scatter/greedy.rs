//! Greedy insertion on scattered points: each triangle lists its points, and the worst point of all becomes a vertex
//! until all are within the tolerance.
//!
//! After Garland & Heckbert, Fast Polygonal Approximation of Terrains and Height Fields (1995), for unordered samples.
//! Distances are vertical, in steps of z; comparisons with the tolerance are exact.

use std::collections::BinaryHeap;

use super::mesh::{NONE, PointLocation, ScatterMesh};
use super::point_location::{FanEdge, TriangleFan, TriangleSides};
use super::search::{ScatterCandidate, ScatterPlane, ScatterSearch, rounded_up};
use terrane_base::geom::Point;

/// The points of a region with the mesh to fit.
#[derive(Debug)]
pub struct InsertUntilWithin<'a> {
    mesh: &'a mut ScatterMesh,
    points: &'a [Point],
    /// In steps of z.
    tolerance: f64,
    /// Per triangle: its first point; per point: the next one of its triangle.
    heads: Vec<u32>,
    nexts: Vec<u32>,
    /// Worst point per triangle.
    worst: Vec<ScatterCandidate>,
    queue: BinaryHeap<ScatterCandidate>,
    fan: TriangleFan,
}

impl<'a> InsertUntilWithin<'a> {
    /// Assigns `points` to the triangles of `mesh`. Leaves out points at a vertex or beyond the hull, and all but the
    /// first point of a position. Fastest if neighbours in the list are close to each other.
    pub fn new(mesh: &'a mut ScatterMesh, points: &'a [Point], tolerance: f64) -> Self {
        let triangles = mesh.triangles().len();
        let mut fit = Self {
            mesh,
            points,
            tolerance,
            heads: vec![NONE; triangles],
            nexts: vec![NONE; points.len()],
            worst: vec![ScatterCandidate::NOBODY; triangles],
            queue: BinaryHeap::new(),
            fan: TriangleFan::default(),
        };
        fit.list_all();
        (0..triangles as u32).for_each(|triangle| fit.elect(triangle));
        fit
    }

    fn list_all(&mut self) {
        // Most points lie in the triangle of the one before, which is where the next walk would begin.
        let mut last: Option<(u32, TriangleSides)> = None;
        for (i, &point) in self.points.iter().enumerate() {
            let triangle = match &last {
                Some((triangle, sides)) if sides.hold(point) => *triangle,
                _ => {
                    let PointLocation::Triangle(triangle) = self.mesh.locate(point) else {
                        continue;
                    };
                    last = self.mesh.corners(triangle).map(|c| (triangle, TriangleSides::new(c)));
                    if last.is_none() {
                        continue;
                    }
                    triangle
                }
            };
            self.list(i as u32, triangle);
        }
    }

    fn list(&mut self, point: u32, triangle: u32) {
        self.nexts[point as usize] = self.heads[triangle as usize];
        self.heads[triangle as usize] = point;
    }

    /// True if a point is beyond the tolerance.
    pub fn is_open(&self) -> bool {
        !self.queue.is_empty()
    }

    /// The maximum distance of a listed point (rounded up) and the sum of squared distances, in steps.
    pub fn measure(&self) -> (f64, f64) {
        let (mut max_error, mut square_sum) = (0.0_f64, 0.0);
        for triangle in 0..self.mesh.triangles().len() as u32 {
            let Some(corners) = self.mesh.corners(triangle) else { continue };
            let plane = ScatterPlane::new(corners);
            let mut point = self.heads[triangle as usize];
            while point != NONE {
                let distance = plane.distance(self.points[point as usize]);
                square_sum += distance * distance;
                if distance + plane.doubt(distance) > max_error {
                    max_error = max_error.max(rounded_up(corners, self.points[point as usize]));
                }
                point = self.nexts[point as usize];
            }
        }
        (max_error, square_sum)
    }

    /// Inserts points until all are within the tolerance; returns the inserted points.
    pub fn run(&mut self) -> Vec<Point> {
        let mut inserted = Vec::new();
        while let Some(worst) = self.queue.pop() {
            if self.worst[worst.triangle as usize] != worst {
                continue;
            }
            let point = self.points[worst.point as usize];
            self.insert(point, worst.triangle);
            inserted.push(point);
        }
        inserted
    }

    fn insert(&mut self, point: Point, triangle: u32) {
        self.mesh.insert_at(point, triangle);
        self.heads.resize(self.mesh.triangles().len(), NONE);
        self.worst.resize(self.mesh.triangles().len(), ScatterCandidate::NOBODY);
        self.fan.turn_to(self.mesh, point);
        let removed = self.mesh.removed().iter();
        let lists = removed.map(|&id| std::mem::replace(&mut self.heads[id as usize], NONE));
        // All are taken first: new triangles use the numbers of removed ones.
        for mut number in lists.collect::<Vec<u32>>() {
            while number != NONE {
                let next = self.nexts[number as usize];
                let point = self.points[number as usize];
                if let Some(search) = self.fan.search_of(point) {
                    search.add(number, point, self.tolerance);
                    let triangle = search.worst.triangle;
                    self.list(number, triangle);
                }
                number = next;
            }
        }
        for i in 0..self.fan.spokes.len() {
            let FanEdge { triangle, search, .. } = &self.fan.spokes[i];
            let (triangle, worst) = (*triangle, search.as_ref().map(|search| search.worst));
            self.put(triangle, worst);
        }
    }

    /// Finds the worst point of a triangle.
    fn elect(&mut self, triangle: u32) {
        let worst = self.mesh.corners(triangle).map(|corners| {
            let mut search = ScatterSearch::new(triangle, corners);
            let mut number = self.heads[triangle as usize];
            while number != NONE {
                search.add(number, self.points[number as usize], self.tolerance);
                number = self.nexts[number as usize];
            }
            search.worst
        });
        self.put(triangle, worst);
    }

    /// Queues the worst point of a triangle, if any.
    fn put(&mut self, triangle: u32, worst: Option<ScatterCandidate>) {
        let worst = worst.filter(|worst| worst.point != NONE);
        self.worst[triangle as usize] = worst.unwrap_or(ScatterCandidate::NOBODY);
        self.queue.extend(worst);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scatter::mesh::tests::validate;
    use crate::scatter::search::{exceeds, offset};
    use proptest::prelude::*;
    use terrane_delaunay::orient;

    pub(in super::super) fn cloud() -> impl Strategy<Value = Vec<Point>> {
        let point = (0..60i32, 0..60i32, -50..50i32).prop_map(|(x, y, z)| Point::new(x, y, z));
        prop::collection::vec(point, 4..300).prop_map(|mut points| {
            points.sort_unstable();
            points.dedup_by_key(|p| (p.x, p.y));
            points
        })
    }

    /// A mesh of the corners of the hull, so that some points lie on its edges; none where all are on a
    /// line.
    pub(in super::super) fn hull_of(points: &[Point]) -> Option<ScatterMesh> {
        let hull = terrane_delaunay::ConvexHull::of(points.to_vec());
        let mesh = ScatterMesh::of_first(&hull.corners());
        assert_eq!(mesh.is_none(), hull.is_flat());
        let mut mesh = mesh?;
        for corner in hull.corners() {
            mesh.insert(corner);
        }
        Some(mesh)
    }

    /// The largest distance of any point from the mesh that covers it, by looking at all triangles.
    fn worst(mesh: &ScatterMesh, points: &[Point]) -> f64 {
        let all: Vec<_> =
            (0..mesh.triangles().len() as u32).filter_map(|t| mesh.corners(t)).collect();
        let at = |p: Point| [p.x, p.y];
        let covers = |[a, b, c]: &[Point; 3], p: Point| {
            [(a, b), (b, c), (c, a)].iter().all(|(a, b)| orient(at(**a), at(**b), at(p)) >= 0)
        };
        let distance = |p: &Point| {
            let covering = all.iter().filter(|t| covers(t, *p));
            covering.map(|t| ScatterPlane::new(*t).distance(*p)).fold(0.0, f64::max)
        };
        points.iter().map(distance).fold(0.0, f64::max)
    }

    /// The squares of all distances, each by the first triangle that covers the point.
    fn sum_of_squares(mesh: &ScatterMesh, points: &[Point]) -> f64 {
        let all: Vec<_> =
            (0..mesh.triangles().len() as u32).filter_map(|t| mesh.corners(t)).collect();
        let at = |p: Point| [p.x, p.y];
        let covers = |[a, b, c]: &[Point; 3], p: Point| {
            [(a, b), (b, c), (c, a)].iter().all(|(a, b)| orient(at(**a), at(**b), at(p)) >= 0)
        };
        let square = |p: &Point| {
            all.iter().find(|t| covers(t, *p)).map(|t| ScatterPlane::new(*t).distance(*p).powi(2))
        };
        points.iter().filter_map(square).sum()
    }

    proptest! {
        #[test]
        fn no_point_is_left_beyond_the_tolerance(points in cloud(), tolerance in 0..30u32) {
            let tolerance = f64::from(tolerance) + 0.25;
            let Some(mut mesh) = hull_of(&points) else { return Ok(()) };
            let before = mesh.points().len();
            let mut fit = InsertUntilWithin::new(&mut mesh, &points, tolerance);
            let is_open = fit.is_open();
            let inserted = fit.run();
            prop_assert_eq!(is_open, !inserted.is_empty());
            validate(&mesh);
            prop_assert_eq!(mesh.points().len(), before + inserted.len());
            prop_assert!(worst(&mesh, &points) <= tolerance * (1.0 + 1e-12));
            prop_assert!(!InsertUntilWithin::new(&mut mesh, &points, tolerance).is_open());
            prop_assert!(mesh.points().iter().all(|p| points.contains(p)));
        }

        /// Of each position one point counts, and is in the list of one triangle that holds it.
        #[test]
        fn every_point_is_listed_once_with_a_triangle_that_holds_it(points in cloud()) {
            let Some(mut mesh) = hull_of(&points) else { return Ok(()) };
            let mut fit = InsertUntilWithin::new(&mut mesh, &points, 0.5);
            loop {
                let mut listed = 0;
                for triangle in 0..fit.mesh.triangles().len() {
                    let mut point = fit.heads[triangle];
                    while point != NONE {
                        let corners = fit.mesh.corners(triangle as u32);
                        let [a, b, c] = corners.unwrap().map(|p| [p.x, p.y]);
                        let p = [points[point as usize].x, points[point as usize].y];
                        let sides = [orient(a, b, p), orient(b, c, p), orient(c, a, p)];
                        prop_assert!(sides.iter().all(|&side| side >= 0), "{:?} {:?}", p, [a, b, c]);
                        (listed, point) = (listed + 1, fit.nexts[point as usize]);
                    }
                }
                for triangle in 0..fit.mesh.triangles().len() as u32 {
                    let Some(corners) = fit.mesh.corners(triangle) else { continue };
                    let mut furthest = ScatterCandidate::NOBODY;
                    let mut point = fit.heads[triangle as usize];
                    while point != NONE {
                        let distance = ScatterPlane::new(corners).distance(points[point as usize]);
                        furthest = furthest.max(ScatterCandidate { distance, point, triangle });
                        point = fit.nexts[point as usize];
                    }
                    let is_open = furthest.point != NONE && exceeds(corners, points[furthest.point as usize], 0.5);
                    let expected = if is_open { furthest } else { ScatterCandidate::NOBODY };
                    prop_assert_eq!(fit.worst[triangle as usize], expected);
                }
                prop_assert_eq!(listed + fit.mesh.points().len(), points.len());
                let Some(worst) = fit.queue.pop() else { break };
                if fit.worst[worst.triangle as usize] == worst {
                    fit.insert(points[worst.point as usize], worst.triangle);
                }
            }
        }

        #[test]
        fn what_is_measured_is_what_is_left(points in cloud(), tolerance in 0..30u32) {
            let Some(mut mesh) = hull_of(&points) else { return Ok(()) };
            InsertUntilWithin::new(&mut mesh, &points, tolerance.into()).run();
            let expected = worst(&mesh, &points);
            let (most, squares) = InsertUntilWithin::new(&mut mesh, &points, tolerance.into()).measure();
            prop_assert!((most - expected).abs() <= 1e-9 * (1.0 + expected), "{} {}", most, expected);
            prop_assert!((squares - sum_of_squares(&mesh, &points)).abs() <= 1e-6 * (1.0 + squares));
        }

    }

    #[test]
    fn distances_exceed_the_number_before_them_and_are_never_too_small() {
        let corners = [[0, 0], [90, 0], [0, 90]].map(|[x, y]| Point::new(x, y, 0));
        let points = [Point::new(20, 20, 7)];
        let mut mesh = ScatterMesh::new(corners).unwrap();
        assert!(InsertUntilWithin::new(&mut mesh, &points, 7.0_f64.next_down()).is_open());
        for (z, x) in (1..40).flat_map(|z| (1..40).map(move |x| (z, x))) {
            let corners = [[0, 0, 0], [61, 0, z], [0, 59, 3]].map(|[x, y, z]| Point::new(x, y, z));
            let point = Point::new(x, 7, 100);
            let [off, area] = offset(corners, point);
            // A number below 128 is a whole one of 2^-52, at least where it is above 1.
            let found = rounded_up(corners, point);
            let whole = (found * (1_u64 << 52) as f64) as i128;
            assert!(whole * area.abs() >= off.abs() << 52, "{z} {x}");
            assert!(found <= off.abs() as f64 / area.abs() as f64 * (1.0 + 8.0 * f64::EPSILON));
        }
    }

    #[test]
    fn points_as_far_as_the_tolerance_are_left_out() {
        let corners = [[0, 0], [90, 0], [0, 90]].map(|[x, y]| Point::new(x, y, 0));
        for far in [7, -7] {
            let points = [[20, 20, far], [40, 13, far - 1], [0, 45, 0]];
            let points = points.map(|[x, y, z]| Point::new(x, y, z));
            let open = |tolerance: f64| {
                let mut mesh = ScatterMesh::new(corners).unwrap();
                InsertUntilWithin::new(&mut mesh, &points, tolerance).run().len()
            };
            let furthest = f64::from(points[0].z.abs().max(points[1].z.abs()));
            assert_eq!((open(furthest), open(furthest.next_down() - 0.001) > 0), (0, true));
        }
    }
}
