//! Sums of products without rounding, as an unevaluated sum of floats.
//!
//! J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
//! Predicates" (1997), grow-expansion with zero elimination.

/// Non-overlapping floats in ascending magnitude whose sum is the value.
#[derive(Clone, Debug, Default)]
pub(crate) struct ProofExpansion {
    parts: Vec<f64>,
}

impl ProofExpansion {
    /// Adds `weight * value` exactly, for |value| between 1e-280 and 1e260 (or 0).
    pub(crate) fn add_product(&mut self, weight: i128, value: f64) {
        let sign = if weight < 0 { -1.0 } else { 1.0 };
        let digits = weight.unsigned_abs();
        for k in 0..3 {
            // 43 bits at a time: each digit and its power of two are exact floats.
            let digit = (digits >> (43 * k)) as u64 & ((1 << 43) - 1);
            if digit != 0 {
                let factor = sign * digit as f64 * 2f64.powi(43 * k);
                let product = factor * value;
                self.add(factor.mul_add(value, -product));
                self.add(product);
            }
        }
    }

    /// Adds `a * b` exactly, for magnitudes as above.
    pub(crate) fn add_floats(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(a.mul_add(b, -product));
        self.add(product);
    }

    /// The sign of the sum: -1, 0 or 1.
    pub(crate) fn sign(&self) -> i32 {
        self.parts.last().map_or(0, |last| if *last > 0.0 { 1 } else { -1 })
    }

    fn add(&mut self, value: f64) {
        let mut carry = value;
        let mut len = 0;
        for i in 0..self.parts.len() {
            let (sum, error) = two_sum(carry, self.parts[i]);
            if error != 0.0 {
                self.parts[len] = error;
                len += 1;
            }
            carry = sum;
        }
        self.parts.truncate(len);
        if carry != 0.0 {
            self.parts.push(carry);
        }
    }

    /// True when the sum is above zero or overflows.
    pub(crate) fn is_positive_or_overflown(&self) -> bool {
        match self.parts.last() {
            Some(last) => *last > 0.0 || self.parts.iter().any(|p| !p.is_finite()),
            None => false,
        }
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

    fn positive(terms: &[(i128, f64)]) -> bool {
        let mut sum = ProofExpansion::default();
        for &(weight, value) in terms {
            sum.add_product(weight, value);
        }
        sum.is_positive_or_overflown()
    }

    #[test]
    fn nothing_is_lost_to_rounding() {
        let big = (1i128 << 120) + 1;
        assert!(positive(&[(big, 1.0), (-(1 << 120), 1.0)]));
        assert!(!positive(&[(big, 1.0), (-big, 1.0)]));
        assert!(!positive(&[(big, 0.1), (-big - 1, 0.1)]));
        assert!(positive(&[(3, 0.1), (-1, 0.3)]), "3 * 0.1 is above 0.3 in binary");
        assert!(!positive(&[]));
    }

    #[test]
    fn products_of_floats_keep_their_sign() {
        let sign = |terms: &[(f64, f64)]| {
            let mut sum = ProofExpansion::default();
            terms.iter().for_each(|&(a, b)| sum.add_floats(a, b));
            sum.sign()
        };
        assert_eq!(sign(&[(0.1, 3.0), (-0.3, 1.0)]), 1);
        assert_eq!(sign(&[(-0.1, 3.0), (0.3, 1.0)]), -1);
        assert_eq!(sign(&[(0.1, 0.7), (-0.7, 0.1)]), 0);
    }

    #[test]
    fn overflow_counts_as_positive() {
        assert!(positive(&[(1 << 120, 1e300), (-(1 << 120), 1e300)]));
    }
}
