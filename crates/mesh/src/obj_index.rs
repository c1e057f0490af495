//! Sparse index of the lines of a text file, in bounded memory.

/// Maximum recorded positions of a kind of line.
const MAX_MARKS: usize = 1 << 16;

/// Position of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TextLineMark {
    /// Byte offset.
    pub(super) offset: u64,
    /// Line number, from 1.
    pub(super) line: u64,
    /// Vertices defined on earlier lines.
    pub(super) vertices: u64,
}

/// Positions of every `stride`-th line of a kind. The stride doubles when there are too many.
#[derive(Debug)]
pub(super) struct SparseIndex {
    marks: Vec<TextLineMark>,
    stride: u64,
    count: u64,
    max_marks: usize,
}

impl SparseIndex {
    pub(super) fn new() -> Self {
        Self::with_max_marks(MAX_MARKS)
    }

    fn with_max_marks(max_marks: usize) -> Self {
        Self { marks: Vec::new(), stride: 64, count: 0, max_marks }
    }

    /// Number of lines.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Adds the next line.
    pub(super) fn note(&mut self, mark: TextLineMark) {
        if self.count.is_multiple_of(self.stride) {
            self.evict();
        }
        if self.count.is_multiple_of(self.stride) {
            self.marks.push(mark);
        }
        self.count += 1;
    }

    /// The last recorded line at or before a line: its index and position.
    pub(super) fn before(&self, line: u64) -> (u64, TextLineMark) {
        let at = usize::try_from(line / self.stride).unwrap_or(usize::MAX);
        let at = at.min(self.marks.len().saturating_sub(1));
        let start = TextLineMark { offset: 0, line: 1, vertices: 0 };
        (at as u64 * self.stride, self.marks.get(at).copied().unwrap_or(start))
    }

    fn evict(&mut self) {
        if self.marks.len() == self.max_marks {
            let mut is_even = false;
            self.marks.retain(|_| {
                is_even = !is_even;
                is_even
            });
            self.stride *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_found_however_few_are_remembered() {
        for most in [2, 5, 8, 1000] {
            let mut index = SparseIndex::with_max_marks(most);
            for i in 0..5000 {
                index.note(TextLineMark { offset: 10 * i, line: i + 1, vertices: i });
                assert!(index.marks.len() <= most);
            }
            assert_eq!(index.count(), 5000);
            for wanted in 0..5000 {
                let (line, mark) = index.before(wanted);
                assert!(line <= wanted && wanted - line < index.stride);
                assert_eq!(
                    mark,
                    TextLineMark { offset: 10 * line, line: line + 1, vertices: line }
                );
            }
        }
    }
}
