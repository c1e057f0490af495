//! Sums of floats without rounding, so that they come out the same in any order.

/// Limbs of 32 bits that span every finite `f64`, from 2^-1074 up, with space for carries.
const LIMBS: usize = 68;
/// Additions after which limbs are normalised: each adds less than 2^32 to a limb of 63 bits.
const MAX_PENDING: u32 = 1 << 30;

/// An exact sum of non-negative floats.
#[derive(Clone, Debug)]
pub struct ExactSum {
    limbs: [i64; LIMBS],
    pending: u32,
    overflown: bool,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { limbs: [0; LIMBS], pending: 0, overflown: false }
    }
}

/// Sums are equal when their values are, however they came about.
impl PartialEq for ExactSum {
    fn eq(&self, other: &Self) -> bool {
        let [mut a, mut b] = [self.clone(), other.clone()];
        a.normalise();
        b.normalise();
        a.limbs == b.limbs && a.overflown == b.overflown
    }
}

impl ExactSum {
    /// Adds `value` (not negative); an infinity or NaN makes the sum infinite.
    pub fn add(&mut self, value: f64) {
        if !value.is_finite() {
            self.overflown = true;
            return;
        }
        let bits = value.abs().to_bits();
        let exponent = (bits >> 52).max(1) as usize - 1;
        let implicit = u64::from(bits >> 52 != 0) << 52;
        let mantissa = u128::from((bits & ((1 << 52) - 1)) | implicit) << (exponent % 32);
        for k in 0..3 {
            self.limbs[exponent / 32 + k] += i64::from((mantissa >> (32 * k)) as u32);
        }
        self.count(1);
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        let mut other = other.clone();
        other.normalise();
        for (limb, more) in self.limbs.iter_mut().zip(other.limbs) {
            *limb += more;
        }
        self.overflown |= other.overflown;
        self.count(1);
    }

    fn count(&mut self, additions: u32) {
        self.pending += additions;
        if self.pending >= MAX_PENDING {
            self.normalise();
        }
    }

    /// Carries upwards until every limb but the last is below 2^32.
    fn normalise(&mut self) {
        let mut carry = 0;
        for limb in &mut self.limbs {
            let all = *limb + carry;
            *limb = all & 0xffff_ffff;
            carry = all >> 32;
        }
        self.pending = 0;
    }

    /// The sum, within two units in the last place; infinite beyond the range of `f64`.
    pub fn value(&self) -> f64 {
        if self.overflown {
            return f64::INFINITY;
        }
        let mut exact = self.clone();
        exact.normalise();
        let Some(top) = exact.limbs.iter().rposition(|&limb| limb != 0) else { return 0.0 };
        let low = top.saturating_sub(3);
        let digits = exact.limbs[low..=top].iter().rev().fold(0u128, |d, &l| d << 32 | l as u128);
        // In two steps: the whole factor may be below all floats although the sum is not.
        digits as f64 * 2f64.powi(16 * low as i32 - 537) * 2f64.powi(16 * low as i32 - 537)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(values: &[f64]) -> ExactSum {
        let mut sum = ExactSum::default();
        values.iter().for_each(|&v| sum.add(v));
        sum
    }

    #[test]
    fn extremes() {
        assert_eq!(sum(&[]).value(), 0.0);
        assert_eq!(sum(&[1.0, 2f64.powi(-60), 1.0]).value(), 2.0);
        assert_eq!(sum(&[f64::MAX]).value(), f64::MAX);
        assert_eq!(sum(&[5e-324, 5e-324]).value(), 1e-323);
        assert_eq!(sum(&[1.0, f64::NAN]).value(), f64::INFINITY);
    }

    proptest! {
        #[test]
        fn order_and_grouping_do_not_matter(values in prop::collection::vec(0.0..1e9f64, 1..50), cut in 0usize..50) {
            let cut = cut.min(values.len());
            let mut parts = sum(&values[cut..]);
            parts.merge(&sum(&values[..cut]));
            prop_assert_eq!(parts.value(), sum(&values).value());
            prop_assert_eq!(&parts, &sum(&values));
            let plain: f64 = values.iter().sum();
            prop_assert!((parts.value() - plain).abs() <= plain * 1e-13);
        }
    }
}
