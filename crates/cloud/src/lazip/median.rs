//! The middle of recent values.

use std::hint::select_unpredictable;

/// Five values in order. One that comes in drives out the largest or the smallest, by turns.
#[derive(Clone, Copy)]
pub(super) struct Median {
    values: [i32; 5],
    drops_largest: bool,
}

impl Median {
    /// Five zeros.
    pub(super) const fn new() -> Self {
        Self { values: [0; 5], drops_largest: true }
    }

    /// The middle value.
    #[inline(always)]
    pub(super) fn get(&self) -> i32 {
        self.values[2]
    }

    /// Takes a value in.
    #[inline(always)]
    pub(super) fn add(&mut self, value: i32) {
        let [a, b, c, d, e] = self.values;
        let drops_largest = self.drops_largest;
        let kept = [(a, b), (b, c), (c, d), (d, e)]
            .map(|(left, right)| select_unpredictable(drops_largest, left, right));
        self.drops_largest = (value < c) | (!drops_largest & (value == c));
        self.values = [
            value.min(kept[0]),
            value.min(kept[1]).max(kept[0]),
            value.min(kept[2]).max(kept[1]),
            value.min(kept[3]).max(kept[2]),
            value.max(kept[3]),
        ];
    }
}
