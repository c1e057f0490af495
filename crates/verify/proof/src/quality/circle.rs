//! The local Delaunay test of an edge: the in-circle test, exact, or within the rounding of positions.
//!
//! Positions are whole numbers here, so the determinant is one of 239 bits. It is computed in floats
//! first, and exactly only where their rounding, or that of the positions, leaves a doubt.

use crate::ProofPosition;
use crate::exact::double_area;

/// Delaunay test of the two triangles of an edge, in plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelaunayVerdict {
    /// The opposite corner of each is outside the circle through the other.
    Delaunay,
    /// All four corners are on one circle within the rounding of their positions. Both diagonals are Delaunay.
    Cocircular,
    /// The opposite corner of each is inside the circle through the other.
    NotDelaunay,
    /// They are not on opposite sides of the edge, or one has no area.
    Folded,
}

impl DelaunayVerdict {
    /// Judges the edge between `ends` by the corners opposite to it. Every position may be off by
    /// `rounding` (column, row), in steps of positions; with 0 the test is exact. Ends and apexes may be
    /// in any order. Positions less than 2^59 steps apart.
    pub fn of(ends: [ProofPosition; 2], apexes: [ProofPosition; 2], rounding: [f64; 2]) -> Self {
        let [[p, q], [low, high]] = [ends, apexes].map(|[a, b]| [a.min(b), a.max(b)]);
        let [turn, other] = [low, high].map(|apex| double_area(p, q, apex).signum());
        if turn * other >= 0 {
            return Self::Folded;
        }
        let offsets = [p, q, low].map(|c| [c.col - high.col, c.row - high.row]);
        let RoughDeterminant { det, doubt, slack } = RoughDeterminant::of(offsets, rounding);
        let det = if det.abs() > slack + doubt { det } else { determinant(offsets) };
        match det * turn as f64 {
            inside if inside > slack => Self::NotDelaunay,
            inside if inside < -slack => Self::Delaunay,
            _ => Self::Cocircular,
        }
    }
}

/// The in-circle determinant of three offsets from the fourth corner, in floats.
struct RoughDeterminant {
    det: f64,
    /// Bound on its error from the rounding of floats.
    doubt: f64,
    /// By how much the rounding of positions may change it, to the first order.
    slack: f64,
}

impl RoughDeterminant {
    fn of(offsets: [[i64; 2]; 3], [across, down]: [f64; 2]) -> Self {
        let o = offsets.map(|o| o.map(|v| v as f64));
        let lift = o.map(|[x, y]| x * x + y * y);
        let (mut det, mut size, mut slack) = (0.0, 0.0, 0.0);
        let mut fourth = [0.0; 2];
        for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let (left, right) = (o[j][0] * o[k][1], o[j][1] * o[k][0]);
            det += lift[i] * (left - right);
            size += lift[i] * (left.abs() + right.abs());
            // What the determinant changes by with x and y of offset i.
            let per_x = 2.0 * o[i][0] * (left - right) + lift[k] * o[j][1] - lift[j] * o[k][1];
            let per_y = 2.0 * o[i][1] * (left - right) + lift[j] * o[k][0] - lift[k] * o[j][0];
            slack += across * per_x.abs() + down * per_y.abs();
            fourth = [fourth[0] + per_x, fourth[1] + per_y];
        }
        slack += across * fourth[0].abs() + down * fourth[1].abs();
        // Far above the error of some ten roundings of 2^-53.
        Self { det, doubt: size * 2f64.powi(-48), slack }
    }
}

/// Bits of a digit of the exact determinant.
const DIGIT: u32 = 60;

/// The same determinant, rounded once: of the right sign, and 0 only where it is 0. Offsets are below
/// 2^59, so squares and cross products are below 2^119, and each sum of products of digits below 2^124.
fn determinant(o: [[i64; 2]; 3]) -> f64 {
    let o = o.map(|o| o.map(i128::from));
    let mut digits = [0i128; 3];
    for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let lift = o[i][0] * o[i][0] + o[i][1] * o[i][1];
        let cross = o[j][0] * o[k][1] - o[j][1] * o[k][0];
        let (a, b) = (halves(lift), halves(cross));
        digits[0] += a[0] * b[0];
        digits[1] += a[0] * b[1] + a[1] * b[0];
        digits[2] += a[1] * b[1];
    }
    let [low, middle, high] = normalized(digits);
    if high >= 0 {
        return float([low, middle, high]);
    }
    // Floats of the digits of a negative number would cancel.
    -float(normalized(digits.map(|digit| -digit)))
}

/// A number as two digits, the lower first and not negative.
fn halves(value: i128) -> [i128; 2] {
    [value & ((1 << DIGIT) - 1), value >> DIGIT]
}

/// The same number with all digits but the last between 0 and 2^60.
fn normalized([low, middle, high]: [i128; 3]) -> [i128; 3] {
    let [low, carry] = halves(low);
    let [middle, carry] = halves(middle + carry);
    [low, middle, high + carry]
}

fn float([low, middle, high]: [i128; 3]) -> f64 {
    let digit = (1u64 << DIGIT) as f64;
    (high as f64 * digit + middle as f64) * digit + low as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at([col, row]: [i64; 2]) -> ProofPosition {
        ProofPosition { col, row }
    }

    fn pair(points: [[i64; 2]; 4], rounding: f64) -> DelaunayVerdict {
        let [p, q, a, b] = points.map(at);
        DelaunayVerdict::of([p, q], [a, b], [rounding; 2])
    }

    /// By the sum of the angles opposite the edge, which is 180 degrees on a circle: its sine, in whole
    /// numbers.
    fn slow([p, q, a, b]: [[i64; 2]; 4]) -> DelaunayVerdict {
        let minus = |a: [i64; 2], b: [i64; 2]| [i128::from(a[0] - b[0]), i128::from(a[1] - b[1])];
        let angle = |apex| {
            let (u, v) = (minus(p, apex), minus(q, apex));
            (u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])
        };
        let ((sine_a, cosine_a), (sine_b, cosine_b)) = (angle(a), angle(b));
        if sine_a.signum() * sine_b.signum() >= 0 {
            return DelaunayVerdict::Folded;
        }
        match (sine_a.abs() * cosine_b + cosine_a * sine_b.abs()).signum() {
            1 => DelaunayVerdict::Delaunay,
            0 => DelaunayVerdict::Cocircular,
            _ => DelaunayVerdict::NotDelaunay,
        }
    }

    #[test]
    fn a_square_is_cocircular_and_a_step_decides_it() {
        for size in [1, 7, 1 << 58] {
            let square = |more: i64| [[0, 0], [size, size], [size, 0], [0, size + more]];
            assert_eq!(pair(square(0), 0.0), DelaunayVerdict::Cocircular);
            assert_eq!(pair(square(1), 0.0), DelaunayVerdict::Delaunay);
            assert_eq!(
                pair([[0, 0], [size, size], [size, 0], [1, size]], 0.0),
                match size {
                    1 => DelaunayVerdict::Folded,
                    _ => DelaunayVerdict::NotDelaunay,
                }
            );
        }
    }

    #[test]
    fn what_rounding_explains_is_on_the_circle() {
        let square = [[0, 0], [1000, 1000], [1000, 0], [1, 1000]];
        assert_eq!(pair(square, 0.1), DelaunayVerdict::NotDelaunay);
        assert_eq!(pair(square, 1.0), DelaunayVerdict::Cocircular);
        let wide = [[0, 0], [1000, 1000], [1000, 0], [-1, 1000]];
        assert_eq!(pair(wide, 0.1), DelaunayVerdict::Delaunay);
        assert_eq!(pair(wide, 1.0), DelaunayVerdict::Cocircular);
    }

    #[test]
    fn triangles_on_one_side_or_without_area_are_folded() {
        assert_eq!(pair([[0, 0], [9, 0], [3, 4], [5, 2]], 0.0), DelaunayVerdict::Folded);
        assert_eq!(pair([[0, 0], [9, 0], [3, 4], [5, 0]], 0.0), DelaunayVerdict::Folded);
    }

    /// Corners near a circle through whole numbers, at any size: where floats cannot tell.
    fn near_circle(sizes: std::ops::Range<u32>) -> impl Strategy<Value = [[i64; 2]; 4]> {
        // 5, 12, 13 and 3, 4, 5: on one circle of 65.
        let on =
            [[65, 0], [39, 52], [16, 63], [-25, 60], [-63, -16], [-33, 56], [0, -65], [52, -39]];
        let corners = prop::sample::subsequence(on.to_vec(), 4).prop_shuffle();
        let off = prop::array::uniform4(prop::array::uniform2(-1i64..2));
        (corners, off, sizes, any::<bool>()).prop_map(|(corners, off, size, moved)| {
            std::array::from_fn(|i| {
                [0, 1].map(|axis| (corners[i][axis] << size) + if moved { off[i][axis] } else { 0 })
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        #[test]
        fn like_the_sum_of_angles(points in prop::array::uniform4([-30i64..30, -30i64..30]), size in 0u32..25) {
            let points = points.map(|p| p.map(|v| v << size));
            prop_assert_eq!(pair(points, 0.0), slow(points));
        }

        /// Beside the determinant itself, digit by digit.
        #[test]
        fn near_a_circle_the_sign_is_exact(points in near_circle(0..50)) {
            let [p, q, a, b] = points;
            let offsets = [p, q, a].map(|o| [o[0] - b[0], o[1] - b[1]]);
            let whole = long::determinant(offsets);
            prop_assert_eq!(determinant(offsets).partial_cmp(&0.0), Some(whole.cmp(&0)));
            let small = points.iter().flatten().all(|v| v.abs() < 1 << 30);
            if small {
                prop_assert_eq!(pair(points, 0.0), slow(points));
            }
        }

        #[test]
        fn the_order_of_ends_and_corners_does_not_matter(points in near_circle(0..50), rounding in 0.0..3.0) {
            let [p, q, a, b] = points;
            let one = pair(points, rounding);
            for other in [[q, p, a, b], [p, q, b, a], [q, p, b, a]] {
                prop_assert_eq!(pair(other, rounding), one);
            }
        }

        /// The slack is what all coordinates together can do: beside moving one after the other.
        #[test]
        fn slack_is_what_every_coordinate_does(points in near_circle(20..50), across in 0.0..9.0, down in 0.0..9.0) {
            let det = |[p, q, a, b]: [[i64; 2]; 4]| {
                determinant([p, q, a].map(|o| [o[0] - b[0], o[1] - b[1]]))
            };
            let (mut expected, whole) = (0.0, det(points));
            for (corner, axis) in (0..4).flat_map(|corner| [(corner, 0), (corner, 1)]) {
                let mut moved = points;
                moved[corner][axis] += 1;
                expected += (det(moved) - whole).abs() * [across, down][axis];
            }
            let [p, q, a, b] = points;
            let offsets = [p, q, a].map(|o| [o[0] - b[0], o[1] - b[1]]);
            let slack = RoughDeterminant::of(offsets, [across, down]).slack;
            prop_assert!((slack - expected).abs() <= 1e-4 * expected, "{} {}", slack, expected);
        }
    }

    /// Whole numbers of any length, in decimal digits: slow, and nothing to overlook.
    mod long {
        /// The sign of the in-circle determinant, times one.
        pub(super) fn determinant(o: [[i64; 2]; 3]) -> i32 {
            let o = o.map(|o| o.map(Long::of));
            let lift = |i: usize| o[i][0].times(&o[i][0]).plus(&o[i][1].times(&o[i][1]));
            let cross = |j: usize, k: usize| {
                o[j][0].times(&o[k][1]).plus(&o[j][1].times(&o[k][0]).negative())
            };
            let terms = [(0, 1, 2), (1, 2, 0), (2, 0, 1)];
            let terms = terms.map(|(i, j, k)| lift(i).times(&cross(j, k)));
            terms[0].plus(&terms[1]).plus(&terms[2]).sign()
        }

        const BASE: i64 = 1000;

        /// Digits to the base of a thousand, the lowest first, of any sign.
        #[derive(Clone)]
        struct Long(Vec<i64>);

        impl Long {
            fn of(value: i64) -> Self {
                let (mut rest, mut digits) = (value, Vec::new());
                while rest != 0 {
                    digits.push(rest % BASE);
                    rest /= BASE;
                }
                Self(digits)
            }

            fn negative(&self) -> Self {
                Self(self.0.iter().map(|d| -d).collect())
            }

            fn digit(&self, i: usize) -> i64 {
                self.0.get(i).copied().unwrap_or(0)
            }

            fn plus(&self, other: &Self) -> Self {
                let len = self.0.len().max(other.0.len());
                Self((0..len).map(|i| self.digit(i) + other.digit(i)).collect()).normalized()
            }

            fn times(&self, other: &Self) -> Self {
                let mut out = vec![0; self.0.len() + other.0.len()];
                for (i, a) in self.0.iter().enumerate() {
                    for (j, b) in other.0.iter().enumerate() {
                        out[i + j] += a * b;
                    }
                }
                Self(out).normalized()
            }

            /// Each digit from 0 up to the base, but the last, which has the sign.
            fn normalized(mut self) -> Self {
                let mut carry = 0;
                for digit in &mut self.0 {
                    let all = *digit + carry;
                    *digit = all.rem_euclid(BASE);
                    carry = all.div_euclid(BASE);
                }
                self.0.push(carry);
                self
            }

            fn sign(&self) -> i32 {
                let all = self.clone().normalized();
                match all.0.last() {
                    Some(top) if *top < 0 => -1,
                    _ => i32::from(all.0.iter().any(|d| *d != 0)),
                }
            }
        }
    }
}
