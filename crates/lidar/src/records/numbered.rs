//! Numbering of records, from the first one on.

use std::sync::Mutex;

use super::{PointRecords, RecordFlow, RecordUnit, Take};
use terrane_base::error::Result;
use terrane_engine::plan::RunControl;
use terrane_files::lock;

/// Reads all records in order, each with its number; returns the number of the first of each unit, and the
/// total.
pub(crate) fn pass(
    records: &dyn PointRecords,
    flow: RecordFlow,
    at: RunControl<'_>,
    take: &mut (dyn FnMut(u64, &[u8]) -> Result<()> + Send),
) -> Result<(Vec<u64>, u64)> {
    let counts = Mutex::new(vec![0; records.units()]);
    let counted = CountedRecords { records, record: flow.record, counts: &counts };
    let mut number = 0;
    flow.run(&counted, at, &mut |bytes| {
        for record in bytes.chunks_exact(flow.record) {
            take(number, record)?;
            number += 1;
        }
        Ok(())
    })?;
    let counts = counts.into_inner().unwrap_or_default();
    let firsts = counts.iter().scan(0, |sum, count| {
        let first = *sum;
        *sum += count;
        Some(first)
    });
    Ok((firsts.collect(), number))
}

/// Counts the records of each unit as they pass.
struct CountedRecords<'a> {
    records: &'a dyn PointRecords,
    record: usize,
    counts: &'a Mutex<Vec<u64>>,
}

impl PointRecords for CountedRecords<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let mut count = 0;
        self.records.read(unit, &mut |bytes| {
            count += (bytes.len() / self.record) as u64;
            take(bytes)
        })?;
        lock(self.counts)[unit] = count;
        Ok(())
    }
}
