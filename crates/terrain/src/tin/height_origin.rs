//! The height that formats of single precision store heights relative to.

use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_raster::GridSource;

/// Heights up to this magnitude are moved by less than a thousandth when rounded to `f32`.
const NEAR_ENOUGH: f64 = 16_384.0;
/// Samples probed along each side.
const PROBES: u64 = 16;

/// A short number near the heights of `source`, where they are so far from 0 that `f32` would move
/// them; 0 otherwise, and always where `f32` holds them as they are. Reads a few samples.
pub(super) fn height_origin(source: &dyn GridSource) -> Result<f64> {
    let info = source.info();
    if info.exact_in_f32() {
        return Ok(0.0);
    }
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in probes(info.height) {
        for col in probes(info.width) {
            let mut height = [0.0];
            source.read_f64(Rect::new(col, row, 1, 1), &mut height)?;
            low = low.min(height[0]);
            high = high.max(height[0]);
        }
    }
    Ok(height_origin_of(low, high))
}

/// Indices of samples evenly along a side.
fn probes(side: u32) -> impl Iterator<Item = u32> {
    (0..PROBES).map(move |i| (u64::from(side - 1) * i / (PROBES - 1)) as u32)
}

/// A short number near heights from `low` to `high`, where they are so far from 0 that `f32` would move them; else 0.
pub fn height_origin_of(low: f64, high: f64) -> f64 {
    let (middle, spread) = (f64::midpoint(low, high), high - low);
    if !middle.is_finite() || middle.abs() < NEAR_ENOUGH || middle.abs() < 2.0 * spread {
        return 0.0;
    }
    let unit = (spread.max(middle.abs() / 1024.0) / 8.0).log2().floor().exp2();
    (middle / unit).round() * unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_chosen_far_from_zero_only() {
        for (low, high) in [(0.0, 9000.0), (-20_000.0, 20_000.0), (f64::INFINITY, -f64::INFINITY)] {
            assert_eq!(height_origin_of(low, high), 0.0);
        }
        for middle in [2e7, -1e9, 20_000.0] {
            let origin = height_origin_of(middle - 3.0, middle + 3.0);
            assert!((origin - middle).abs() <= middle.abs() / 8192.0, "{origin}");
            assert!(origin.to_string().len() < 12, "{origin}");
        }
    }
}
