//! Records sorted by key outside memory: buckets of ranges of keys, and buckets within a bucket that is too large.

use std::path::{Path, PathBuf};

use bytemuck::Pod;

use super::Buckets;
use terrane_base::error::Result;

/// Ranges into which keys are divided.
const BUCKETS: u128 = 256;

/// A record with a sort key. Records of equal keys are merged into one.
pub trait KeyedRecord: Pod + Send + Sync {
    /// Sort key.
    fn key(&self) -> u128;

    /// Adds a record of the same key. The order of merges must not matter.
    fn merge(&mut self, other: &Self);
}

/// Collects records from any thread, then passes them on in the order of their keys, one per key.
#[derive(Debug)]
pub struct AggregatedRecords<T> {
    buckets: Buckets<T>,
    low: u128,
    /// Keys per bucket.
    width: u128,
    budget: u64,
    folder: PathBuf,
}

impl<T: KeyedRecord> AggregatedRecords<T> {
    /// For keys of about `low` to `high`, in about `budget` bytes of memory and unnamed files in `folder`. Keys outside are
    /// allowed.
    pub fn new(folder: &Path, [low, high]: [u128; 2], budget: u64) -> Self {
        let width = high.saturating_sub(low) / BUCKETS + 1;
        let buckets = Buckets::new(folder, BUCKETS as usize, budget / 2);
        Self { buckets, low, width, budget, folder: folder.to_path_buf() }
    }

    /// Adds records, and clears the list.
    ///
    /// # Errors
    /// A temporary file that cannot be written.
    pub fn push(&self, records: &mut Vec<T>) -> Result<()> {
        merge_sorted(records);
        for run in records.chunk_by(|a, b| self.bucket(a.key()) == self.bucket(b.key())) {
            self.buckets.push(self.bucket(run[0].key()), run)?;
        }
        records.clear();
        Ok(())
    }

    fn bucket(&self, key: u128) -> usize {
        (key.saturating_sub(self.low) / self.width).min(BUCKETS - 1) as usize
    }

    /// Bytes written to files so far.
    pub fn spilled(&self) -> u64 {
        self.buckets.spilled()
    }

    /// Passes on all records in the order of their keys.
    ///
    /// # Errors
    /// A temporary file that cannot be read or written; errors of `each`.
    pub fn read(self, each: &mut dyn FnMut(&T) -> Result<()>) -> Result<()> {
        (0..BUCKETS as usize).try_for_each(|bucket| self.read_bucket(bucket, each))
    }

    fn read_bucket(&self, bucket: usize, each: &mut dyn FnMut(&T) -> Result<()>) -> Result<()> {
        let count = self.buckets.len(bucket);
        if count.saturating_mul(size_of::<T>() as u64) > self.budget / 2 {
            return self.divide(bucket, each);
        }
        let mut records = Vec::with_capacity(count as usize);
        self.buckets.read(bucket, |run| records.extend_from_slice(run))?;
        self.buckets.forget(bucket);
        merge_sorted(&mut records);
        records.iter().try_for_each(each)
    }

    /// Sorts a bucket that is larger than memory into buckets of its own range of keys, or merges its only key.
    fn divide(&self, bucket: usize, each: &mut dyn FnMut(&T) -> Result<()>) -> Result<()> {
        // The whole budget is then free for the new buckets.
        self.buckets.settle()?;
        let (mut low, mut high, mut merged) = (u128::MAX, 0, None::<T>);
        self.buckets.read(bucket, |run| {
            for record in run {
                (low, high) = (low.min(record.key()), high.max(record.key()));
                match &mut merged {
                    Some(merged) if low == high => merged.merge(record),
                    Some(_) => {}
                    None => merged = Some(*record),
                }
            }
        })?;
        if low == high {
            self.buckets.forget(bucket);
            return merged.iter().try_for_each(each);
        }
        let parts = Self::new(&self.folder, [low, high], self.budget);
        let mut part = Vec::new();
        self.buckets.try_read(bucket, |run| {
            part.extend_from_slice(run);
            parts.push(&mut part)
        })?;
        self.buckets.forget(bucket);
        parts.read(each)
    }
}

/// Sorts records and merges those of equal keys.
fn merge_sorted<T: KeyedRecord>(records: &mut Vec<T>) {
    records.sort_unstable_by_key(T::key);
    records.dedup_by(|next, kept| {
        let is_same = next.key() == kept.key();
        if is_same {
            kept.merge(next);
        }
        is_same
    });
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use proptest::prelude::*;

    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    #[repr(C)]
    struct CountedKey {
        key: [u64; 2],
        count: u64,
    }

    impl KeyedRecord for CountedKey {
        fn key(&self) -> u128 {
            u128::from(self.key[0]) << 64 | u128::from(self.key[1])
        }

        fn merge(&mut self, other: &Self) {
            self.count += other.count;
        }
    }

    proptest! {
        /// Beside a map; ranges and budgets are wrong on purpose.
        #[test]
        fn like_a_map_in_any_memory(
            keys in prop::collection::vec((0_u64..3, prop_oneof![0_u64..9, any::<u64>()]), 0..900),
            budget in prop::sample::select(vec![200_u64, 3000, 1 << 20]),
            high in prop::sample::select(vec![0_u128, 5, u128::MAX]),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let sorted = AggregatedRecords::new(folder.path(), [0, high], budget);
            let mut twin = BTreeMap::new();
            for run in keys.chunks(100) {
                let run = run.iter().map(|(a, b)| CountedKey { key: [*a, *b], count: 1 });
                let mut run: Vec<CountedKey> = run.collect();
                run.iter().for_each(|record| *twin.entry(record.key()).or_insert(0) += 1);
                sorted.push(&mut run).unwrap();
            }
            let mut found = Vec::new();
            sorted.read(&mut |record| { found.push((record.key(), record.count)); Ok(()) }).unwrap();
            prop_assert_eq!(found, twin.into_iter().collect::<Vec<_>>());
        }
    }
}
