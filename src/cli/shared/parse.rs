//! Values of arguments: sizes, heights, boxes. Each parser says what it expected.

use terrane_options::Codec;

use crate::jobs::options::{Bounds, Bytes, Finite, FiniteOrNan};

/// A value, or what was expected.
type Parsed<T> = Result<T, String>;

/// Bytes from "128M", "4GiB", "512 MiB", "1.5g", "1000000": K, M, G and T are powers of 1024, with
/// or without "B" or "iB". Fewer than a megabyte are a unit forgotten.
pub(crate) fn bytes(text: &str) -> Parsed<u64> {
    Bytes::parse(text)
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Parsed<f64> {
    Finite::parse(text)
}

/// A finite number or NaN, as nodata values are.
pub(crate) fn finite_or_nan(text: &str) -> Parsed<f64> {
    FiniteOrNan::parse(text)
}

/// A finite number above zero.
pub(crate) fn positive(text: &str) -> Parsed<f64> {
    finite(text).ok().filter(|v| *v > 0.0).ok_or_else(|| "expected a number above zero".to_owned())
}

/// Degrees of a light above the horizon, 1 to 90.
pub(crate) fn altitude(text: &str) -> Parsed<f64> {
    let value = finite(text).ok().filter(|v| (1.0..=90.0).contains(v));
    value.ok_or_else(|| "expected degrees from 1 to 90".to_owned())
}

/// "xmin,ymin,xmax,ymax".
pub(crate) fn bbox(text: &str) -> Parsed<[f64; 4]> {
    Bounds::parse(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        let good =
            [("128M", 128 << 20), ("4GiB", 4 << 30), ("512 MiB", 512 << 20), ("2tb", 2 << 40)];
        for (text, value) in good.into_iter().chain([("1536k", 3 << 19), ("2000000", 2_000_000)]) {
            assert_eq!(bytes(text), Ok(value), "{text}");
        }
        for text in ["1", "512", "1023K"] {
            assert!(
                bytes(text).is_err_and(|e| e.contains("at least 1M") && e.contains("K, M or G"))
            );
        }
        for text in ["", "M", "-1M", "0", "4X", "1e9", "1..5M", "99999999T", "4 G i B", "NaN"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn boxes_have_an_inside() {
        assert_eq!(bbox("-1, 2,3,4.5"), Ok([-1.0, 2.0, 3.0, 4.5]));
        for text in ["1,2,3", "1,2,3,4,5", "3,2,1,4", "1,2,1,4", "a,b,c,d", "1,2,inf,4"] {
            assert!(bbox(text).is_err(), "{text}");
        }
    }
}
