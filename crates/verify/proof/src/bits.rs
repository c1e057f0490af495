//! Rows of bits: sets of samples or cells of a rectangle.

/// `rows` rows of `width` bits, each row starting at a word.
#[derive(Clone, Debug)]
pub(crate) struct BitGrid {
    stride: usize,
    words: Vec<u64>,
}

impl BitGrid {
    /// All bits clear.
    pub(crate) fn new(width: usize, rows: usize) -> Self {
        let stride = width.div_ceil(64).max(1);
        Self { stride, words: vec![0; stride * rows] }
    }

    /// The words of a row, lowest column in the lowest bit.
    pub(crate) fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.stride..][..self.stride]
    }

    /// The words of a row, to change.
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [u64] {
        &mut self.words[row * self.stride..][..self.stride]
    }

    /// One bit.
    pub(crate) fn get(&self, col: usize, row: usize) -> bool {
        self.row(row)[col / 64] >> (col % 64) & 1 == 1
    }

    /// Sets one bit.
    pub(crate) fn set(&mut self, col: usize, row: usize) {
        self.row_mut(row)[col / 64] |= 1 << (col % 64);
    }

    /// Sets the bits `from .. to` of a row.
    pub(crate) fn set_range(&mut self, row: usize, from: usize, to: usize) {
        let words = self.row_mut(row);
        for (word, mask) in masks(from, to) {
            words[word] |= mask;
        }
    }
}

/// The words touched by the columns `from .. to`, each with the mask of those columns.
#[inline]
pub(crate) fn masks(from: usize, to: usize) -> impl Iterator<Item = (usize, u64)> {
    let words = if from < to { from / 64..to.div_ceil(64) } else { 0..0 };
    words.map(move |word| {
        let low = from.saturating_sub(word * 64);
        let high = (to - word * 64).min(64);
        (word, (u64::MAX >> (64 - (high - low))) << low)
    })
}

/// The set bits of a word, lowest first.
pub(crate) fn ones(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if word == 0 {
            return None;
        }
        let bit = word.trailing_zeros() as usize;
        word &= word - 1;
        Some(bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_set_exactly_their_bits() {
        for (from, to) in
            [(0, 0), (5, 5), (0, 1), (63, 65), (3, 200), (64, 128), (0, 64), (199, 200)]
        {
            let mut bits = BitGrid::new(200, 2);
            bits.set_range(1, from, to);
            for col in 0..200 {
                assert_eq!(bits.get(col, 1), (from..to).contains(&col), "{from}..{to} at {col}");
                assert!(!bits.get(col, 0));
            }
        }
    }

    #[test]
    fn ones_lists_set_bits() {
        assert_eq!(ones(0b1010_0001).collect::<Vec<_>>(), [0, 5, 7]);
        assert_eq!(ones(1 << 63).collect::<Vec<_>>(), [63]);
    }
}
