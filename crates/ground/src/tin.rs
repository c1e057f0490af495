//! A triangulation that is made denser.

use terrane_base::geom::Point;
use terrane_delaunay::{Triangulation, orient};

/// The triangulation of ground points, which lie in millimetres from the window's corner.
pub(crate) struct Tin<'a> {
    points: &'a [Point],
    triangulation: Triangulation,
    /// Where the last one was found.
    last: u32,
}

impl<'a> Tin<'a> {
    /// `None` where there are too few points for a triangle.
    pub(crate) fn new(points: &'a [Point]) -> Option<Self> {
        let triangulation = Triangulation::new(points).ok()?;
        let last = (0..triangulation.numbers()).find(|&t| triangulation.corners(t).is_some())?;
        Some(Self { points, triangulation, last })
    }

    /// The number and the corners of the triangle that holds a position, which must lie in the hull: a
    /// walk from the one found before.
    pub(crate) fn around(&mut self, at: [i32; 2]) -> Option<(u32, [Point; 3])> {
        let mut triangle = self.last;
        for _ in 0..=self.triangulation.numbers() {
            let corners = self.triangulation.corners(triangle)?.map(|k| self.points[k as usize]);
            let site = corners.map(|p| [p.x, p.y]);
            let beyond = (0..3).find(|&i| orient(site[i], site[(i + 1) % 3], at) < 0);
            let Some(side) = beyond else {
                self.last = triangle;
                return Some((triangle, corners));
            };
            triangle = self.triangulation.neighbours(triangle)[side];
        }
        None
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
