//! Aspect: the downslope direction.

use crate::relief::{Derivative, Gradient, Heights, Turn};

/// The direction of steepest descent, in degrees clockwise from north, in [0, 360).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aspect {
    /// Gradient algorithm.
    pub gradient: Gradient,
    /// Level ground has the aspect 0 instead of none.
    pub zero_for_flat: bool,
}

impl Derivative for Aspect {
    fn at(&self, heights: &Heights, turn: &Turn) -> f64 {
        let [east, north] = self.gradient.of(heights, turn);
        if east == 0.0 && north == 0.0 {
            return if self.zero_for_flat { 0.0 } else { f64::NAN };
        }
        let angle = (-east).atan2(-north).to_degrees();
        let angle = if angle < 0.0 { angle + 360.0 } else { angle };
        // A hair west of north is north once it is rounded; and so is zero of either sign.
        if angle as f32 >= 360.0 { 0.0 } else { angle + 0.0 }
    }

    fn range(&self) -> Option<[f64; 2]> {
        Some([0.0, 360.0])
    }
}
