//! Records of points in numbered units, produced by all threads and consumed in order.
//!
//! All threads read the units of one round while those of the previous round are consumed in order. So the
//! bytes depend on neither threads nor memory.

mod each;
pub(crate) mod numbered;
mod packing;
pub(crate) mod selection;
pub(crate) mod values;

use rayon::prelude::*;

pub(crate) use each::{EachRecord, RecordAt};
pub(crate) use packing::RecordPacker;

use terrane_base::error::Result;
use terrane_engine::FileAt;
use terrane_engine::plan::RunControl;

/// Consumes records, in batches.
pub(crate) type Take<'a> = dyn FnMut(&[u8]) -> Result<()> + Send + 'a;

/// Records in units, which any thread may read repeatedly in any order.
pub(crate) trait PointRecords: Sync {
    /// Number of units.
    fn units(&self) -> usize;

    /// Description of a unit.
    fn unit(&self, unit: usize) -> RecordUnit<'_>;

    /// Reads the records of a unit, in order.
    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()>;
}

/// Records that are read together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordUnit<'a> {
    /// Upper bound of their number.
    pub(crate) points: u64,
    /// Their file, if there are several.
    pub(crate) file: Option<FileAt<'a>>,
}

impl RecordUnit<'_> {
    /// Of no file.
    pub(crate) fn of(points: u64) -> Self {
        Self { points, file: None }
    }
}

/// Number of records in flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordFlow {
    /// Bytes of a record.
    pub(crate) record: usize,
    /// Bytes of the records of a round.
    pub(crate) round: u64,
}

/// Units that are produced together.
enum RecordRound {
    /// These, by all threads.
    Many(std::ops::Range<usize>),
    /// One that does not fit into memory; its records are consumed directly.
    Large(usize),
}

impl RecordFlow {
    /// Reads all records in order: while those of a round are consumed, the next round is produced.
    pub(crate) fn run(
        self,
        records: &dyn PointRecords,
        at: RunControl<'_>,
        take: &mut Take<'_>,
    ) -> Result<()> {
        let mut produced = Vec::new();
        for round in self.rounds(records) {
            at.cancel.check()?;
            match round {
                RecordRound::Many(units) => {
                    let (taken, next) = rayon::join(
                        || pass(&produced, take),
                        || {
                            let units = units.clone().into_par_iter();
                            units.map(|unit| read_unit(records, unit, at)).collect::<Result<_>>()
                        },
                    );
                    taken?;
                    produced = next?;
                    at.progress.advance(units.map(|unit| records.unit(unit).points).sum());
                }
                RecordRound::Large(unit) => {
                    pass(&std::mem::take(&mut produced), take)?;
                    report_unit(records, unit, at);
                    records.read(unit, &mut |bytes| {
                        at.cancel.check()?;
                        take(bytes)
                    })?;
                    at.progress.advance(records.unit(unit).points);
                }
            }
        }
        pass(&produced, take)
    }

    fn rounds(self, records: &dyn PointRecords) -> Vec<RecordRound> {
        let (mut rounds, mut first, mut round_bytes) = (Vec::new(), 0, 0);
        for unit in 0..records.units() {
            let bytes = records.unit(unit).points.saturating_mul(self.record as u64);
            if round_bytes + bytes > self.round && first < unit {
                rounds.push(RecordRound::Many(first..unit));
                (first, round_bytes) = (unit, 0);
            }
            round_bytes += bytes;
            if bytes > self.round {
                rounds.push(RecordRound::Large(unit));
                (first, round_bytes) = (unit + 1, 0);
            }
        }
        if first < records.units() {
            rounds.push(RecordRound::Many(first..records.units()));
        }
        rounds
    }
}

fn pass(produced: &[Vec<u8>], take: &mut Take<'_>) -> Result<()> {
    produced.iter().try_for_each(|bytes| take(bytes))
}

fn report_unit(records: &dyn PointRecords, unit: usize, at: RunControl<'_>) {
    if let Some(file) = records.unit(unit).file {
        at.progress.file(file);
    }
}

/// All records of a unit.
fn read_unit(records: &dyn PointRecords, unit: usize, at: RunControl<'_>) -> Result<Vec<u8>> {
    report_unit(records, unit, at);
    let mut all = Vec::new();
    records.read(unit, &mut |bytes| {
        all.extend_from_slice(bytes);
        Ok(())
    })?;
    Ok(all)
}

/// The derived records, if there are any, or else these.
pub(crate) fn over<'r>(
    derived: &'r Option<impl PointRecords>,
    others: &'r dyn PointRecords,
) -> &'r dyn PointRecords {
    derived.as_ref().map_or(others, |derived| derived)
}

/// Upper bound of the number of records.
pub(crate) fn total(records: &dyn PointRecords) -> u64 {
    (0..records.units()).map(|unit| records.unit(unit).points).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_engine::{Cancel, Silent};

    /// Unit k has so many records of two bytes, which tell the unit.
    struct Counted(Vec<u64>);

    impl PointRecords for Counted {
        fn units(&self) -> usize {
            self.0.len()
        }

        fn unit(&self, unit: usize) -> RecordUnit<'_> {
            RecordUnit::of(self.0[unit])
        }

        fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
            (0..self.0[unit]).try_for_each(|_| take(&[unit as u8, 7]))
        }
    }

    #[test]
    fn records_come_in_the_order_of_units_whatever_a_round_holds() {
        let records = Counted(vec![3, 0, 20, 1, 1, 1, 50, 2]);
        let expected: Vec<u8> =
            (0..8).flat_map(|unit| [unit as u8, 7].repeat(records.0[unit] as usize)).collect();
        for round in [0, 1, 4, 10, 40, 1000] {
            let mut taken = Vec::new();
            let at = RunControl { progress: &Silent, cancel: &Cancel::default() };
            let mut take = |bytes: &[u8]| {
                taken.extend_from_slice(bytes);
                Ok(())
            };
            RecordFlow { record: 2, round }.run(&records, at, &mut take).unwrap();
            assert_eq!(taken, expected, "{round}");
        }
    }
}
