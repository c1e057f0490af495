//! A set of small numbers, one bit each.

/// A set of numbers below a bound.
#[derive(Debug, Default)]
pub(super) struct BitSet {
    words: Vec<u64>,
}

impl BitSet {
    /// Empties the set and makes room for numbers below `bound`.
    pub(super) fn reset(&mut self, bound: usize) {
        self.words.clear();
        self.words.resize(bound.div_ceil(64), 0);
    }

    /// Adds a number; true when it was not in the set.
    #[inline(always)]
    pub(super) fn insert(&mut self, number: usize) -> bool {
        let (word, bit) = (&mut self.words[number / 64], 1 << (number % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    /// True when the number is in the set.
    #[inline(always)]
    pub(super) fn contains(&self, number: usize) -> bool {
        self.words[number / 64] & (1 << (number % 64)) != 0
    }

    /// Takes a number out.
    #[inline(always)]
    pub(super) fn remove(&mut self, number: usize) {
        self.words[number / 64] &= !(1 << (number % 64));
    }

    /// The numbers in ascending order.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words.iter().enumerate().flat_map(|(i, &word)| {
            let mut rest = word;
            std::iter::from_fn(move || {
                let bit = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
                rest &= rest - 1;
                Some(64 * i + bit)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_what_was_inserted_in_order() {
        let mut set = BitSet::default();
        set.reset(200);
        assert!([130, 0, 63, 64, 199].into_iter().all(|number| set.insert(number)));
        assert!(!set.insert(63) && set.contains(63) && !set.contains(62));
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 63, 64, 130, 199]);
        set.remove(64);
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 63, 130, 199]);
        set.reset(10);
        assert_eq!(set.iter().count(), 0);
    }
}
