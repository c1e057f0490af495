//! Exact predicates: area, in-circle, and the distance of a height from a triangle's plane against the
//! tolerance.

use std::ops::{Add, Mul, Sub};

use super::expansion::ProofExpansion;
use super::sections::is_whole;
use super::triangle::{ProofPosition, ProofTriangle};

/// Twice the signed area of (a, b, c) in 2^-60 cell, exact: coordinates are at most 2^61, so
/// differences fit `i64`, and products of them are at most 2^124.
pub(crate) fn double_area(a: ProofPosition, b: ProofPosition, c: ProofPosition) -> i128 {
    let [u, v] = [b, c].map(|p| [p.col - a.col, p.row - a.row].map(i128::from));
    u[0] * v[1] - u[1] * v[0]
}

impl ProofTriangle {
    /// Twice the signed area, in 2^-60 cell; positive when counter-clockwise in (column, row).
    pub fn double_area(&self) -> i128 {
        let [a, b, c] = self.positions();
        double_area(a, b, c)
    }
}

/// True when `d` is strictly inside the circle through (a, b, c), of either orientation. Exact for
/// samples; for other positions in `f64`, true only when beyond rounding error.
pub(crate) fn in_circle(
    a: ProofPosition,
    b: ProofPosition,
    c: ProofPosition,
    d: ProofPosition,
) -> bool {
    let sign = double_area(a, b, c).signum();
    let offsets = [a, b, c].map(|p| [p.col - d.col, p.row - d.row]);
    let mix = offsets.iter().flatten().fold(0, |all, v| all | v);
    let max = offsets.iter().flatten().fold(0, |max, v| v.abs().max(max));
    if !is_whole(mix) || max >> ProofPosition::FRACTION >= 1 << 30 {
        return rough_in_circle(offsets, sign);
    }
    let cells = offsets.map(|o| o.map(|v| v >> ProofPosition::FRACTION));
    if max >> ProofPosition::FRACTION < 1 << 13 {
        i128::from(determinant(cells)) * sign > 0
    } else {
        determinant(cells.map(|o| o.map(i128::from))) * sign > 0
    }
}

/// The in-circle determinant of three offsets from the fourth point: each below 2^13 in `i64`, below 2^30 in `i128`,
/// where it is below 3 * 2^123.
fn determinant<N: Copy + Add<Output = N> + Sub<Output = N> + Mul<Output = N>>(o: [[N; 2]; 3]) -> N {
    let [[ax, ay], [bx, by], [cx, cy]] = o;
    (ax * ax + ay * ay) * (bx * cy - by * cx)
        + (bx * bx + by * by) * (cx * ay - cy * ax)
        + (cx * cx + cy * cy) * (ax * by - ay * bx)
}

/// The same in `f64`, positive only beyond any doubt from rounding. The sum of the absolute
/// products times 2^-48 is far above the error of some ten roundings of 2^-53.
fn rough_in_circle(offsets: [[i64; 2]; 3], sign: i128) -> bool {
    let o = offsets.map(|o| o.map(|v| v as f64 / ProofPosition::CELL as f64));
    let lift = o.map(|[x, y]| x * x + y * y);
    let (mut sum, mut doubt) = (0.0, 0.0);
    for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let (left, right) = (o[j][0] * o[k][1], o[j][1] * o[k][0]);
        sum += lift[i] * (left - right);
        doubt += lift[i] * (left.abs() + right.abs());
    }
    sum * sign as f64 > doubt * 2f64.powi(-48)
}

/// True when `height` at `at` is more than `tolerance` above or below the plane of `triangle`
/// (of non-zero area): exact, with closed <=. Numbers so large that products overflow exceed.
pub(crate) fn exceeds(
    triangle: &ProofTriangle,
    at: ProofPosition,
    height: f64,
    tolerance: f64,
) -> bool {
    let [a, b, c] = triangle.positions();
    let area = double_area(a, b, c);
    let sign = area.signum();
    let weights = [double_area(at, b, c), double_area(a, at, c), double_area(a, b, at)];
    let [p, q, r] = [0, 1, 2].map(|i| (-sign * weights[i], triangle.corners[i].z));
    is_beyond(&[(sign * area, height), p, q, r], sign * area, tolerance)
}

/// True when a sum of weighted values is further from 0 than `total` (above 0) tolerances: exact.
fn is_beyond(terms: &[(i128, f64)], total: i128, tolerance: f64) -> bool {
    [1, -1].into_iter().any(|side| {
        let mut sum = ProofExpansion::default();
        sum.add_product(-total, tolerance);
        terms.iter().for_each(|&(weight, value)| sum.add_product(side * weight, value));
        sum.is_positive_or_overflown()
    })
}

/// A height on the straight line between two: the second has the weight `part`, the first the rest of the total.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InterpolatedHeight {
    /// The two heights.
    pub(crate) ends: [f64; 2],
    /// The weight of the second.
    pub(crate) part: i128,
}

impl InterpolatedHeight {
    /// True when two heights are more than `tolerance` apart, with weights that sum up to `total`: exact, as [`exceeds`].
    pub(crate) fn is_far(self, other: Self, total: i128, tolerance: f64) -> bool {
        let ([a, b], [c, d]) = (self.terms(total, 1), other.terms(total, -1));
        is_beyond(&[a, b, c, d], total, tolerance)
    }

    /// Weights and values of the two ends; `side` is the sign.
    fn terms(self, total: i128, side: i128) -> [(i128, f64); 2] {
        let Self { ends: [a, b], part } = self;
        [(side * (total - part), a), (side * part, b)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle::ProofVertex;
    use proptest::prelude::*;

    fn vertex(col: i64, row: i64, z: f64) -> ProofVertex {
        ProofVertex { at: ProofPosition::sample(col, row), z }
    }

    #[test]
    fn a_height_at_the_tolerance_is_within_and_the_next_float_is_not() {
        // Plane z = x / 3: at (1, 0) the error against 1 is exactly 2/3, which no float is.
        let t =
            ProofTriangle { corners: [vertex(0, 0, 0.0), vertex(3, 0, 1.0), vertex(0, 1, 0.0)] };
        let at = ProofPosition::sample(1, 0);
        let below = 2.0 / 3.0; // rounds down
        assert!(exceeds(&t, at, 1.0, below));
        assert!(!exceeds(&t, at, 1.0, f64::next_up(below)));
        assert!(!exceeds(&t, ProofPosition::sample(0, 0), 0.5, 0.5));
        assert!(exceeds(&t, ProofPosition::sample(0, 0), -0.5f64.next_up(), 0.5));
        assert!(exceeds(&t, at, 1e308, 1e300));
    }

    #[test]
    fn orientation_does_not_matter() {
        let t =
            ProofTriangle { corners: [vertex(0, 0, 0.0), vertex(0, 1, 0.0), vertex(3, 0, 1.0)] };
        assert!(exceeds(&t, ProofPosition::sample(1, 0), 1.0, 2.0 / 3.0));
        assert!(!exceeds(&t, ProofPosition::sample(1, 0), 1.0, 0.7));
    }

    proptest! {
        #[test]
        fn exceeds_agrees_with_integers(
            points in prop::array::uniform3([-40i64..40, -40i64..40, -500i64..500]),
            at in [-40i64..40, -40i64..40], height in -500i64..500, tolerance in 0i64..300,
        ) {
            let corners = points.map(|[c, r, z]| vertex(c, r, z as f64 / 8.0));
            let triangle = ProofTriangle { corners };
            let [a, b, c] = points;
            let cross = |p: [i64; 2], q: [i64; 2], s: [i64; 2]| {
                (q[0] - p[0]) * (s[1] - p[1]) - (q[1] - p[1]) * (s[0] - p[0])
            };
            let [pa, pb, pc] = [a, b, c].map(|p| [p[0], p[1]]);
            let area = cross(pa, pb, pc);
            prop_assume!(area != 0);
            let plane = cross(at, pb, pc) * a[2] + cross(pa, at, pc) * b[2] + cross(pa, pb, at) * c[2];
            let expected = (area * height - plane).abs() > area.abs() * tolerance;
            let at = ProofPosition::sample(at[0], at[1]);
            let got = exceeds(&triangle, at, height as f64 / 8.0, tolerance as f64 / 8.0);
            prop_assert_eq!(got, expected);
        }

        #[test]
        fn in_circle_paths_agree(points in prop::array::uniform4([-3000i64..3000, -3000i64..3000])) {
            let p = points.map(|[c, r]| ProofPosition::sample(c, r));
            let offsets = [0, 1, 2].map(|i| [points[i][0] - points[3][0], points[i][1] - points[3][1]]);
            let det = determinant(offsets.map(|o| o.map(i128::from)));
            let sign = double_area(p[0], p[1], p[2]).signum();
            prop_assert_eq!(in_circle(p[0], p[1], p[2], p[3]), det * sign > 0);
            prop_assert_eq!(in_circle(p[0], p[2], p[1], p[3]), det * sign > 0);
            let fixed = offsets.map(|o| o.map(|v| v << ProofPosition::FRACTION));
            prop_assert_eq!(rough_in_circle(fixed, sign), det * sign > 0);
        }
    }
}
