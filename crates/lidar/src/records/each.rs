//! Records that are changed or dropped one by one.

use std::marker::PhantomData;

use super::numbered::RecordNumbers;
use super::{PointRecords, RecordUnit, Take};
use terrane_base::error::Result;

/// Which record.
#[derive(Clone, Copy)]
pub(crate) struct RecordAt {
    pub(crate) unit: usize,
    /// Its number among all records; among those of the unit if these are not numbered.
    pub(crate) number: u64,
}

/// Records as a function changes them. It gets a state that each reading of a unit begins anew, and returns whether the
/// record is kept.
pub(crate) struct EachRecord<'a, S, F> {
    records: &'a dyn PointRecords,
    /// Bytes of a record.
    record: usize,
    numbers: Option<RecordNumbers>,
    each: F,
    state: PhantomData<fn() -> S>,
}

impl<'a, S, F> EachRecord<'a, S, F>
where
    S: Default + Send,
    F: Fn(RecordAt, &mut [u8], &mut S) -> Result<bool> + Sync,
{
    /// The records of `record` bytes.
    pub(crate) fn new(records: &'a dyn PointRecords, record: usize, each: F) -> Self {
        Self { records, record, numbers: None, each, state: PhantomData }
    }

    /// The same with numbers.
    pub(crate) fn numbered(self, numbers: RecordNumbers) -> Self {
        Self { numbers: Some(numbers), ..self }
    }
}

impl<S, F> PointRecords for EachRecord<'_, S, F>
where
    S: Default + Send,
    F: Fn(RecordAt, &mut [u8], &mut S) -> Result<bool> + Sync,
{
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut made, mut state) = (Vec::new(), S::default());
        let mut number = self.numbers.as_ref().map_or(0, |numbers| numbers.first(unit));
        self.records.read(unit, &mut |bytes| {
            made.clear();
            for record in bytes.chunks_exact(self.record) {
                let first = made.len();
                made.extend_from_slice(record);
                if !(self.each)(RecordAt { unit, number }, &mut made[first..], &mut state)? {
                    made.truncate(first);
                }
                number += 1;
            }
            take(&made)
        })
    }
}
