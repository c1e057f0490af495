//! Work queue of parts: each thread reads its own range of the files, and then half of the longest range left.

use std::ops::Range;
use std::sync::Mutex;

use terrane_files::lock;

/// The parts that are not yet taken, by thread.
pub(super) struct ReadQueue(Vec<Mutex<Range<usize>>>);

impl ReadQueue {
    /// `parts` parts for at least one thread.
    pub(super) fn new(parts: usize, threads: usize) -> Self {
        let ranges = (0..threads).map(|thread| {
            let [start, end] = [thread, thread + 1]
                .map(|thread| (parts as u128 * thread as u128 / threads as u128) as usize);
            Mutex::new(start..end)
        });
        Self(ranges.collect())
    }

    /// The next part for `thread`.
    pub(super) fn take(&self, thread: usize) -> Option<usize> {
        loop {
            if let Some(part) = lock(&self.0[thread]).next() {
                return Some(part);
            }
            let stolen = self.steal()?;
            *lock(&self.0[thread]) = stolen;
        }
    }

    /// The second half of the longest range; `None` if nothing is left.
    fn steal(&self) -> Option<Range<usize>> {
        let longest = self.0.iter().max_by_key(|stretch| lock(stretch).len())?;
        let mut stretch = lock(longest);
        let middle = stretch.start + stretch.len() / 2;
        let stolen = middle..stretch.end;
        stretch.end = middle;
        (!stolen.is_empty()).then_some(stolen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_taken_once() {
        for (parts, threads) in [(0, 1), (1, 3), (10, 1), (10, 3), (1000, 7)] {
            let queue = ReadQueue::new(parts, threads);
            let mut taken: Vec<usize> = std::iter::from_fn(|| queue.take(threads - 1)).collect();
            assert_eq!(taken.len(), parts, "one thread does all when the others do nothing");
            taken.sort_unstable();
            assert!(taken.into_iter().eq(0..parts));
        }
    }
}
