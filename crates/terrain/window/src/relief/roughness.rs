//! Roughness: how much heights differ around a sample.

use crate::relief::{Derivative, Heights, Turn};

/// The highest of nine heights less the lowest (Wilson et al. 2007), in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Roughness;

impl Derivative for Roughness {
    fn at(&self, heights: &Heights, _: &Turn) -> f64 {
        let ends = |[low, high]: [f64; 2], z: &f64| [low.min(*z), high.max(*z)];
        let [low, high] = heights.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
        high - low
    }

    fn is_of_slopes(&self) -> bool {
        false
    }
}
