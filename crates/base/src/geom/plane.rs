//! Exact orientation and signed area of floating-point positions in the plane.
//!
//! The signs are exact for coordinates that are 0 or between [`LEAST`] and [`MOST`] in magnitude: products do not
//! overflow, and rounding errors do not underflow. A determinant is first computed in floats; if it is below its
//! error bound, it is computed exactly as an unevaluated sum of floats. J. R. Shewchuk, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates" (1997): the filter of orient2d, and
//! grow-expansion.

use std::cmp::Ordering;

/// A position (x, y).
pub type Xy = [f64; 2];

/// Largest magnitude of a coordinate for which the signs are exact.
pub const MOST: f64 = 1e140;

/// Smallest magnitude of a coordinate other than 0 for which the signs are exact.
pub const LEAST: f64 = 1e-130;

/// Half an ulp of 1.
const EPSILON: f64 = f64::EPSILON / 2.0;

/// The relative error of the determinant in floats, by the sum of its two products' magnitudes.
const FILTER: f64 = (3.0 + 16.0 * EPSILON) * EPSILON;

/// A key that is equal exactly for equal positions.
pub fn key(at: Xy) -> [u64; 2] {
    // -0 + 0 is 0, so both zeros have one key.
    at.map(|c| (c + 0.0).to_bits())
}

/// Whether (a, b, c) turns left (`Greater`), right (`Less`) or is collinear (`Equal`), exactly.
#[inline(always)]
pub fn orient(a: Xy, b: Xy, c: Xy) -> Ordering {
    let left = (a[0] - c[0]) * (b[1] - c[1]);
    let right = (a[1] - c[1]) * (b[0] - c[0]);
    let det = left - right;
    let size = left.abs() + right.abs();
    let bound = FILTER * size;
    if det > bound {
        Ordering::Greater
    } else if -det > bound {
        Ordering::Less
    } else if size == 0.0 {
        // Both products have a factor that is 0, exactly.
        Ordering::Equal
    } else {
        orient_exact(a, b, c)
    }
}

#[cold]
#[inline(never)]
fn orient_exact(a: Xy, b: Xy, c: Xy) -> Ordering {
    let mut sum = FloatExpansion::default();
    sum.add_cross(a, b);
    sum.add_cross(b, c);
    sum.add_cross(c, a);
    sum.sign()
}

/// The sign of the area of a closed ring of positions: `Greater` if counter-clockwise. The first position may be
/// repeated as the last. Exact; O(n) unless the area is almost 0.
pub fn area_sign(ring: impl Iterator<Item = Xy> + Clone) -> Ordering {
    let mut positions = ring.clone();
    let Some(origin) = positions.next() else { return Ordering::Equal };
    let (mut sum, mut size, mut count) = (0.0, 0.0, 0.0);
    let mut before = [0.0; 2];
    for p in positions {
        // Products of coordinates far from 0 would drown the area in their rounding.
        let at = [p[0] - origin[0], p[1] - origin[1]];
        let (left, right) = (before[0] * at[1], before[1] * at[0]);
        sum += left - right;
        size += left.abs() + right.abs();
        count += 1.0;
        before = at;
    }
    // Each term is within 4 roundings of the truth, and each of the sums loses one a term.
    let bound = (count + 8.0) * 2.0 * EPSILON * size;
    if sum > bound {
        Ordering::Greater
    } else if -sum > bound {
        Ordering::Less
    } else {
        area_sign_exact(ring)
    }
}

#[cold]
fn area_sign_exact(ring: impl Iterator<Item = Xy> + Clone) -> Ordering {
    let Some(first) = ring.clone().next() else { return Ordering::Equal };
    let mut sum = FloatExpansion::default();
    for (p, q) in ring.clone().zip(ring.skip(1).chain([first])) {
        sum.add_cross(p, q);
    }
    sum.sign()
}

/// Non-overlapping floats in ascending magnitude; their sum is the value.
#[derive(Default)]
struct FloatExpansion {
    parts: Vec<f64>,
}

impl FloatExpansion {
    /// Adds p.x q.y - p.y q.x.
    fn add_cross(&mut self, p: Xy, q: Xy) {
        self.add_product(p[0], q[1]);
        self.add_product(-p[1], q[0]);
    }

    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(a.mul_add(b, -product));
        self.add(product);
    }

    fn add(&mut self, value: f64) {
        let mut carry = value;
        let mut count = 0;
        for i in 0..self.parts.len() {
            let (sum, error) = two_sum(carry, self.parts[i]);
            if error != 0.0 {
                self.parts[count] = error;
                count += 1;
            }
            carry = sum;
        }
        self.parts.truncate(count);
        if carry != 0.0 {
            self.parts.push(carry);
        }
    }

    fn sign(&self) -> Ordering {
        // Parts do not overlap and none is 0, so the largest has the sign of the sum.
        self.parts.last().map_or(Ordering::Equal, |last| last.total_cmp(&0.0))
    }
}

/// The rounded sum and its rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (sum, (a - a_part) + (b - b_part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The same in whole numbers: coordinates are multiples of 2^-20 below 2^30.
    fn orient_whole(a: Xy, b: Xy, c: Xy) -> Ordering {
        let [a, b, c] = [a, b, c].map(|p| p.map(|v| (v * 1_048_576.0) as i128));
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).cmp(&0)
    }

    /// Positions all but on a line: y = x plus a few steps of 2^-20.
    fn near_line() -> impl Strategy<Value = Xy> {
        (-1_000_000_000_000i64..1_000_000_000_000, -2i64..=2).prop_map(|(x, off)| {
            let step = 1.0 / 1_048_576.0;
            [x as f64 * step, (x + off) as f64 * step]
        })
    }

    #[test]
    fn signs() {
        assert_eq!(orient([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]), Ordering::Greater);
        assert_eq!(orient([0.0, 0.0], [0.0, 1.0], [1.0, 0.0]), Ordering::Less);
        assert_eq!(orient([0.1, 0.1], [0.2, 0.2], [0.3, 0.3]), Ordering::Equal);
        assert_eq!(orient([0.1, 0.1], [0.7, 0.7], [0.3, 0.3f64.next_up()]), Ordering::Greater);
        let big = MOST;
        assert_eq!(orient([-big, -big], [big, big], [1.0, 1.0f64.next_down()]), Ordering::Less);
    }

    #[test]
    fn areas() {
        let ring = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];
        assert_eq!(area_sign(ring.into_iter()), Ordering::Greater);
        assert_eq!(area_sign(ring[..3].iter().copied()), Ordering::Greater);
        assert_eq!(area_sign(ring.into_iter().rev()), Ordering::Less);
        assert_eq!(area_sign([[0.3, 0.7]; 4].into_iter()), Ordering::Equal);
        let thin = [[0.1, 0.1], [0.7, 0.7], [0.3, 0.3f64.next_up()]];
        assert_eq!(area_sign(thin.into_iter()), Ordering::Greater);
        let wide = [[-MOST, -MOST], [MOST, MOST], [1.0, 1.0f64.next_down()]];
        assert_eq!(area_sign(wide.into_iter()), Ordering::Less);
        assert_eq!(area_sign(std::iter::empty()), Ordering::Equal);
    }

    /// Whole numbers up to 1000 from a place far or near, times a power of two: exact in floats, and
    /// far from it where they are subtracted or multiplied.
    fn scaled(ring: &[(i64, i64)], far: i64, power: i32) -> Vec<Xy> {
        let float = |v: i64| (v + far) as f64 * 2.0_f64.powi(power);
        ring.iter().map(|&(x, y)| [float(x), float(y)]).collect()
    }

    fn area_whole(ring: &[(i64, i64)]) -> i64 {
        let next = |i: usize| ring[(i + 1) % ring.len()];
        (0..ring.len()).map(|i| ring[i].0 * next(i).1 - ring[i].1 * next(i).0).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// Rings of any shape, crossing themselves, some of them with next to no area.
        #[test]
        fn areas_are_those_of_whole_numbers(
            mut ring in prop::collection::vec((-9..9_i64, -9..9_i64), 1..9), long in 1..100_i64,
            far in prop_oneof![Just(0), Just(1 << 30), Just(-(1 << 44))], power in -40..5_i32, back: bool
        ) {
            if back {
                // There and back along nearly the same way.
                let way: Vec<_> = ring.iter().rev().copied().collect();
                ring.extend(way);
                ring[0].0 += 1;
            }
            ring.iter_mut().for_each(|(x, y)| (*x, *y) = (*x * long, *y * long + *x));
            let expected = area_whole(&ring).cmp(&0);
            let floats = scaled(&ring, far, power);
            prop_assert_eq!(area_sign(floats.iter().copied()), expected);
            let closed = floats.iter().chain(floats.first()).copied();
            prop_assert_eq!(area_sign(closed), expected);
            prop_assert_eq!(area_sign(floats.iter().rev().copied()), expected.reverse());
        }

        #[test]
        fn orientation_is_exact_at_any_size(
            ring in prop::array::uniform3((-50..50_i64, -50..50_i64)),
            far in prop_oneof![Just(0), Just(1 << 44)], power in -70..9_i32
        ) {
            // All but on a line through the origin of the numbers.
            let ring = ring.map(|(x, off)| (x * 1_000_003, x * 999_983 + off % 2));
            let [a, b, c] = scaled(&ring, far, power)[..] else { unreachable!() };
            prop_assert_eq!(orient(a, b, c), area_whole(&ring).cmp(&0));
        }
    }

    #[test]
    fn the_last_bit_of_a_coordinate_gives_a_flat_ring_an_area() {
        for (x, y) in (1..200_i64).flat_map(|x| (1..200_i64).map(move |y| (x, y))) {
            let ring = [(x, y), (3 * x, 3 * y), (7 * x, 7 * y)];
            let floats = ring.map(|(x, y)| [x as f64 / 1024.0 + 1e6, y as f64 / 1024.0 + 1e6]);
            assert_eq!(area_sign(floats.into_iter()), Ordering::Equal);
            let mut off = floats;
            off[1][1] = off[1][1].next_up();
            assert_eq!(area_sign(off.into_iter()), Ordering::Less);
        }
    }

    /// Twice the area of a ring, as the sum of triangles from its first position.
    fn area_of_long_numbers(ring: &[Xy]) -> Ordering {
        let whole = |p: &Xy| p.map(|v| (v * 1_048_576.0) as i128);
        let ring: Vec<[i128; 2]> = ring.iter().map(whole).collect();
        let [x, y] = ring[0];
        let cross = |p: [i128; 2], q: [i128; 2]| (p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x);
        ring.windows(2).map(|pair| cross(pair[0], pair[1])).sum::<i128>().cmp(&0)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        /// Products of these numbers are longer than floats; to scale them changes no sign, but makes a
        /// bound that does not scale along too small.
        #[test]
        fn signs_of_long_numbers_are_exact_at_any_size(
            ring in prop::collection::vec(near_line(), 3..8), power in prop_oneof![-300..-100, -60..60, 100..300]
        ) {
            let size = 2.0_f64.powi(power);
            let scaled: Vec<Xy> = ring.iter().map(|p| p.map(|v| v * size)).collect();
            prop_assert_eq!(area_sign(scaled.iter().copied()), area_of_long_numbers(&ring));
            let expected = orient_whole(ring[0], ring[1], ring[2]);
            prop_assert_eq!(orient(scaled[0], scaled[1], scaled[2]), expected);
        }
    }

    /// A position whose cross product with one of coprime coordinates is 1 (Euclid).
    fn shifted([x, y]: [i64; 2]) -> Option<[i64; 2]> {
        let (mut old, mut new) = ((x, 1, 0), (y, 0, 1));
        while new.0 != 0 {
            let times = old.0 / new.0;
            (old, new) =
                (new, (old.0 - times * new.0, old.1 - times * new.1, old.2 - times * new.2));
        }
        // x * old.1 + y * old.2 is the greatest common divisor.
        (old.0 == 1).then_some([-old.2, old.1])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        /// Products of 2^80 that differ by one at most: no rounding tells them apart.
        #[test]
        fn the_smallest_areas_are_seen(
            (p, q) in [1_i64 << 38..1 << 40, 1_i64 << 38..1 << 40]
                .prop_filter_map("not coprime", |p| shifted(p).map(|q| (p, q))),
            twice in -1..=1_i64, power in prop_oneof![-300..-100, -60..60, 100..300],
            far in 0..3_i64
        ) {
            let q = [0, 1].map(|axis| q[axis] * twice + p[axis] * far);
            let size = 2.0_f64.powi(power);
            let [p, q] = [p, q].map(|p| p.map(|v| v as f64 * size));
            let (origin, expected) = ([0.0; 2], twice.cmp(&0));
            prop_assert_eq!(area_sign([origin, p, q].into_iter()), expected);
            prop_assert_eq!(orient(p, q, origin), expected);
            // There and back, around the smaller of two areas.
            let ring = [origin, p, [p[0] * 2.0, p[1] * 2.0], q, origin, p, q];
            prop_assert_eq!(area_sign(ring.into_iter()), expected);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        /// A line with one position so far off that floats do not hold its distance from the others:
        /// what they lose there is more than what is asked for.
        #[test]
        fn differences_that_floats_do_not_hold_are_told_exactly(
            way in [-(1_i64 << 20)..1 << 20, -(1_i64 << 20)..1 << 20],
            times in [-(1_i64 << 28)..1 << 28, -(1_i64 << 28)..1 << 28],
            off in prop::array::uniform4(-3..=3_i64), turn in 0..3_usize,
            power in prop_oneof![-300..-100, -99..20, 100..300]
        ) {
            let at = |k: i64, off: [i64; 2]| [way[0] * k + off[0], way[1] * k + off[1]];
            let mut ring =
                [at(1 << 38, [0; 2]), at(times[0], [off[0], off[1]]), at(times[1], [off[2], off[3]])];
            let [a, b, c] = ring.map(|p| p.map(i128::from));
            let expected =
                ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).cmp(&0);
            ring.rotate_left(turn);
            let [a, b, c] = ring.map(|p| p.map(|v| v as f64 * 2.0_f64.powi(power)));
            prop_assert_eq!(orient(a, b, c), expected);
            prop_assert_eq!(area_sign([a, b, c].into_iter()), expected);
            prop_assert_eq!(area_sign([a, b, c, a, b, c, a].into_iter()), expected);
        }
    }

    proptest! {
        #[test]
        fn orientation_is_that_of_whole_numbers(a in near_line(), b in near_line(), c in near_line()) {
            prop_assert_eq!(orient(a, b, c), orient_whole(a, b, c));
            prop_assert_eq!(area_sign([a, b, c].into_iter()), orient_whole(a, b, c));
        }
    }
}
