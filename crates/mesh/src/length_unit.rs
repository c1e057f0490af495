//! Comparison of length units.

/// True if two units in metres differ by rounding only. The foot and the US survey foot differ by 2e-6.
pub(super) fn is_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 1e-9
}
