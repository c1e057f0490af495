//! Values of records, found in any order and read in that of the records.

use std::path::Path;

use super::PointRecords;
use super::each::EachRecord;
use super::numbered::RecordNumbers;
use terrane_base::error::Result;
use terrane_files::{BucketWriter, Buckets};

/// Bytes of values that are held until they are read.
pub(crate) const VALUES: u64 = 16 << 20;
/// Values of a bucket.
const BUCKET: u64 = 1 << 16;
/// Most buckets.
const MAX_BUCKETS: u64 = 1 << 14;

/// The values of one record, after its number in its bucket.
type Row<const N: usize> = [u32; N];

/// The values of records by their numbers, in buckets of equal size.
pub(crate) struct RecordValues<const N: usize> {
    buckets: Buckets<Row<N>>,
    /// Numbers of a bucket.
    each: u64,
}

impl<const N: usize> RecordValues<N> {
    /// For this number of records, with temporary files in `folder`.
    pub(crate) fn new(records: u64, folder: &Path) -> Self {
        let each = BUCKET.max(records.div_ceil(MAX_BUCKETS));
        let count = records.div_ceil(each).max(1) as usize;
        Self { buckets: Buckets::new(folder, count, VALUES), each }
    }

    /// A writer for one thread.
    pub(crate) fn writer(&self) -> ValueWriter<'_, N> {
        ValueWriter { each: self.each, to: self.buckets.writer() }
    }

    /// The rows of a bucket, by number; rows without values are zero.
    fn of(&self, bucket: u64) -> Result<Vec<Row<N>>> {
        let mut all = Vec::new();
        self.buckets.read(bucket as usize, |rows| {
            for row in rows {
                let number = row[0] as usize;
                all.resize(all.len().max(number + 1), [0; N]);
                all[number] = *row;
            }
        })?;
        Ok(all)
    }

    /// Records with their values, which `set` puts into them; it returns whether the record is kept.
    pub(crate) fn records<'r>(
        self,
        records: &'r dyn PointRecords,
        record: usize,
        numbers: RecordNumbers,
        set: impl Fn(&mut [u8], Row<N>) -> bool + Send + Sync + 'r,
    ) -> impl PointRecords + 'r {
        let each =
            move |at: super::RecordAt, record: &mut [u8], known: &mut (Option<u64>, Vec<_>)| {
                let (bucket, number) = (at.number / self.each, (at.number % self.each) as usize);
                if known.0 != Some(bucket) {
                    *known = (Some(bucket), self.of(bucket)?);
                }
                Ok(set(record, known.1.get(number).copied().unwrap_or([0; N])))
            };
        EachRecord::new(records, record, each).numbered(numbers)
    }
}

/// Stores values by record number. Call [`finish`](Self::finish) at the end.
pub(crate) struct ValueWriter<'a, const N: usize> {
    each: u64,
    to: BucketWriter<'a, Row<N>>,
}

impl<const N: usize> ValueWriter<'_, N> {
    /// Stores the row of a record; its first entry is not a value.
    pub(crate) fn put(&mut self, number: u64, mut row: Row<N>) -> Result<()> {
        row[0] = (number % self.each) as u32;
        self.to.push((number / self.each) as usize, row)
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.to.finish()
    }
}
