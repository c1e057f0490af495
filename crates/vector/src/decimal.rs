//! Exact conversion between numbers and text.

use terrane_base::digits::{Digits, MAX_DIGITS, MAX_EXACT, POWERS, take_digits};

/// Maximum length of a number in bytes.
pub(super) const MAX_BYTES: usize = 1100;

/// The number at the start of `text` (sign, digits with an optional point, exponent) and its length; `None`
/// if there is none, or if it is too long. Rounded to the nearest `f64`; infinite if out of range.
///
/// The digits without the point that are exact in `f64` are divided by an exact power of ten, which
/// rounds once (Clinger 1990, "How to read floating point numbers accurately"). Up to 19 digits are
/// divided in whole numbers, with all bits of the quotient that rounding needs and the remainder as
/// the last. The rest is left to the standard library.
#[inline]
pub(super) fn leading(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let start = usize::from(negative || text.first() == Some(&b'+'));
    let Digits { mantissa, count: digits, decimals, end } = Digits::of(text, start);
    if digits == 0 {
        return None;
    }
    if digits > MAX_DIGITS || matches!(text.get(end), Some(b'e' | b'E')) {
        return by_library(text, end);
    }
    let value = if mantissa <= MAX_EXACT {
        // Below 2^63, where the faster conversion from signed integers applies.
        mantissa as i64 as f64 / POWERS[decimals]
    } else {
        divided(mantissa, decimals)
    };
    Some((if negative { -value } else { value }, end))
}

/// `mantissa` (not 0) divided by ten to the power of `decimals` (at most 19), rounded to nearest, ties to
/// even.
fn divided(mantissa: u64, decimals: usize) -> f64 {
    let Some(power) = 10_u64.checked_pow(decimals as u32) else { return f64::NAN };
    // Both operands are normalised, so that the quotient has 63 or 64 bits; the result is below 2^64 and
    // above 2^-11, so it is not subnormal.
    let (up, down) = (mantissa.leading_zeros(), power.leading_zeros());
    let numerator = u128::from(mantissa << up) << 63;
    let divisor = u128::from(power << down);
    let quotient = (numerator / divisor) as u64;
    // The remainder is below 2^64: the low words alone tell whether there is one.
    let exact = quotient.wrapping_mul(power << down) == numerator as u64;
    let shift = 64 - 53 - quotient.leading_zeros();
    let kept = quotient >> shift;
    let rest = quotient & ((1 << shift) - 1);
    let half = 1 << (shift - 1);
    // What looks like a tie is above the middle where the division left a remainder.
    let is_up = rest > half || (rest == half && (!exact || kept & 1 == 1));
    let rounded = (kept + u64::from(is_up)) as f64;
    let exponent = shift as i32 - 63 - up as i32 + down as i32;
    rounded * f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// The number whose digits end at `end`, with an optional exponent, parsed by the standard library.
#[cold]
fn by_library(text: &[u8], mut end: usize) -> Option<(f64, usize)> {
    if matches!(text.get(end), Some(b'e' | b'E')) {
        let signed = matches!(text.get(end + 1), Some(b'+' | b'-'));
        let mut after = end + 1 + usize::from(signed);
        if take_digits(text, &mut after, &mut 0) > 0 {
            end = after;
        }
    }
    if end > MAX_BYTES {
        return None;
    }
    let number = std::str::from_utf8(&text[..end]).ok()?.parse().ok()?;
    Some((number, end))
}

/// The number in `text`, which may only have white space around it.
pub(super) fn whole(text: &[u8]) -> Option<f64> {
    let text = text.trim_ascii();
    leading(text).filter(|(_, end)| *end == text.len()).map(|(value, _)| value)
}

/// Appends the shortest text that reads back as exactly `value` (finite): "12", "0.1", "1e300".
pub(super) fn push(value: f64, text: &mut Vec<u8>) {
    // Writing into a vector cannot fail; the JSON writer is three times as fast as the standard library.
    let _ = serde_json::to_writer(&mut *text, &value);
    if text.ends_with(b".0") {
        text.truncate(text.len() - 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(word: &str) {
        let expected = word.parse::<f64>().unwrap();
        for tail in ["", " 7", "]", ",1", "e", "E+"] {
            let text = format!("{word}{tail}");
            let (value, bytes) = leading(text.as_bytes()).unwrap_or_else(|| panic!("{text}"));
            assert_eq!((value.to_bits(), bytes), (expected.to_bits(), word.len()), "{text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn like_the_standard_library(word in "[-+]?[0-9]{1,22}(\\.[0-9]{0,22})?(e[-+]?[0-9]{1,3})?") {
            check(&word);
        }

        #[test]
        fn long_coordinates(word in "-?[0-9]{1,7}\\.[0-9]{9,15}") {
            check(&word);
        }

        #[test]
        fn halves_and_what_is_beside_them(high in 1_u64 << 52..1 << 53, beside in -1_i64..=1) {
            check(&((high << 11) + 1024).wrapping_add_signed(beside).to_string());
        }

        #[test]
        fn shortest_texts_come_back(value in any::<f64>()) {
            prop_assume!(value.is_finite());
            let mut text = Vec::new();
            push(value, &mut text);
            prop_assert_eq!(whole(&text).map(f64::to_bits), Some(value.to_bits()));
        }
    }

    #[test]
    fn ties_and_borders() {
        for word in [
            "9007199254740993",
            "9007199254740995",
            "9007199254740992",
            "18014398509481990",
            "0.9007199254740993",
            "9999999999999999999",
            "0.9999999999999999999",
            "900719925474099.3",
            "4503599627370497.5",
            "4503599627370496.5",
            "1",
            "-0",
            "-0.0",
            ".5",
            "5.",
            "0.1",
            "1.8446744073709551615",
            "922337203685477580.8",
            "1844674407370955161.5",
        ] {
            check(word);
        }
    }

    #[test]
    fn all_else_is_none() {
        for word in ["", "-", ".", "+", "-.", "e5", "nan", "inf", "x", " 1"] {
            assert_eq!(leading(word.as_bytes()), None, "{word}");
        }
        assert_eq!(leading(&[b'1'; 4000]), None);
        assert_eq!(leading(b"1e999"), Some((f64::INFINITY, 5)));
    }
}
