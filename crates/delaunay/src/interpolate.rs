//! The height of a triangle's plane at a position.

use super::position::FixedPosition;
use terrane_base::geom::Point;

/// Height in steps, at `q`, of the plane through three points that are not collinear in (x, y). The
/// weights are exact before they are rounded to f64 once each, so the result depends on the order of
/// the corners only by rounding; corners from [`super::TriangleFinder`] come in one order. At a corner the
/// result is its z.
pub fn interpolate(corners: &[Point; 3], q: FixedPosition) -> f64 {
    let [a, b, c] = corners.map(|p| q.to([p.x, p.y]));
    let z = corners.map(|p| f64::from(p.z));
    if let Some(corner) = [a, b, c].iter().position(|arm| arm.is_zero()) {
        return z[corner];
    }
    let weights = [b.cross(c), c.cross(a), a.cross(b)];
    let total = float(weights.iter().sum());
    // Differences to one corner: a level triangle has its height without any rounding.
    let [rise_b, rise_c] = [1, 2].map(|i| float(weights[i]) * (z[i] - z[0]));
    z[0] + (rise_b + rise_c) / total
}

/// Most weights fit into 64 bits, which convert much faster.
#[inline(always)]
pub(super) fn float(weight: i128) -> f64 {
    i64::try_from(weight).map_or(weight as f64, |weight| weight as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_reproduced_and_corners_exact() {
        let height = |x: i32, y: i32| 3 * x - 2 * y + 7;
        let corners = [[0, 0], [90, 10], [20, 70]].map(|[x, y]| Point::new(x, y, height(x, y)));
        for (x, y) in [(30.5, 20.25), (1.0, 1.0), (50.0, 40.0)] {
            let found = interpolate(&corners, FixedPosition::from_steps(x, y));
            assert!((found - (3.0 * x - 2.0 * y + 7.0)).abs() < 1e-9, "{found}");
        }
        for p in corners {
            assert_eq!(interpolate(&corners, FixedPosition::of([p.x, p.y])), f64::from(p.z));
        }
    }

    #[test]
    fn the_largest_triangles_do_not_overflow() {
        let r = terrane_base::geom::REACH;
        let corners = [Point::new(-r, -r, -r), Point::new(r, -r, r), Point::new(-r, r, r)];
        let found = interpolate(&corners, FixedPosition::from_steps(0.0, -f64::from(r)));
        assert!(found.abs() < 1e-3, "{found}");
    }
}
