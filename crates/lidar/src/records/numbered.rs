//! Numbering of records, from the first one on.

use std::ops::Range;
use std::sync::Mutex;

use super::{PointRecords, RecordFlow, RecordUnit, Take};
use terrane_base::error::Result;
use terrane_engine::plan::RunControl;
use terrane_files::lock;

/// The numbers of records, by unit.
pub(crate) struct RecordNumbers {
    /// Number of the first record of each unit.
    firsts: Vec<u64>,
    /// Number of all records.
    pub(crate) total: u64,
}

impl RecordNumbers {
    /// Number of units.
    pub(crate) fn units(&self) -> usize {
        self.firsts.len()
    }

    /// The number of the first record of a unit.
    pub(crate) fn first(&self, unit: usize) -> u64 {
        self.firsts[unit]
    }

    /// The numbers of the records of a unit.
    pub(crate) fn of_unit(&self, unit: usize) -> Range<usize> {
        let end = self.firsts.get(unit + 1).copied().unwrap_or(self.total);
        self.firsts[unit] as usize..end as usize
    }
}

/// Reads all records in order, each with its number.
pub(crate) fn pass(
    records: &dyn PointRecords,
    flow: RecordFlow,
    at: RunControl<'_>,
    take: &mut (dyn FnMut(u64, &[u8]) -> Result<()> + Send),
) -> Result<RecordNumbers> {
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
    Ok(RecordNumbers { firsts: firsts.collect(), total: number })
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
