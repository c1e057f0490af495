//! The point of a triangle with the maximum distance from its plane, if beyond the tolerance.

use std::cmp::Ordering;

use super::mesh::NONE;
use terrane_base::geom::Point;

/// A triangle's point with the largest distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScatterCandidate {
    pub(super) distance: f64,
    pub(super) point: u32,
    pub(super) triangle: u32,
}

impl ScatterCandidate {
    pub(super) const NOBODY: Self = Self { distance: -1.0, point: NONE, triangle: NONE };
}

impl Eq for ScatterCandidate {}

impl Ord for ScatterCandidate {
    /// The largest distance first, then the lowest point.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_distance = self.distance.total_cmp(&other.distance);
        by_distance
            .then_with(|| other.point.cmp(&self.point).then(self.triangle.cmp(&other.triangle)))
    }
}

impl PartialOrd for ScatterCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The search for a triangle's candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScatterSearch {
    pub(super) corners: [Point; 3],
    plane: ScatterPlane,
    /// Worst point so far.
    pub(super) worst: ScatterCandidate,
}

impl ScatterSearch {
    pub(super) fn new(triangle: u32, corners: [Point; 3]) -> Self {
        let worst = ScatterCandidate { triangle, ..ScatterCandidate::NOBODY };
        Self { corners, plane: ScatterPlane::new(corners), worst }
    }

    /// Tests a point of the triangle; it counts if it is beyond the tolerance.
    #[inline(always)]
    pub(super) fn add(&mut self, number: u32, point: Point, tolerance: f64) {
        let distance = self.plane.distance(point);
        let doubt = self.plane.doubt(distance);
        // Few points are as far off as the worst so far.
        if distance < self.worst.distance || distance <= tolerance - doubt {
            return;
        }
        let candidate = ScatterCandidate { distance, point: number, ..self.worst };
        if candidate > self.worst {
            let is_beyond = distance > tolerance + doubt || exceeds(self.corners, point, tolerance);
            self.worst = if is_beyond { candidate } else { self.worst };
        }
    }
}

/// The plane through a triangle's corners, for distances in `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScatterPlane {
    origin: [f64; 3],
    slope: [f64; 2],
    /// Bound on the relative error of a distance, with the magnitude of its terms.
    reach: f64,
}

impl ScatterPlane {
    pub(super) fn new([a, b, c]: [Point; 3]) -> Self {
        let ([bx, by, bz], [cx, cy, cz]) = (from(a, b), from(a, c));
        let area = (bx * cy - by * cx) as f64;
        let slope = [(bz * cy - by * cz) as f64 / area, (bx * cz - bz * cx) as f64 / area];
        let [reach_b, reach_c] = [[bx, by, bz], [cx, cy, cz]].map(|d| {
            slope[0].abs() * d[0].abs() as f64
                + slope[1].abs() * d[1].abs() as f64
                + d[2].abs() as f64
        });
        Self { origin: floats(a), slope, reach: reach_b.max(reach_c) }
    }

    /// Vertical distance of a point, in steps.
    #[inline]
    pub(super) fn distance(&self, point: Point) -> f64 {
        let point = floats(point);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| point[i] - self.origin[i]);
        (z - self.slope[0] * x - self.slope[1] * y).abs()
    }

    /// Bound on the rounding of `distance`: five operations on terms no larger than those at the
    /// corners (the point lies between them) and the distance itself.
    #[inline]
    pub(super) fn doubt(&self, distance: f64) -> f64 {
        16.0 * f64::EPSILON * (self.reach + distance)
    }
}

#[inline(always)]
fn floats(point: Point) -> [f64; 3] {
    [point.x, point.y, point.z].map(f64::from)
}

pub(super) fn from(a: Point, b: Point) -> [i64; 3] {
    [
        i64::from(b.x) - i64::from(a.x),
        i64::from(b.y) - i64::from(a.y),
        i64::from(b.z) - i64::from(a.z),
    ]
}

/// True if the distance of a point from its triangle exceeds `tolerance` steps. Exact: compares an integer sum of
/// products with the tolerance times twice the area.
pub fn exceeds(corners: [Point; 3], point: Point, tolerance: f64) -> bool {
    let [off, area] = offset(corners, point);
    // Whole part and fraction of the tolerance, the latter in 2^-24, which f64 below 2^29 resolves
    // exactly or is finer than any step matters: both sides stay below 2^126.
    let integer = tolerance.floor();
    let fraction = ((tolerance - integer) * f64::from(1 << 24)).floor() as i128;
    let allowed = area * integer as i128 * (1 << 24) + area * fraction;
    off.abs() * (1 << 24) > allowed.abs()
}

/// Vertical distance of a point from the plane of a triangle, in steps, as a fraction: the numerator is signed, the
/// denominator is twice the area.
pub(super) fn offset([a, b, c]: [Point; 3], point: Point) -> [i128; 2] {
    let ([bx, by, bz], [cx, cy, cz]) = (from(a, b).map(i128::from), from(a, c).map(i128::from));
    let [x, y, z] = from(a, point).map(i128::from);
    let area = bx * cy - by * cx;
    [z * area - x * (bz * cy - by * cz) - y * (bx * cz - bz * cx), area]
}

/// A distance rounded up: not below the exact one, and above it by at most a few roundings.
pub(super) fn rounded_up(corners: [Point; 3], point: Point) -> f64 {
    let [off, area] = offset(corners, point);
    (off as f64 / area as f64).abs() * (1.0 + 4.0 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_delaunay::orient;

    proptest! {
        /// Distances in floating point are doubted by more than they are off, and by little.
        #[test]
        fn doubt_covers_the_rounding_of_distances(
            c in prop::array::uniform3((-9000..9000i32, -9000..9000i32, -9000..9000i32)),
            w in prop::array::uniform3(0..50i64), off in -40..40i32
        ) {
            let corners = c.map(|(x, y, z)| Point::new(x, y, z));
            let [a, b, c] = corners;
            let area = orient([a.x, a.y], [b.x, b.y], [c.x, c.y]);
            let total: i64 = w.iter().sum();
            prop_assume!(area != 0 && total > 0);
            let mix = |f: fn(Point) -> i32| {
                (0..3).map(|i| w[i] * i64::from(f(corners[i]))).sum::<i64>() / total
            };
            let point = Point::new(mix(|p| p.x) as i32, mix(|p| p.y) as i32, mix(|p| p.z) as i32 + off);
            let plane = ScatterPlane::new(corners);
            let found = plane.distance(point);
            let [off, double] = offset(corners, point);
            prop_assert_eq!(double.abs(), i128::from(area.abs()));
            // How far the fraction is from what was found, times the area, in 2^-40 steps.
            let scaled = (found * (1u64 << 40) as f64).round() as i128 * double.abs();
            let error = (scaled - (off.abs() << 40)).abs() as f64 / double.abs() as f64 / (1u64 << 40) as f64;
            prop_assert!(error <= plane.doubt(found) + 1e-12);
            // The steepest slopes reach over the sides of the triangle.
            let rise = |axis: fn(Point) -> i32, slope: f64| {
                let far = |p: Point| f64::from((axis(p) - axis(a)).abs());
                slope.abs() * far(b).max(far(c))
            };
            let least = rise(|p| p.x, plane.slope[0]).max(rise(|p| p.y, plane.slope[1]));
            let heights = f64::from((b.z - a.z).abs().max((c.z - a.z).abs()));
            let most = rise(|p| p.x, plane.slope[0]) + rise(|p| p.y, plane.slope[1]) + heights + found;
            let unit = 16.0 * f64::EPSILON;
            let doubt = plane.doubt(found);
            prop_assert!(doubt >= 0.999 * unit * (least.max(heights) + found) && doubt <= 1.001 * unit * most);
            // Of what is far off, the distance itself is rounded most.
            let far = 1e6 + 1e3 * most;
            prop_assert!((plane.doubt(far) - doubt - unit * (far - found)).abs() <= 1e-9 * unit * far);
        }

        #[test]
        fn the_exact_decision_agrees_with_fractions(
            c in prop::array::uniform3((-1000..1000i32, -1000..1000i32, -1000..1000i32)),
            w in prop::array::uniform3(0..50i64), off in -40..40i32, tolerance in 0..2560u32
        ) {
            let corners = c.map(|(x, y, z)| Point::new(x * 50, y * 50, z));
            let total: i64 = w.iter().sum();
            prop_assume!(total > 0);
            let mix = |f: fn(Point) -> i32| {
                (0..3).map(|i| w[i] * i64::from(f(corners[i]))).sum::<i64>() / total
            };
            let point = Point::new(mix(|p| p.x) as i32, mix(|p| p.y) as i32, mix(|p| p.z) as i32 + off);
            let [a, b, c] = corners;
            prop_assume!(orient([a.x, a.y], [b.x, b.y], [c.x, c.y]) != 0);
            let tolerance = f64::from(tolerance) / 64.0;
            let distance = ScatterPlane::new(corners).distance(point);
            if (distance - tolerance).abs() > 1e-6 {
                prop_assert_eq!(exceeds(corners, point, tolerance), distance > tolerance);
            }
        }
    }

    #[test]
    fn a_distance_equal_to_the_tolerance_is_within() {
        let corners = [Point::new(0, 0, 0), Point::new(9, 0, 0), Point::new(0, 9, 0)];
        assert!(!exceeds(corners, Point::new(3, 3, 7), 7.0));
        assert!(exceeds(corners, Point::new(3, 3, 7), 7.0 - 1e-3));
    }
}
