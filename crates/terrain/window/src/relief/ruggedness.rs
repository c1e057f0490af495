//! Ruggedness: how far the heights around a sample are from its own.

use crate::relief::{Derivative, Heights, Turn};

/// How differences are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RuggednessMeasure {
    /// The root of the sum of squares (Riley et al. 1999): for the land.
    #[default]
    Riley,
    /// The mean of the absolute differences (Wilson et al. 2007): for the floor of the sea.
    Wilson,
}

/// Terrain ruggedness index: of the eight differences between a height and those around it, in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ruggedness(pub RuggednessMeasure);

impl Derivative for Ruggedness {
    fn at(&self, heights: &Heights, _: &Turn) -> f64 {
        let off = heights.map(|height| height - heights[4]);
        match self.0 {
            RuggednessMeasure::Riley => off.iter().map(|off| off * off).sum::<f64>().sqrt(),
            RuggednessMeasure::Wilson => off.iter().map(|off| off.abs()).sum::<f64>() / 8.0,
        }
    }

    fn is_of_slopes(&self) -> bool {
        false
    }
}
