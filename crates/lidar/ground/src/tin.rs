//! An incremental triangulation.

use terrane_base::geom::Point;
use terrane_delaunay::Triangulation;

/// A triangulation of points in millimetres from the window's corner.
pub(crate) struct GroundTin {
    points: Vec<Point>,
    triangulation: Triangulation,
}

impl GroundTin {
    /// The triangulation of points at distinct positions; `None` if there are too few for a triangle. Reserves
    /// memory for `more`.
    pub(crate) fn new(mut points: Vec<Point>, more: usize) -> Option<Self> {
        let mut triangulation = Triangulation::new(&points).ok()?;
        points.reserve_exact(more);
        triangulation.reserve(more);
        let tin = Self { points, triangulation };
        (!tin.triangulation.is_flat()).then_some(tin)
    }

    /// Upper bound of the numbers of triangles.
    pub(crate) fn numbers(&self) -> usize {
        self.triangulation.numbers() as usize
    }

    /// The points in the order in which they came, whose heights may be changed.
    pub(crate) fn points(&mut self) -> &mut [Point] {
        &mut self.points
    }

    /// The triangle that holds a position, on a walk from another one; `None` beyond all.
    pub(crate) fn find(&self, at: [i32; 2], from: u32) -> Option<u32> {
        self.triangulation.find(at, from)
    }

    /// Which points are the corners of a triangle.
    pub(crate) fn ids(&self, triangle: u32) -> Option<[u32; 3]> {
        self.triangulation.corners(triangle)
    }

    /// The corners of a triangle, from the lowest (x, then y) on: what is computed of them is the same to the
    /// last bit however the triangulation came to be.
    pub(crate) fn corners(&self, triangle: u32) -> Option<[Point; 3]> {
        Some(from_lowest(self.ids(triangle)?.map(|id| self.points[id as usize])))
    }

    /// Adds a point in or near a triangle; returns the numbers of the changed triangles.
    pub(crate) fn add(&mut self, point: Point, near: u32, changed: &mut impl FnMut(u32)) {
        let at = [point.x, point.y];
        let Some(triangle) = self.find(at, near) else { return };
        if self.triangulation.insert(at, self.points.len() as u32, triangle, changed) {
            self.points.push(point);
        }
    }
}

fn from_lowest([a, b, c]: [Point; 3]) -> [Point; 3] {
    match a.min(b).min(c) {
        low if low == a => [a, b, c],
        low if low == b => [b, c, a],
        _ => [c, a, b],
    }
}

/// Heights above the plane of three points: straight up.
pub(crate) fn height_of(corners: &[Point; 3], at: [f64; 2]) -> f64 {
    let [a, b, c] = corners.map(|p| [f64::from(p.x), f64::from(p.y), f64::from(p.z)]);
    let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    let [gx, gy] = gradient(u, v);
    a[2] + gx * (at[0] - a[0]) + gy * (at[1] - a[1])
}

/// Rise by run east and north of the plane through two arms.
pub(crate) fn gradient(u: [f64; 3], v: [f64; 3]) -> [f64; 2] {
    let area = u[0] * v[1] - u[1] * v[0];
    [(u[2] * v[1] - v[2] * u[1]) / area, (u[0] * v[2] - v[0] * u[2]) / area]
}
