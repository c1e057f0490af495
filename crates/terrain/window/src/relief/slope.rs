//! Slope: how steep the ground is.

use crate::relief::{Derivative, Gradient, Heights, Turn};

/// The angle between the ground and a level plane, in degrees from 0 to 90; or a hundred times its tangent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Gradient algorithm.
    pub gradient: Gradient,
    /// In per cent, not in degrees.
    pub is_percent: bool,
}

impl Derivative for Slope {
    fn at(&self, heights: &Heights, turn: &Turn) -> f64 {
        let [east, north] = self.gradient.of(heights, turn);
        let steep = (east * east + north * north).sqrt();
        if self.is_percent { steep * 100.0 } else { steep.atan().to_degrees() }
    }

    fn range(&self) -> Option<[f64; 2]> {
        (!self.is_percent).then_some([0.0, 90.0])
    }
}
