//! The exact decision: the sign of a sum of products of doubles. Source: Shewchuk, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates" (1997), grow-expansion. Time quadratic in
//! the number of terms, at most seven; only nearly equal numbers are compared here.

/// Nonoverlapping terms of a sum, the smallest first: their exact sum has the sign of the last nonzero one.
#[derive(Clone, Debug, Default)]
struct ShewchukExpansion(Vec<f64>);

impl ShewchukExpansion {
    fn add(&mut self, mut value: f64) {
        for part in &mut self.0 {
            let (sum, rest) = two_sum(value, *part);
            (value, *part) = (sum, rest);
        }
        self.0.push(value);
    }

    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        // The fused operation gives the exact rounding error of the product.
        self.add(a.mul_add(b, -product));
        self.add(product);
    }

    fn sign(&self) -> f64 {
        // The last nonzero term outweighs all before it, as terms do not overlap.
        self.0.iter().rev().find(|part| **part != 0.0).map_or(0.0, |part| part.signum())
    }
}

/// The rounded sum and its exact rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let shadow = sum - a;
    (sum, (a - (sum - shadow)) + (b - shadow))
}

/// True if the sum of the products of `terms` is at most `max` times `total` in absolute value. Exact as long as no
/// product overflows or falls below the smallest normal number.
pub(crate) fn is_at_most(terms: &[(f64, f64)], max: f64, total: f64) -> bool {
    [1.0, -1.0].into_iter().all(|side| {
        let mut sum = ShewchukExpansion::default();
        terms.iter().for_each(|(a, b)| sum.add_product(side * a, *b));
        sum.add_product(-max, total);
        sum.sign() <= 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equality_holds_and_the_next_number_does_not() {
        let terms = [(3.0, 0.1), (5.0, -0.1), (1.0, 7.0)];
        // 7 - 2 * 0.1, with the double that is called 0.1.
        let mut sum = ShewchukExpansion::default();
        terms.iter().for_each(|(a, b)| sum.add_product(*a, *b));
        let nearest = sum.0.iter().sum::<f64>();
        let holds = [nearest.next_down(), nearest, nearest.next_up()]
            .map(|most| is_at_most(&terms, most, 1.0));
        assert!(!holds[0] && holds[2], "{holds:?}");
        assert!(is_at_most(&[(1.0, 2.5), (1.0, -2.5)], 0.0, 9.0));
        assert!(!is_at_most(&[(1.0, 1e300), (1.0, -1e300), (1.0, 1e-300)], 0.0, 9.0));
        assert!(is_at_most(&[(2.0, -1.5)], 1.0, 3.0) && !is_at_most(&[(2.0, -1.5)], 1.0, 2.0));
    }
}
