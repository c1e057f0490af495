//! Rounding of coordinates to a number of decimals.

use super::feature::{Feature, JsonMember};
use super::geometry::CoordinateSequence;
use super::sink::{FeatureSink, WrittenFeatures};
use terrane_base::error::Result;

/// `value` as it is read back from text with `decimals` digits after the point (at most 17).
pub fn rounded(value: f64, decimals: u8) -> f64 {
    const EXACT: f64 = (1_u64 << 53) as f64;
    // Powers of ten up to 10^22 are exact, so the quotient is what a reader of the text gets.
    let power = 10_f64.powi(decimals.into());
    let whole = (value * power).round();
    if whole.abs() < EXACT {
        return whole / power + 0.0;
    }
    let text = format!("{value:.*}", usize::from(decimals));
    text.parse().unwrap_or(value)
}

/// A sink that rounds coordinates before they are written.
pub(super) struct RoundingSink {
    pub(super) inner: Box<dyn FeatureSink>,
    pub(super) decimals: u8,
    /// True if positions of lines and rings are rounded, too (they may be rounded already).
    pub(super) lines: bool,
    /// True if measures are rounded; times are not.
    pub(super) measures: bool,
}

impl FeatureSink for RoundingSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let mut feature = feature.clone();
        feature.geometry.for_each_leaf(&mut |CoordinateSequence { xy, z, m, ends, .. }| {
            let xy = if self.lines || ends.is_empty() { &mut xy[..] } else { &mut [] };
            let measures = if self.measures { &mut m[..] } else { &mut [] };
            let all = xy.as_flattened_mut().iter_mut().chain(z).chain(measures);
            all.for_each(|c| *c = rounded(*c, self.decimals));
        });
        self.inner.write(&feature)
    }

    fn finish(self: Box<Self>, foreign: &[JsonMember]) -> Result<WrittenFeatures> {
        self.inner.finish(foreign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_rounded_number_is_what_its_text_says(
            value in prop_oneof![-1e9..1e9, -1e3..1e3, -1e17..1e17],
            decimals in 0_u8..=17,
        ) {
            let moved = rounded(value, decimals);
            let text = format!("{moved:.*}", usize::from(decimals));
            prop_assert_eq!(text.parse::<f64>().unwrap(), moved);
            let digits = moved.to_string().split_once('.').map_or(0, |(_, digits)| digits.len());
            prop_assert!(digits <= decimals.into(), "{}", moved);
            let error = (moved - value).abs();
            prop_assert!(error <= 0.500_001 * 0.1_f64.powi(decimals.into()) + value.abs() * 1e-15);
        }
    }

    #[test]
    fn texts_are_cut_and_short() {
        let cases = [(1.5, 0), (-0.04, 1), (12.340, 4), (100.0, 0), (100.0, 3), (-0.0, 2)];
        let texts = cases.map(|(value, decimals)| rounded(value, decimals).to_string());
        assert_eq!(texts, ["2", "0", "12.34", "100", "100", "0"]);
    }

    #[test]
    fn nothing_is_minus_zero() {
        assert!(rounded(-0.2, 0).is_sign_positive());
        assert_eq!(rounded(1e300, 17), 1e300);
        assert!(rounded(f64::NAN, 3).is_nan());
    }
}
