//! Positions by number, so that the same ones are known as the same.

use super::Lines;

/// The number of a position that the original does not have.
pub(super) const FOREIGN: u32 = u32::MAX;

/// All positions of the original, each once.
pub(super) struct Positions {
    sorted: Vec<[u64; 2]>,
}

impl Positions {
    /// O(n log n).
    pub(super) fn new(lines: &Lines<'_>) -> Self {
        let mut sorted: Vec<_> = (0..lines.points.len()).map(|v| key(lines.at(v))).collect();
        sorted.sort_unstable();
        sorted.dedup();
        Self { sorted }
    }

    /// The number of each vertex's position.
    pub(super) fn ids(&self, lines: &Lines<'_>) -> Vec<u32> {
        let id = |v: usize| match self.sorted.binary_search(&key(lines.at(v))) {
            Ok(at) => at as u32,
            Err(_) => FOREIGN,
        };
        (0..lines.points.len()).map(id).collect()
    }
}

/// Bits that are the same for the same numbers, -0 and 0 among them.
fn key(at: [f64; 2]) -> [u64; 2] {
    at.map(|v| (v + 0.0).to_bits())
}
