//! The exact decision: is a sample within the tolerance of the plane of three vertices?
//!
//! Written with integer barycentric weights, |sum of w * (z - h)| <= tolerance * sum of w. Plain
//! `f64` decides almost always; close calls are decided in double-double arithmetic (Dekker 1971,
//! Knuth TAOCP 4.2.2), which is exact for heights of up to 53 significant bits.
//!
//! Coordinates inside a tile are small integers, so orientation and in-circle tests are exact in `i64`.
//! Distances are computed in `f32`; samples within a hair of the tolerance are decided again here, with
//! *less than or equal*. The tolerance itself is never shrunk. Where a format stores heights in `f32`,
//! the vertex heights are rounded first and the bound is kept for the rounded ones; heights beyond 16384
//! that are not f32 already are stored relative to a height nearby, recorded with the origin of x and y.

use super::heights::HeightField;
use super::lattice_position::TilePosition;
use terrane_base::geom::predicates::orient;

/// Relative rounding error of the plain evaluation, with a margin.
const DOUBT: f64 = 1e-14;

/// True if `height` is within `tolerance` of the plane with heights `z` at the corners and barycentric weights
/// `weights` (non-negative, not all zero).
pub(super) fn within(weights: [i64; 3], z: [f64; 3], height: f64, tolerance: f64) -> bool {
    let weights = weights.map(|w| w as f64);
    let total: f64 = weights.iter().sum();
    let mut offset = 0.0;
    let mut scale = tolerance * total;
    for (weight, z) in weights.iter().zip(z) {
        offset += weight * (z - height);
        scale += weight * (z.abs() + height.abs());
    }
    let excess = offset.abs() - tolerance * total;
    // The terms and sums above lose less than 1e-15 of `scale` (weights are integers below 2^53 and
    // not rounded); ten times that is left to doubt.
    if excess.abs() > DOUBT * scale {
        return excess < 0.0;
    }
    let [a, b, c] = weights;
    // Differences of heights would be rounded. Each height has a product of its own instead, which
    // double-double holds exactly.
    let terms = [(a, z[0]), (b, z[1]), (c, z[2]), (-a, height), (-b, height), (-c, height)];
    is_at_most(terms, tolerance, total)
}

/// True if the absolute sum of the products of `terms` is at most `tolerance` times `total`.
pub(super) fn is_at_most<const N: usize>(
    terms: [(f64, f64); N],
    tolerance: f64,
    total: f64,
) -> bool {
    let products = terms.into_iter().map(|(weight, z)| DoubleDouble::product(weight, z));
    let sum = products.fold(DoubleDouble::default(), DoubleDouble::add);
    let distance =
        if sum.high < 0.0 { DoubleDouble { high: -sum.high, low: -sum.low } } else { sum };
    distance.add(DoubleDouble::product(-tolerance, total)).high <= 0.0
}

/// An unevaluated sum of two doubles, the second below half a unit of the first.
#[derive(Clone, Copy, Debug, Default)]
struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    fn two_sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let shadow = high - a;
        Self { high, low: (a - (high - shadow)) + (b - shadow) }
    }

    fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        // A fused multiply-add rounds once, so it gives the error of the product exactly.
        Self { high, low: a.mul_add(b, -high) }
    }

    fn add(self, other: Self) -> Self {
        // Both halves are added with their errors. The shorter form drops the error of the low half, which
        // is all that is left where the high halves cancel, as in close calls.
        let high = Self::two_sum(self.high, other.high);
        let low = Self::two_sum(self.low, other.low);
        let first = Self::two_sum(high.high, high.low + low.high);
        Self::two_sum(first.high, first.low + low.low)
    }
}

/// True if two heights are no further apart than `tolerance`, in exact arithmetic.
pub(super) fn are_within(a: f64, b: f64, tolerance: f64) -> bool {
    let DoubleDouble { high, low } = DoubleDouble::two_sum(a, -b);
    // Rounding keeps the order: only a distance that is rounded to the tolerance may be above it.
    high.abs() < tolerance || (high.abs() == tolerance && high.signum() * low <= 0.0)
}

/// Result of an exact scan of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExactWorst {
    /// Largest |sample - plane|, in `f64`.
    pub(super) error: f64,
    /// Its position, the lowest (row, column) of a tie; undefined if the error is 0.
    pub(super) at: TilePosition,
    /// True if every sample is within the tolerance (inclusive).
    pub(super) within: bool,
}

/// Scans every valid sample of the closed triangle `p` at full resolution in `f64`. Time linear in the number of
/// samples in the triangle's bounding rows.
pub(super) fn scan(field: &HeightField, p: [TilePosition; 3], tolerance: f64) -> ExactWorst {
    let z = field.vertices(p);
    let mut worst = ExactWorst { error: 0.0, at: TilePosition::new(0, 0), within: true };
    for_each_sample(p, field.scan_bounds(), |at, weights| {
        let height = field.sample(at);
        let error = distance(weights, z, height);
        let close = error >= tolerance * (1.0 - 1e-9);
        let fails = close && !within(weights, z, height, tolerance);
        // A sample that fails exactly beats all that do not, even where the rounded errors order them the
        // other way.
        if (fails && worst.within) || (error > worst.error && fails != worst.within) {
            worst = ExactWorst { error, at, within: !fails };
        }
    });
    worst
}

/// |height - plane| in plain `f64`.
pub(super) fn distance(weights: [i64; 3], z: [f64; 3], height: f64) -> f64 {
    let [a, b, c] = weights.map(|w| w as f64);
    ((a * (z[0] - height) + b * (z[1] - height) + c * (z[2] - height)) / (a + b + c)).abs()
}

/// Visits the samples of the closed triangle `p` within `bounds` in (row, column) order, with
/// their barycentric weights.
pub(super) fn for_each_sample(
    p: [TilePosition; 3],
    bounds: [i32; 4],
    mut visit: impl FnMut(TilePosition, [i64; 3]),
) {
    let [a, b, c] = p.map(TilePosition::lattice);
    let [cols, rows] = [0, 1].map(|axis| {
        let first = a[axis].min(b[axis]).min(c[axis]).max(bounds[2 * axis]);
        first..=a[axis].max(b[axis]).max(c[axis]).min(bounds[2 * axis + 1])
    });
    for row in rows {
        let mut entered = false;
        for col in cols.clone() {
            let q = [col, row];
            let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
            if weights.iter().all(|&w| w >= 0) {
                entered = true;
                visit(TilePosition::new(col as u32, row as u32), weights);
            } else if entered {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_tolerance_itself_is_within_and_the_next_number_is_not() {
        let third = [1, 1, 1];
        assert!(within(third, [0.0, 0.0, 3.0], 0.0, 1.0));
        assert!(!within(third, [0.0, 0.0, 3.0_f64.next_up()], 0.0, 1.0));
        assert!(!within(third, [0.0, 0.0, 3.0], 0.0, 1.0_f64.next_down()));
        assert!(within([1, 0, 0], [5.5; 3], 5.5, 0.0));
        assert!(!within([1, 0, 0], [5.5; 3], 5.5_f64.next_up(), 0.0));
        // On the plane, but differences of such heights are rounded.
        let z = [-31_144_411_135.999_504, 30_151_737_344.000_656, 1_985_347_593.999_422];
        assert!(within([2, 2, 1], z, 2.000_345_230_102_539, 0.0));
    }

    #[test]
    fn a_sum_keeps_the_last_part_when_all_before_it_cancels() {
        let power = |exponent: i32| 2.0_f64.powi(exponent);
        let a = DoubleDouble { high: power(103), low: -power(50) };
        for last in [power(-10), -power(-10), 0.0] {
            let b = DoubleDouble { high: power(50) - power(103), low: last };
            for sum in [a.add(b), b.add(a)] {
                assert_eq!([sum.high, sum.low], [last, 0.0]);
            }
        }
    }

    /// A sample that is off by the tolerance and the last bit of it is found among all others.
    #[test]
    fn a_scan_tells_the_last_bit_beyond_the_tolerance() {
        let p = [(0, 0), (9, 0), (0, 9)].map(|(col, row)| TilePosition::new(col, row));
        let scanned = |height: f64| {
            let mut z = vec![0.0; 100];
            (z[33], z[52]) = (height, 2.0);
            let rounded: Vec<f32> = z.iter().map(|&z| z as f32).collect();
            let heights = crate::heights::HeightWindow {
                width: 10,
                height: 10,
                f32: &rounded,
                f64: Some(&z),
            };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, 10, 10], [0; 4], None);
            scan(&field, p, 3.0)
        };
        for (height, within) in [
            (3.0, true),
            (3.0_f64.next_up(), false),
            (3.0 + 2e-9, false),
            (3.5, false),
            (2.9, true),
        ] {
            let worst = scanned(height);
            assert_eq!((worst.within, worst.at), (within, TilePosition::new(3, 3)), "{height}");
            assert!((worst.error - height).abs() < 1e-12);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        /// Heights of fifty bits and weights of twenty-six: floats round, and whole numbers do not. By
        /// turns one of the numbers alone is large.
        #[test]
        fn close_calls_of_long_numbers_agree_with_integer_arithmetic(
            weights in [0_i64..1 << 26, 0_i64..1 << 26, 1_i64..1 << 26],
            z in prop::array::uniform3(-(1_i64 << 50)..1 << 50), height in -(1_i64 << 50)..1 << 50,
            short in prop::array::uniform4(prop_oneof![Just(0), Just(20), Just(45)]), slack in -1_i64..=1, near: bool
        ) {
            let z: [i64; 3] = std::array::from_fn(|i| z[i] >> short[i]);
            let plane: i128 = weights.iter().zip(z).map(|(&w, z)| i128::from(w) * i128::from(z)).sum();
            let middle = (plane / weights.iter().map(|&w| i128::from(w)).sum::<i128>()) as i64;
            // Next to the plane the largest numbers all but cancel.
            let height = if near { middle + (height >> 44) } else { height >> short[3] };
            let offset: i128 = weights.iter().zip(z)
                .map(|(&w, z)| i128::from(w) * i128::from(z - height)).sum();
            let total: i128 = weights.iter().map(|&w| i128::from(w)).sum();
            // The tolerance is a float next to the error: as many bits behind the point as it has.
            let bits = (offset.abs() / total).leading_zeros().saturating_sub(76).min(40);
            let tolerance = ((offset.abs() << bits) / total + i128::from(slack)).max(0);
            let expected = offset.abs() << bits <= tolerance * total;
            let float = tolerance as f64 / (1_u64 << bits) as f64;
            let found = within(weights, z.map(|v| v as f64), height as f64, float);
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn agrees_with_integer_arithmetic(
            weights in [0_i64..1 << 26, 0_i64..1 << 26, 1_i64..1 << 26],
            z in [-9000_i64..9000, -9000_i64..9000, -9000_i64..9000],
            height in -9000_i64..9000, slack in -1_i64..=1
        ) {
            let offset: i128 = weights.iter().zip(z)
                .map(|(&w, z)| i128::from(w) * i128::from(z - height)).sum();
            let total: i128 = weights.iter().map(|&w| i128::from(w)).sum();
            let tolerance = ((offset.abs() / total) as i64 + slack).max(0);
            let expected = offset.abs() <= i128::from(tolerance) * total;
            let found = within(weights, z.map(|v| v as f64), height as f64, tolerance as f64);
            prop_assert_eq!(found, expected);
        }
    }
}
