//! The bound on vertical distances, in steps, and the exact test of a distance against it.

use crate::expansion::ProofExpansion;

/// Relative difference to a whole number of steps that counts as rounding.
const ROUNDING: f64 = 1e-12;
/// Whole bounds below this are compared in whole numbers.
const WHOLE: f64 = (1u64 << 40) as f64;
/// Share of a distance by which its value in `f64` may be off, generously.
const DOUBT: f64 = 1.0 / (1u64 << 44) as f64;

/// A bound on vertical distances, closed: distances equal to it are within.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerticalBound {
    steps: f64,
}

impl VerticalBound {
    /// `tolerance` (from 0 up) and the height of a step, in the same unit. Rounded to a whole number of steps where
    /// the difference is rounding.
    pub fn new(tolerance: f64, step: f64) -> Self {
        let steps = tolerance / step;
        let whole = steps.round();
        let is_whole = (steps - whole).abs() <= whole * ROUNDING;
        Self { steps: if is_whole { whole } else { steps } }
    }

    /// The bound in steps.
    pub fn steps(self) -> f64 {
        self.steps
    }

    /// Whether a distance of about `distance` is beyond; asks `exactly` when that is in doubt.
    pub(super) fn is_exceeded(self, distance: f64, exactly: impl FnOnce() -> bool) -> bool {
        let doubt = distance * DOUBT;
        if distance + doubt < self.steps {
            return false;
        }
        distance - doubt > self.steps || exactly()
    }

    /// Whether `|off| / area` (area above 0) is beyond.
    pub(super) fn is_below(self, off: i128, area: i64) -> bool {
        let (off, area) = (off.abs(), i128::from(area));
        if self.steps.fract() == 0.0 && self.steps < WHOLE {
            return off > self.steps as i128 * area;
        }
        let mut sum = ProofExpansion::default();
        sum.add_product(off, 1.0);
        sum.add_product(-area, self.steps);
        sum.is_positive_or_overflown()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_steps_are_found_through_rounding() {
        assert_eq!(VerticalBound::new(0.3, 0.1).steps(), 3.0);
        assert_eq!(VerticalBound::new(0.07, 0.01).steps(), 7.0);
        assert_eq!(VerticalBound::new(0.005, 0.01).steps(), 0.5);
        assert_eq!(VerticalBound::new(0.0, 0.01).steps(), 0.0);
        assert!(VerticalBound::new(0.300_000_1, 0.1).steps() > 3.0);
    }

    #[test]
    fn the_bound_itself_is_within() {
        let exceeds = |tolerance: f64, off: i128, area: i64| {
            let distance = off as f64 / area as f64;
            let bound = VerticalBound::new(tolerance, 1.0);
            bound.is_exceeded(distance, || bound.is_below(off, area))
        };
        let area = (1 << 60) + 7;
        assert!(!exceeds(5.0, 5 * i128::from(area), area));
        assert!(exceeds(5.0, 5 * i128::from(area) + 1, area));
        assert!(!exceeds(0.5, 5, 10) && exceeds(0.5, 6, 11));
        // The float 0.1 is a little above a tenth, the one below it is not.
        assert!(!exceeds(0.1, 1, 10) && exceeds(0.1f64.next_down(), 1, 10));
        assert!(!exceeds(0.0, 0, 9) && exceeds(0.0, 1, i64::MAX));
        assert!(!exceeds(f64::MAX, i128::from(area), 1));
    }
}
