//! Bit sets, hashes of numbers, and an order-preserving map of signed to unsigned numbers.

use std::ops::Range;

/// A set of numbers below a bound.
#[derive(Clone, Debug, Default)]
pub struct BitSet {
    words: Vec<u64>,
}

impl BitSet {
    /// An empty set for numbers below `bound`.
    pub fn new(bound: usize) -> Self {
        Self { words: vec![0; bound.div_ceil(64)] }
    }

    /// Empties the set and allocates bits for numbers below `bound`.
    pub fn reset(&mut self, bound: usize) {
        self.words.clear();
        self.words.resize(bound.div_ceil(64), 0);
    }

    /// Adds a number; true when the set did not contain it.
    ///
    /// # Panics
    /// If the number is out of bounds.
    #[inline(always)]
    pub fn insert(&mut self, number: usize) -> bool {
        let (word, bit) = (&mut self.words[number / 64], 1 << (number % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    /// Removes a number.
    ///
    /// # Panics
    /// If the number is out of bounds.
    #[inline(always)]
    pub fn remove(&mut self, number: usize) {
        self.words[number / 64] &= !(1 << (number % 64));
    }

    /// True when the set contains the number; false out of bounds.
    #[inline(always)]
    pub fn contains(&self, number: usize) -> bool {
        self.words.get(number / 64).is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    /// The numbers in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.within(0..self.words.len() * 64)
    }

    /// The numbers within a range, ascending.
    ///
    /// # Panics
    /// If the range is out of bounds.
    pub fn within(&self, range: Range<usize>) -> impl Iterator<Item = usize> + Clone + '_ {
        let (first, end) = (range.start / 64, range.end.div_ceil(64));
        (first..end)
            .flat_map(|word| ones(self.words[word], word * 64))
            .filter(move |number| range.contains(number))
    }

    /// Words of 64 bits; the lowest number is the lowest bit.
    pub fn words(&self) -> &[u64] {
        &self.words
    }
}

/// Positions of the set bits of a word, counted from `base`.
fn ones(word: u64, base: usize) -> impl Iterator<Item = usize> + Clone {
    // The follower of zero is asked for before zero ends them: there a subtraction would overflow.
    std::iter::successors(Some(word), |word| Some(word & word.wrapping_sub(1)))
        .take_while(|&word| word != 0)
        .map(move |word| base + word.trailing_zeros() as usize)
}

/// A hash of some numbers (splitmix64, Steele et al. 2014).
pub fn mixed(words: &[u64]) -> u64 {
    words.iter().fold(0, |seed, word| {
        let mut x = (seed ^ word).wrapping_add(0x9E37_79B9_7F4A_7C15);
        x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    })
}

/// An unsigned number for a signed one that preserves the order.
pub fn ordered(value: i32) -> u64 {
    u64::from(value as u32 ^ 1 << 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn like_the_standard_library(
            steps in prop::collection::vec((any::<bool>(), 0_usize..200), 0..100),
            ends in (0_usize..=200, 0_usize..=200),
        ) {
            let (mut set, mut twin) = (BitSet::new(200), BTreeSet::new());
            for (is_added, number) in steps {
                if is_added {
                    prop_assert_eq!(set.insert(number), twin.insert(number));
                } else {
                    set.remove(number);
                    twin.remove(&number);
                }
                prop_assert_eq!(set.contains(number), is_added);
            }
            prop_assert!(set.iter().eq(twin.iter().copied()));
            let range = ends.0.min(ends.1)..ends.0.max(ends.1);
            prop_assert!(set.within(range.clone()).eq(twin.range(range).copied()));
            let ones: u32 = set.words().iter().map(|word| word.count_ones()).sum();
            prop_assert_eq!(ones as usize, twin.len());
            set.reset(10);
            prop_assert!(set.iter().next().is_none() && !set.contains(150));
        }
    }
}
