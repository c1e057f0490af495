//! Roughness: how much heights differ around a sample.

use crate::relief::{Derivative, Heights, Turn};

/// The highest of nine heights less the lowest (Wilson et al. 2007), in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Roughness;

impl Derivative for Roughness {
    fn at(&self, heights: &Heights, _: &Turn) -> f64 {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let [low, high] = heights.iter().fold(none, |[low, high], z| [low.min(*z), high.max(*z)]);
        high - low
    }

    fn is_of_slopes(&self) -> bool {
        false
    }
}
