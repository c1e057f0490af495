//! Sums of floats of both signs without rounding, so that they are the same in any order and grouping. Proofs have sums of
//! their own (`terrane_proof::ExactSum`), as a proof shares no arithmetic with what it checks.
//!
//! ```
//! use terrane_base::exact_total::ExactTotal;
//! let mut total = ExactTotal::default();
//! [1e300, 1.0, -1e300, 2f64.powi(-60)].into_iter().for_each(|value| total.add(value));
//! assert_eq!(total.get(), 1.0);
//! assert_eq!(total.get_pair(), [1.0, 2f64.powi(-60)]);
//! ```

/// Exponents of a bin. The significand of 53 bits, shifted by fewer, takes 84 of its 127 bits.
const SPAN: u32 = 32;
/// Bins that span every finite `f64`, from 2^-1074 up.
const BINS: usize = 64;
/// Additions after which bins are normalised: 2^40 values of 2^84 stay below 2^127.
const MAX_PENDING: u64 = 1 << 40;
/// Digits of 32 bits of the whole sum: one for each bin, and those above, for sums beyond the range of `f64`.
const DIGITS: usize = BINS + 4;
/// Bits of a significand.
const SIGNIFICAND: usize = 53;

/// An exact sum of floats. An infinity or NaN makes it what such floats add up to.
#[derive(Clone, Debug)]
pub struct ExactTotal {
    /// Whole multiples of 2^(32 i - 1074).
    bins: [i128; BINS],
    /// Additions since bins were last normalised.
    pending: u64,
    /// The sum of the values that are not finite; 0 without any.
    unbounded: f64,
}

impl Default for ExactTotal {
    fn default() -> Self {
        Self { bins: [0; BINS], pending: 0, unbounded: 0.0 }
    }
}

impl ExactTotal {
    /// Adds a value, in about two nanoseconds.
    #[inline]
    pub fn add(&mut self, value: f64) {
        if !value.is_finite() {
            self.unbounded += value;
            return;
        }
        let bits = value.to_bits();
        let field = (bits >> 52 & 0x7ff) as u32;
        let exponent = field.max(1) - 1;
        let implicit = u64::from(field != 0) << 52;
        let significand = i128::from(bits & ((1 << 52) - 1) | implicit) << (exponent % SPAN);
        let signed = if value.is_sign_negative() { -significand } else { significand };
        self.bins[(exponent / SPAN) as usize] += signed;
        self.count(1);
    }

    /// Adds the square of a value, exactly where neither it nor its last bit is beyond the range of `f64`.
    #[inline]
    pub fn add_square(&mut self, value: f64) {
        let square = value * value;
        self.add(square);
        let rest = value.mul_add(value, -square);
        if rest != 0.0 && square.is_finite() {
            self.add(rest);
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        for (bin, more) in self.bins.iter_mut().zip(other.bins) {
            *bin += more;
        }
        self.unbounded += other.unbounded;
        self.count(other.pending + 1);
    }

    #[inline]
    fn count(&mut self, additions: u64) {
        self.pending += additions;
        if self.pending >= MAX_PENDING {
            self.normalise();
        }
    }

    /// Leaves less than 2^32 in each bin but the last.
    fn normalise(&mut self) {
        let mut above = 0;
        for bin in &mut self.bins {
            let all = *bin + above;
            *bin = all & 0xffff_ffff;
            above = all >> SPAN;
        }
        self.bins[BINS - 1] += above << SPAN;
        self.pending = 1;
    }

    /// The sum, rounded once to the nearest `f64`, ties to even.
    pub fn get(&self) -> f64 {
        if self.unbounded != 0.0 {
            return self.unbounded;
        }
        let (is_negative, digits) = self.digits();
        let size = rounded(&digits);
        if is_negative { -size } else { size }
    }

    /// The rounded sum, and the rest of it, rounded.
    pub fn get_pair(&self) -> [f64; 2] {
        let high = self.get();
        if !high.is_finite() {
            return [high, 0.0];
        }
        let mut rest = self.clone();
        rest.add(-high);
        [high, rest.get()]
    }

    /// The sign, and the digits of the absolute value, the lowest first.
    fn digits(&self) -> (bool, [u32; DIGITS]) {
        let (mut digits, mut above) = ([0; DIGITS], 0_i128);
        for (place, digit) in digits.iter_mut().enumerate() {
            let all = self.bins.get(place).copied().unwrap_or(0) + above;
            *digit = all as u32;
            above = all >> SPAN;
        }
        let is_negative = above < 0;
        if is_negative {
            let mut more = true;
            for digit in &mut digits {
                (*digit, more) = (!*digit).overflowing_add(u32::from(more));
            }
        }
        (is_negative, digits)
    }
}

/// The float nearest to a number in units of 2^-1074.
fn rounded(digits: &[u32; DIGITS]) -> f64 {
    let Some(top) = digits.iter().rposition(|digit| *digit != 0) else { return 0.0 };
    let bits = 32 * top + 32 - digits[top].leading_zeros() as usize;
    // Bits of an `f64` of this size are those of the number itself: below 2^53 they need no exponent.
    let shift = bits.saturating_sub(SIGNIFICAND);
    let bit = |place: usize| digits[place / 32] >> (place % 32) & 1 == 1;
    let kept = (shift..bits).rev().fold(0_u64, |kept, place| kept << 1 | u64::from(bit(place)));
    let half = shift > 0 && bit(shift - 1);
    let is_above_half = half && (0..shift - 1).any(bit);
    let up = half && (is_above_half || kept & 1 == 1);
    let exponent = (shift as u64) << 52;
    let found = exponent + kept + u64::from(up);
    if found >= f64::INFINITY.to_bits() { f64::INFINITY } else { f64::from_bits(found) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn total(values: &[f64]) -> ExactTotal {
        let mut total = ExactTotal::default();
        values.iter().for_each(|value| total.add(*value));
        total
    }

    #[test]
    fn sums_of_two_are_those_of_the_processor_at_every_size() {
        let sizes = [5e-324, 1e-310, f64::MIN_POSITIVE, 1e-9, 0.1, 1.0, 3.0, 1e9, 1e300, f64::MAX];
        let signed = sizes.into_iter().flat_map(|size| [size, -size, size.next_down()]);
        let values: Vec<f64> = signed.collect();
        for a in &values {
            for b in &values {
                assert_eq!(total(&[*a, *b]).get().to_bits(), (a + b + 0.0).to_bits(), "{a} {b}");
            }
        }
        assert_eq!(total(&[]).get(), 0.0);
        assert_eq!(total(&[f64::INFINITY, 1.0]).get(), f64::INFINITY);
        assert!(total(&[f64::INFINITY, f64::NEG_INFINITY]).get().is_nan());
    }

    #[test]
    fn normalised_bins_hold_the_same() {
        for value in [f64::MAX, -f64::MAX, -1.0, 5e-324, -5e-324, 0.1] {
            let mut normal = total(&[value, 1e-3, -7.5]);
            let plain = normal.clone();
            normal.normalise();
            normal.normalise();
            assert_eq!(normal.get().to_bits(), plain.get().to_bits(), "{value}");
            normal.merge(&total(&[-value, 7.5]));
            assert_eq!(normal.get(), 1e-3, "{value}");
        }
        let mut many = total(&[f64::MAX, f64::MAX, f64::MAX]);
        assert_eq!(many.get(), f64::INFINITY);
        many.normalise();
        many.merge(&total(&[-f64::MAX, -f64::MAX]));
        assert_eq!(many.get(), f64::MAX);
    }

    #[test]
    fn squares_are_exact() {
        let mut squares = ExactTotal::default();
        [1.0 + f64::EPSILON, -0.1, 3e7 + 1.0].into_iter().for_each(|value| {
            squares.add_square(value);
            squares.add(-(value * value));
        });
        let rests = [1.0 + f64::EPSILON, -0.1, 3e7 + 1.0_f64].map(|v| v.mul_add(v, -(v * v)));
        assert_eq!(squares.get(), total(&rests).get());
        squares.add_square(1e200);
        assert_eq!(squares.get(), f64::INFINITY);
    }

    /// Floats with 53 bits within so few exponents that `i128` holds any sum of them.
    fn scaled() -> impl Strategy<Value = (i64, u32)> {
        (-(1_i64 << 53)..1 << 53, 0_u32..60)
    }

    proptest! {
        #[test]
        fn sums_are_those_of_integers_in_any_order(
            values in prop::collection::vec(scaled(), 0..200),
            order in prop::collection::vec(any::<u32>(), 200),
            cut in 0_usize..200,
            down in 0_i32..1000,
        ) {
            let scale = 2_f64.powi(-down);
            let expected: i128 = values.iter().map(|(digits, up)| i128::from(*digits) << up).sum();
            let floats = values.iter().map(|(digits, up)| *digits as f64 * 2_f64.powi(*up as i32) * scale);
            let mut floats: Vec<(u32, f64)> = order.iter().copied().zip(floats).collect();
            let plain: Vec<f64> = floats.iter().map(|(_, value)| *value).collect();
            floats.sort_by_key(|(place, _)| *place);
            let sorted: Vec<f64> = floats.iter().map(|(_, value)| *value).collect();
            let (left, right) = sorted.split_at(cut.min(sorted.len()));
            let mut parts = total(right);
            parts.merge(&total(left));
            let found = total(&plain).get();
            prop_assert_eq!(found, expected as f64 * scale);
            prop_assert_eq!(parts.get().to_bits(), found.to_bits());
            let [high, low] = parts.get_pair();
            let rest = expected - (high / scale) as i128;
            prop_assert_eq!(low, rest as f64 * scale);
        }
    }
}
