//! Culling data of a tile: bounding sphere and horizon occlusion point.

use crate::globe::{EQUATOR, POLE, Vector};

/// Relative margin of a radius for rounding.
const SLACK: f64 = 1e-12;
/// Distance of the occlusion point of an always visible tile, in radii of the earth.
const ALWAYS: f64 = 1e6;

/// Centre of the bounding box of points, and the largest distance from it.
pub(crate) fn sphere(points: &[Vector]) -> (Vector, f64) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for Vector(point) in points {
        for axis in 0..3 {
            (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
        }
    }
    let centre = (Vector(low) + Vector(high)) * 0.5;
    let radius = points.iter().map(|p| (*p - centre).length()).fold(0.0, f64::max);
    (centre, radius + EQUATOR * SLACK)
}

/// Point above the centre of a tile that is hidden by the earth only if all points are, in radii of the
/// ellipsoid. If the lowest height is below the ellipsoid, some clients shrink the ellipsoid accordingly: the
/// point is below the horizon of both.
///
/// A point at distance `m` is hidden where the line from the eye to it touches the unit sphere at an angle of
/// acos(1 / m) from it or later; so what lies over the middle must be as far out as that line is there.
pub(crate) fn occlusion(centre: Vector, points: &[Vector], lowest: f64) -> Vector {
    let below = lowest.min(0.0);
    let towards = in_radii(centre, below).unit();
    let both = points.iter().flat_map(|point| [below, 0.0].map(|by| in_radii(*point, by)));
    let distances = both.map(|point| occlusion_distance(point, towards));
    towards * distances.fold(1.0, f64::max)
}

/// A point in radii of the ellipsoid, of one this many metres larger.
fn in_radii(Vector([x, y, z]): Vector, below: f64) -> Vector {
    Vector([x / (EQUATOR + below), y / (EQUATOR + below), z / (POLE + below)])
}

/// Distance of the point in a direction that is hidden only if `point` is, in radii.
fn occlusion_distance(point: Vector, towards: Vector) -> f64 {
    let length = point.length().max(1.0);
    let direction = point.unit();
    // By the cross product: from the cosine, the sine of a small angle would lose its digits.
    let [cos, sin] = [direction.dot(towards), direction.cross(towards).length()];
    let (near, far) = (1.0 / length, (length * length - 1.0).sqrt() / length);
    let down = cos * near - sin * far;
    // There is no such point beyond a quarter of the earth.
    if down > 1.0 / ALWAYS { 1.0 / down } else { ALWAYS }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::globe::EllipsoidNormal;

    /// Whether a point, in radii, is hidden from an eye, in radii: Ring 2013, "Horizon Culling".
    fn is_hidden(eye: Vector, point: Vector) -> bool {
        let limb = eye.dot(eye) - 1.0;
        let to = point - eye;
        let along = -to.dot(eye);
        along > limb && along * along / to.dot(to) > limb
    }

    #[test]
    fn where_the_occlusion_point_is_hidden_all_of_the_tile_is() {
        for (size, heights) in
            [(0.1, [-400.0, -100.0]), (2.0, [-50.0, 4000.0]), (20.0, [0.0, 9000.0])]
        {
            let at = |i: i32, j: i32| {
                [7.0 + f64::from(i) * size / 4.0, 46.0 + f64::from(j) * size / 4.0]
            };
            let height = |i: i32, j: i32| heights[((i * 7 + j * 3) % 2) as usize];
            let places = (0..5).flat_map(|i| (0..5).map(move |j| (i, j)));
            let points: Vec<Vector> =
                places.map(|(i, j)| EllipsoidNormal::at(at(i, j)).point(height(i, j))).collect();
            let (centre, radius) = sphere(&points);
            assert!(points.iter().all(|p| (*p - centre).length() <= radius));
            let occlusion = occlusion(centre, &points, heights[0]);
            let below = heights[0].min(0.0);
            let scaled = |p: Vector| {
                Vector([
                    p.0[0] / (EQUATOR + below),
                    p.0[1] / (EQUATOR + below),
                    p.0[2] / (POLE + below),
                ])
            };
            let mut hidden = 0;
            for lon in (-180..180).step_by(5) {
                for (lat, high) in
                    (-90..=90).step_by(5).flat_map(|l| [(l, 2e3), (l, 3e5), (l, 2e7)])
                {
                    let eye =
                        scaled(EllipsoidNormal::at([f64::from(lon), f64::from(lat)]).point(high));
                    if is_hidden(eye, occlusion) {
                        hidden += 1;
                        // Points below the shrunk ellipsoid count as on it.
                        let on = |p: &Vector| {
                            let p = scaled(*p);
                            if p.length() < 1.0 { p.unit() } else { p }
                        };
                        assert!(points.iter().all(|p| is_hidden(eye, on(p))), "{lon} {lat} {high}");
                    }
                }
            }
            assert!(hidden > 100, "{hidden}");
        }
    }

    #[test]
    fn half_the_globe_can_always_be_seen() {
        let corners = [[-180.0, -90.0], [0.0, -90.0], [-90.0, 0.0], [0.0, 90.0], [-180.0, 0.0]];
        let points = corners.map(|place| EllipsoidNormal::at(place).point(0.0));
        let (centre, _) = sphere(&points);
        let found = occlusion(centre, &points, 0.0);
        assert!(found.0.iter().all(|x| x.is_finite()) && found.length() > 1e3);
    }
}
