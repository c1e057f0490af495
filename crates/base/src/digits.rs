//! Fast parsing of decimal digits.

/// Powers of ten that are exact in `f64`, by exponent.
pub const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// Integers up to this value are exact in `f64`.
pub const MAX_EXACT: u64 = 1 << 53;
/// This number of digits never overflows `u64`.
pub const MAX_DIGITS: usize = 19;

/// Digits with an optional decimal point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digits {
    /// The digits as an integer without the point; wraps beyond [`MAX_DIGITS`].
    pub mantissa: u64,
    /// Number of digits.
    pub count: usize,
    /// Number of digits after the point.
    pub decimals: usize,
    /// End of the digits in the text.
    pub end: usize,
}

impl Digits {
    /// The digits of `text` from `start`; there may be none.
    #[inline(always)]
    pub fn of(text: &[u8], start: usize) -> Self {
        let (mut mantissa, mut end) = (0, start);
        let whole = take_digits(text, &mut end, &mut mantissa);
        let mut decimals = 0;
        if text.get(end) == Some(&b'.') {
            end += 1;
            decimals = take_digits(text, &mut end, &mut mantissa);
        }
        Self { mantissa, count: whole + decimals, decimals, end }
    }
}

/// Appends the digits at `end` to `value` (which wraps), counts them and moves `end` past them.
#[inline(always)]
pub fn take_digits(text: &[u8], end: &mut usize, value: &mut u64) -> usize {
    let start = *end;
    while let Some(byte) = text.get(*end) {
        // Bytes below `0` wrap to above 9: one comparison for both ends.
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        *value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
        *end += 1;
    }
    *end - start
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_end_where_they_end() {
        for (text, mantissa, count, decimals, end) in [
            ("-12.50x", 1250, 4, 2, 6),
            ("-.5", 5, 1, 1, 3),
            ("-7.", 7, 1, 0, 3),
            ("-7.1.2", 71, 2, 1, 4),
            ("-", 0, 0, 0, 1),
            ("-.", 0, 0, 0, 2),
            ("-x", 0, 0, 0, 1),
        ] {
            let expected = Digits { mantissa, count, decimals, end };
            assert_eq!(Digits::of(text.as_bytes(), 1), expected, "{text}");
        }
        assert_eq!(Digits::of(b"1", 5).end, 5);
        let most = [b'9'; MAX_DIGITS];
        assert_eq!(Digits::of(&most, 0).mantissa, 10_u64.pow(19) - 1);
    }
}
