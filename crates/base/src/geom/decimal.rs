//! Exact decimal numbers: values that people write and formats store in `f64` are decimals, and a step of a lattice
//! is a multiple of their last digit.

use crate::digits::{MAX_EXACT, POWERS};

/// mantissa / 10^digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decimal {
    mantissa: i128,
    digits: u32,
}

impl Decimal {
    /// The shortest decimal that reads as `value`; `None` for those beyond 38 digits.
    pub fn of(value: f64) -> Option<Self> {
        let text = format!("{value:e}");
        let (number, exponent) = text.split_once('e')?;
        let (whole, part) = number.split_once('.').unwrap_or((number, ""));
        let mantissa: i128 = format!("{whole}{part}").parse().ok()?;
        let exponent = exponent.parse::<i32>().ok()? - i32::try_from(part.len()).ok()?;
        match u32::try_from(-exponent) {
            Ok(digits) => Some(Self { mantissa, digits }),
            Err(_) => {
                let ten = 10_i128.checked_pow(exponent.unsigned_abs())?;
                Some(Self { mantissa: mantissa.checked_mul(ten)?, digits: 0 })
            }
        }
    }

    /// A whole number of units of 10^-`digits`.
    pub const fn new(mantissa: i128, digits: u32) -> Self {
        Self { mantissa, digits }
    }

    /// Digits after the point.
    pub fn digits(self) -> u32 {
        self.digits
    }

    /// In units of 10^-`digits`, at least the digits of this number; `None` on overflow.
    pub fn units(self, digits: u32) -> Option<i128> {
        let ten = 10_i128.checked_pow(digits.checked_sub(self.digits)?)?;
        self.mantissa.checked_mul(ten)
    }

    /// The nearest `f64`.
    pub fn value(self) -> f64 {
        match POWERS.get(self.digits as usize) {
            // One division of exact numbers rounds once.
            Some(power) if self.mantissa.unsigned_abs() <= MAX_EXACT.into() => {
                self.mantissa as f64 / power
            }
            _ => format!("{}e-{}", self.mantissa, self.digits).parse().unwrap_or(f64::NAN),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn values_come_back(mantissa in -1_000_000_000_000_i64..1_000_000_000_000, digits in 0_u32..25) {
            let value: f64 = format!("{mantissa}e-{digits}").parse().unwrap();
            prop_assert_eq!(Decimal::new(mantissa.into(), digits).value().to_bits(), (value + 0.0).to_bits());
            let shortest = Decimal::of(value).unwrap();
            prop_assert!(shortest.digits() <= digits && shortest.value() == value);
            prop_assert_eq!(shortest.units(digits), Some(mantissa.into()));
        }
    }

    #[test]
    fn all_sizes() {
        for (value, mantissa, digits) in [
            (0.0, 0, 0),
            (326.9, 3269, 1),
            (-0.001, -1, 3),
            (5e6, 5_000_000, 0),
            (1e-7, 1, 7),
            (1.0 / 3600.0, 2_777_777_777_777_778, 19),
        ] {
            assert_eq!(Decimal::of(value), Some(Decimal::new(mantissa, digits)), "{value}");
        }
        assert_eq!((Decimal::of(f64::NAN), Decimal::of(f64::INFINITY)), (None, None));
        assert_eq!((Decimal::of(1e300), Decimal::new(5, 1).units(0)), (None, None));
    }
}
