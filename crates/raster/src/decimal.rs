//! Fast parser of plain decimal numbers that convert in one exact step, as nearly all of a text grid do.

use terrane_base::digits::{Digits, MAX_DIGITS, MAX_EXACT, POWERS};

/// The number at the start of `text` and its length, if more text follows, and it has no exponent and few
/// enough digits; `None` otherwise. The caller checks what follows.
///
/// The digits without their point are a whole number that is exact in `f64`, and so is the power of
/// ten it is divided by; the division rounds once, so the result is the nearest `f64` (Clinger
/// 1990, "How to read floating point numbers accurately").
#[inline(always)]
pub(super) fn leading(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let Digits { mantissa, count, decimals, end } = Digits::of(text, usize::from(negative));
    let is_plain = (1..=MAX_DIGITS).contains(&count) && mantissa <= MAX_EXACT;
    if !is_plain || end == text.len() {
        return None;
    }
    // Below 2^63, where the faster conversion from signed integers applies.
    let whole = mantissa as i64 as f64;
    let value = if decimals == 0 { whole } else { whole / POWERS[decimals] };
    Some((if negative { -value } else { value }, end))
}

/// The number in all of `text`; `None` if it is not a number, or if its digits overflow `f64`.
pub(super) fn whole(text: &str) -> Option<f64> {
    let value: f64 = text.parse().ok()?;
    // "inf" is a number, but digits that parse as infinity have overflowed.
    let has_overflowed = !value.is_finite() && text.contains(|c: char| c.is_ascii_digit());
    (!has_overflowed).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The number in front, and whether it has the very bits that the standard library gives it.
    fn check(word: &str) -> Option<bool> {
        let text = format!("{word} 7");
        let (value, _) = leading(text.as_bytes()).filter(|(_, bytes)| *bytes == word.len())?;
        Some(value.to_bits() == word.parse::<f64>().unwrap().to_bits())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn like_the_standard_library(word in "-?[0-9]{0,12}(\\.[0-9]{0,12})?") {
            prop_assert!(check(&word) != Some(false), "{}", word);
        }

        #[test]
        fn printed_floats_come_back(height in any::<f32>(), decimals in 0_usize..12) {
            let word = format!("{height:.decimals$}");
            prop_assert!(check(&word) != Some(false), "{}", word);
        }
    }

    #[test]
    fn common_numbers_take_the_fast_way() {
        let words =
            ["0", "-0", "12", "-9999", "123.456", "-0.25", ".5", "5.", "0.1", "2543.000000"];
        for word in words.into_iter().chain(["9007199254740992", "-0.000000000000000001"]) {
            assert_eq!(check(word), Some(true), "{word}");
        }
    }

    #[test]
    fn what_is_beyond_all_numbers_is_none() {
        for (text, value) in
            [("1e308", 1e308), ("inf", f64::INFINITY), ("-Infinity", -f64::INFINITY)]
        {
            assert_eq!(whole(text), Some(value), "{text}");
        }
        assert!(whole("NaN").is_some_and(f64::is_nan) && whole("1e-999") == Some(0.0));
        assert_eq!(
            (whole("6e999"), whole("-1e309"), whole("1 "), whole("x")),
            (None, None, None, None)
        );
    }

    #[test]
    fn all_else_is_left_alone() {
        let words =
            ["", "-", ".", "-.", "+1", "1e3", "nan", "1,5", "1.2.3", "--1", "9007199254740993"];
        for word in words.into_iter().chain(["00000000000000000001", "1x", "18446744073709551617"])
        {
            assert_eq!(check(word), None, "{word}");
        }
        assert_eq!(leading(b"123"), None, "it may go on");
        assert_eq!(leading(b""), None);
    }
}
