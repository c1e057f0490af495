//! Exact orientation and signed area of positions in the plane, as floats.
//!
//! The signs are right for coordinates that are 0 or between [`LEAST`] and [`MOST`] in magnitude:
//! there no product overflows, and no rounding error underflows. A determinant is computed in
//! floats first; only where it is smaller than the error it may carry, exactly, as an unevaluated
//! sum of floats. J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates" (1997): the filter of orient2d, and grow-expansion.

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

/// A key that positions have in common exactly where they are equal.
pub fn key(at: Xy) -> [u64; 2] {
    at.map(|c| (c + 0.0).to_bits())
}

/// Whether (a, b, c) turns left (`Greater`), right (`Less`) or not at all, exactly.
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
    let mut sum = Sum::default();
    sum.add_cross(a, b);
    sum.add_cross(b, c);
    sum.add_cross(c, a);
    sum.sign()
}

/// The sign of the area of a closed ring of positions, the first repeated as the last or not:
/// `Greater` when counter-clockwise. Exact; O(n) unless the area is all but 0.
pub fn area_sign(ring: impl Iterator<Item = Xy> + Clone) -> Ordering {
    let mut positions = ring.clone();
    let Some(origin) = positions.next() else { return Ordering::Equal };
    let (mut sum, mut size, mut count) = (0.0, 0.0, 0.0);
    let mut before = [0.0; 2];
    for p in positions {
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
    let mut sum = Sum::default();
    for (p, q) in ring.clone().zip(ring.skip(1).chain([first])) {
        sum.add_cross(p, q);
    }
    sum.sign()
}

/// Floats that do not overlap, in ascending magnitude; their sum is the value.
#[derive(Default)]
struct Sum {
    parts: Vec<f64>,
}

impl Sum {
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
        let mut kept = 0;
        for i in 0..self.parts.len() {
            let (sum, error) = two_sum(carry, self.parts[i]);
            if error != 0.0 {
                self.parts[kept] = error;
                kept += 1;
            }
            carry = sum;
        }
        self.parts.truncate(kept);
        if carry != 0.0 {
            self.parts.push(carry);
        }
    }

    fn sign(&self) -> Ordering {
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

    proptest! {
        #[test]
        fn orientation_is_that_of_whole_numbers(a in near_line(), b in near_line(), c in near_line()) {
            prop_assert_eq!(orient(a, b, c), orient_whole(a, b, c));
            prop_assert_eq!(area_sign([a, b, c].into_iter()), orient_whole(a, b, c));
        }
    }
}
