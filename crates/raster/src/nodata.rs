//! Detection of undeclared nodata values: heights that no terrain has.

use crate::grid::GridInfo;

/// Common nodata values, below any land and any sea floor but the deepest.
const USUAL: [f64; 5] = [-9999.0, -32_767.0, -32_768.0, -99_999.0, -999_999.0];
/// Floats below this are the lowest of their type, or intended to be.
const ABSURD: f64 = -1e30;

/// True for a stored value that cannot be a height: in files without a declared value it is void if other
/// files of the mosaic declare it.
pub(crate) fn is_no_height(stored: f64) -> bool {
    !stored.is_finite() || stored.abs() > -ABSURD || USUAL.contains(&stored)
}

/// The stored value to pass as `--nodata` if `lowest`, the lowest valid height of a grid or window, looks
/// like an undeclared nodata value. Exact for grids with scale and offset, if the scale is positive.
pub fn looks_like_nodata(lowest: f64, info: &GridInfo) -> Option<f64> {
    let absurd = (lowest < ABSURD && lowest.is_finite()).then_some(lowest);
    let usual = USUAL.into_iter().find(|stored| stored * info.scale + info.offset == lowest);
    usual.or(absurd)
}

/// Note on `samples` such samples.
pub fn undeclared_nodata(samples: u64, stored: f64) -> String {
    let value = if stored < ABSURD { format!("{stored:e}") } else { stored.to_string() };
    let subject = if samples == 1 { "1 sample is" } else { &format!("{samples} samples are") };
    format!("{subject} {value}, which looks like an undeclared nodata value; pass ‹nodata› {value}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GridOpenOptions, open};

    fn info() -> GridInfo {
        open("synth:rough,size=9", &GridOpenOptions::default()).unwrap().info().clone()
    }

    #[test]
    fn the_usual_values_and_the_lowest_floats_are_known() {
        let plain = info();
        for value in [-9999.0, -32_767.0, -32_768.0, -3.4e38, f64::from(f32::MIN)] {
            assert_eq!(looks_like_nodata(value, &plain), Some(value));
        }
        for value in [-430.0, -9998.9, -10_994.0, 0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(looks_like_nodata(value, &plain), None);
        }
        let scaled = GridInfo { scale: 0.1, offset: 5.0, ..plain };
        assert_eq!(looks_like_nodata(-32_768.0 * 0.1 + 5.0, &scaled), Some(-32_768.0));
        assert_eq!(looks_like_nodata(-32_768.0, &scaled), None);
    }

    #[test]
    fn the_line_says_what_to_pass() {
        let line = undeclared_nodata(12, -32_767.0);
        assert!(line.starts_with("12 samples are -32767,") && line.ends_with("‹nodata› -32767"));
        let line = undeclared_nodata(1, f64::from(f32::MIN));
        assert!(line.starts_with("1 sample is -3.4028234663852886e38,"), "{line}");
    }
}
