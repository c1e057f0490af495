//! Selection of points within groups: thinning by cells, duplicate points, flight lines.
//!
//! Two passes over all records: the first finds the best record of each group, the second drops the others. So
//! points keep their order, and the first of equally good ones is kept. Memory: one bit for each point.

use std::collections::HashMap;
use std::path::Path;

use bytemuck::{Pod, Zeroable};

use super::numbered::{self, RecordNumbers};
use super::{PointRecords, RecordFlow, RecordUnit, Take};
use terrane_base::bits::{BitSet, mixed};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;
use terrane_engine::plan::RunControl;
use terrane_files::Buckets;

/// Assigns a record to a group, with a rank: the least rank is best.
pub(crate) trait RecordRanking: Sync {
    fn group_and_rank(&self, record: &[u8]) -> (Group, Rank);

    /// Whether all records of a group are kept whose ranks end with the same number as the best.
    fn keeps_alike(&self) -> bool {
        false
    }
}

/// Key of a group.
pub(crate) type Group = [u64; 3];
/// Rank within a group, compared number by number; the least is best.
pub(crate) type Rank = [u64; 2];

/// A record's mark.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RecordMark {
    group: Group,
    rank: Rank,
    /// Number of the record.
    number: u64,
}

/// Target size of a bucket of marks, in bytes.
const BUCKET_BYTES: u64 = 4 << 20;
/// Bytes that a group takes while the best of a bucket are found.
const GROUP_BYTES: u64 = 2 * size_of::<(Group, (Rank, u64))>() as u64;
const MAX_BUCKETS: u64 = 1 << 14;

/// Number of buckets for the marks of `points`.
fn buckets(points: u64) -> u64 {
    (points * size_of::<RecordMark>() as u64).div_ceil(BUCKET_BYTES).clamp(1, MAX_BUCKETS)
}

/// Bytes of memory for a selection from `points`: a bit for each, and the groups of a bucket with a margin of a
/// quarter.
pub(crate) fn needed(points: u64) -> u64 {
    points / 8 + points / buckets(points) * GROUP_BYTES * 5 / 4 + BUCKET_BYTES
}

/// The selected records.
pub(crate) struct ChosenRecords<'a> {
    records: &'a dyn PointRecords,
    record: usize,
    kept: BitSet,
    numbers: RecordNumbers,
}

impl<'a> ChosenRecords<'a> {
    /// Reads all records once; marks beyond `memory` bytes are spilled to `folder`.
    pub(crate) fn new(
        records: &'a dyn PointRecords,
        choice: &dyn RecordRanking,
        flow: RecordFlow,
        memory: u64,
        folder: &Path,
        at: RunControl<'_>,
    ) -> Result<Self> {
        let points: u64 = (0..records.units()).map(|unit| records.unit(unit).points).sum();
        let (count, left) = (buckets(points), memory.saturating_sub(points / 8));
        let buckets = Buckets::new(folder, count as usize, left / 4);
        let numbers = numbered::pass(records, flow, at, &mut |number, record| {
            let (group, rank) = choice.group_and_rank(record);
            let bucket = (mixed(&group) % count) as usize;
            buckets.push(bucket, &[RecordMark { group, rank, number }])
        })?;
        let kept = best(&buckets, count as usize, choice.keeps_alike(), numbers.total, left, at)?;
        Ok(Self { records, record: flow.record, kept, numbers })
    }

    /// The `kept` records, given the numbers of all.
    pub(crate) fn of(
        records: &'a dyn PointRecords,
        record: usize,
        numbers: RecordNumbers,
        kept: BitSet,
    ) -> Self {
        Self { records, record, kept, numbers }
    }

    /// The indices in a unit of its kept records.
    pub(crate) fn kept_in(&self, unit: usize) -> impl Iterator<Item = u64> + '_ {
        let first = self.numbers.first(unit);
        self.kept.within(self.numbers.of_unit(unit)).map(move |number| number as u64 - first)
    }

    /// Number of dropped records.
    pub(crate) fn left_out(&self) -> u64 {
        let kept: u64 = self.kept.words().iter().map(|word| u64::from(word.count_ones())).sum();
        self.numbers.total - kept
    }
}

impl PointRecords for ChosenRecords<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut number, mut chosen) = (self.numbers.first(unit) as usize, Vec::new());
        self.records.read(unit, &mut |bytes| {
            chosen.clear();
            for record in bytes.chunks_exact(self.record) {
                if self.kept.contains(number) {
                    chosen.extend_from_slice(record);
                }
                number += 1;
            }
            take(&chosen)
        })
    }
}

/// The numbers of the best of each group, and of those alike if they are kept.
fn best(
    buckets: &Buckets<RecordMark>,
    count: usize,
    keeps_alike: bool,
    records: u64,
    memory: u64,
    at: RunControl<'_>,
) -> Result<BitSet> {
    let mut kept = BitSet::new(records as usize);
    for bucket in 0..count {
        at.cancel.check()?;
        let mut best: HashMap<Group, (Rank, u64)> = HashMap::new();
        buckets.try_read(bucket, |marks| {
            for RecordMark { group, rank, number } in marks {
                let known = best.entry(*group).or_insert((*rank, *number));
                *known = (*known).min((*rank, *number));
            }
            match best.len() as u64 * GROUP_BYTES > memory {
                true => Err(too_many(best.len(), memory)),
                false => Ok(()),
            }
        })?;
        if keeps_alike {
            buckets.read(bucket, |marks| {
                for RecordMark { group, rank, number } in marks {
                    if best.get(group).is_some_and(|(best, _)| best[1] == rank[1]) {
                        kept.insert(*number as usize);
                    }
                }
            })?;
        }
        buckets.forget(bucket);
        best.values().for_each(|(_, number)| {
            kept.insert(*number as usize);
        });
    }
    Ok(kept)
}

fn too_many(groups: usize, memory: u64) -> Error {
    let message = format!("{groups} cells or positions do not fit into {} MiB", memory >> 20);
    Error::new(ErrorKind::Resource, message).remedy("pass a larger ‹memory›")
}

/// Position of a record, in steps.
pub(crate) fn place(record: &[u8]) -> Point {
    let (fours, _) = record.as_chunks::<4>();
    let [x, y, z] = [0, 1, 2].map(|axis| i32::from_le_bytes(fours[axis]));
    Point { x, y, z }
}

/// The time at a byte of a record, as an integer with the same order; 0 for none.
pub(crate) fn time(record: &[u8], at: Option<usize>) -> u64 {
    let bytes = at.and_then(|at| record[at..].first_chunk());
    bytes.map_or(0, |bytes| match u64::from_le_bytes(*bytes) {
        negative if negative >> 63 == 1 => !negative,
        positive => positive | 1 << 63,
    })
}
