//! Topographic position: whether a sample lies above its surroundings.

use crate::relief::{Derivative, Heights, Turn};

/// Topographic position index: the height less the mean of the eight around it (Weiss 2001), in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TopographicPositionIndex;

impl Derivative for TopographicPositionIndex {
    fn at(&self, heights: &Heights, _: &Turn) -> f64 {
        let [a, b, c, d, here, f, g, h, i] = *heights;
        here - (a + b + c + d + f + g + h + i) / 8.0
    }

    fn is_of_slopes(&self) -> bool {
        false
    }
}
