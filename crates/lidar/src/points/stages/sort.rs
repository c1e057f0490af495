//! Sorts points: runs that fit into memory are sorted, spilled and merged.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::Path;
use std::str::FromStr;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use terrane_options::Choice;

use super::{OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput};
use crate::records::selection::{place, time};
use crate::records::{PointRecords, RecordFlow, RecordUnit, Take, total};
use terrane_base::bits::ordered;
use terrane_base::error::{Error, Result};
use terrane_cloud::write::PointPacking;
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_files::{SpoolExtent, SpoolFile};

/// An order of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sort {
    /// Morton order (z-order curve) of x and y, then z and time
    Morton,
    /// by time
    Time,
}

impl Sort {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "sort",
        "morton|time",
        "order of points; equal points stay in input order",
    )];
}

impl FromStr for Sort {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        Self::named(text)
    }
}

impl Stage for Sort {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Reorders
    }

    fn is_spatial(&self) -> bool {
        false
    }

    fn needed(&self, _: &CloudInfo, _: u64) -> [u64; 2] {
        [LEAST, 0]
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        if input.is_last && input.packing == PointPacking::Nodes {
            return Err(Error::usage(
                "‹sort› has no effect on COPC, which has the order of its octree",
            )
            .remedy("leave it out, or write .laz"));
        }
        check(*self, input.format)?;
        Ok(Box::new(*self))
    }
}

impl OpenStage for Sort {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let (work, format) = (around.work, around.work.options.format);
        let (flow, memory, folder) = (work.shares.flow, around.memory() / 4, work.folder());
        SortedRecords::new(records, *self, format, flow, memory, folder, work.at)
            .map(StageOutput::new)
    }
}

/// Sort key of records; the sort is stable.
type Key = [u64; 3];

/// How records are compared.
#[derive(Clone, Copy)]
struct RecordOrder {
    by: Sort,
    /// Offset of the time in a record.
    time: Option<usize>,
}

impl RecordOrder {
    fn key(self, record: &[u8]) -> Key {
        let at = place(record);
        let time = time(record, self.time);
        match self.by {
            Sort::Morton => {
                [spread(ordered(at.x)) | spread(ordered(at.y)) << 1, ordered(at.z), time]
            }
            Sort::Time => [time, 0, 0],
        }
    }
}

/// The 32 bits of a number, each with a zero before it.
fn spread(bits: u64) -> u64 {
    [(16, 0x0000_FFFF_0000_FFFF), (8, 0x00FF_00FF_00FF_00FF), (4, 0x0F0F_0F0F_0F0F_0F0F)]
        .into_iter()
        .chain([(2, 0x3333_3333_3333_3333), (1, 0x5555_5555_5555_5555)])
        .fold(bits, |bits, (by, mask)| (bits | bits << by) & mask)
}

/// Bytes of a piece of a run.
const PIECE: usize = if cfg!(test) { 256 } else { 128 << 10 };
/// Least memory for a run, or for the pieces of merged runs.
const LEAST: u64 = 4 << 20;
/// Bytes for the key of a record while a run is sorted.
const KEY: usize = size_of::<(Key, u32)>();

/// A run: sorted records in pieces.
type Run = Vec<SortedRunPiece>;

struct SortedRunPiece {
    extent: SpoolExtent,
    bytes: usize,
}

/// Sorted records.
struct SortedRecords {
    order: RecordOrder,
    /// Bytes of a record.
    record: usize,
    spool: SpoolFile,
    runs: Vec<Run>,
    points: u64,
}

/// Read position in a run.
struct SortedRunCursor<'a> {
    pieces: std::slice::Iter<'a, SortedRunPiece>,
    records: Vec<u8>,
    at: usize,
}

impl SortedRecords {
    /// Reads all records once; uses `memory` bytes, and spills the rest to `folder`.
    ///
    /// # Errors
    /// An order by time for a format without times.
    fn new(
        records: &dyn PointRecords,
        by: Sort,
        format: PointFormat,
        flow: RecordFlow,
        memory: u64,
        folder: &Path,
        at: RunControl<'_>,
    ) -> Result<Self> {
        check(by, format)?;
        let (order, spool) = (RecordOrder { by, time: format.time_at() }, SpoolFile::new(folder));
        let record = flow.record;
        let mut sorted = Self { order, record, spool, runs: Vec::new(), points: 0 };
        at.progress.begin("sorting", total(records));
        sorted.fill(records, flow, memory, at)?;
        let max_runs = (memory as usize / PIECE).max(3) - 1;
        while sorted.runs.len() > max_runs {
            at.cancel.check()?;
            sorted.merge_some(max_runs)?;
        }
        at.progress.end();
        Ok(sorted)
    }

    fn fill(
        &mut self,
        records: &dyn PointRecords,
        flow: RecordFlow,
        memory: u64,
        at: RunControl<'_>,
    ) -> Result<()> {
        let each = (self.record + KEY) as u64;
        let max_bytes = (memory / each).clamp(1, u32::MAX.into()) as usize * self.record;
        let all = total(records).saturating_mul(self.record as u64);
        let mut run: Vec<u8> = Vec::with_capacity(all.min(max_bytes as u64) as usize);
        flow.run(records, at, &mut |mut bytes| {
            while !bytes.is_empty() {
                let (now, later) = bytes.split_at(bytes.len().min(max_bytes - run.len()));
                run.extend_from_slice(now);
                bytes = later;
                if run.len() == max_bytes {
                    self.sort(&run)?;
                    run.clear();
                }
            }
            Ok(())
        })?;
        self.sort(&run)
    }

    /// Adds a run.
    fn sort(&mut self, records: &[u8]) -> Result<()> {
        let keys = records.par_chunks(self.record).enumerate();
        let mut keys: Vec<_> =
            keys.map(|(number, record)| (self.order.key(record), number as u32)).collect();
        keys.par_sort_unstable();
        self.points += keys.len() as u64;
        let (mut run, mut piece) = (Run::new(), Vec::new());
        for (_, number) in keys {
            let first = number as usize * self.record;
            piece.extend_from_slice(&records[first..first + self.record]);
            self.put(&mut piece, PIECE, &mut run)?;
        }
        self.put(&mut piece, 1, &mut run)?;
        if !run.is_empty() {
            self.runs.push(run);
        }
        Ok(())
    }

    /// Adds a piece to a run, if it has at least `min_bytes`.
    fn put(&self, piece: &mut Vec<u8>, min_bytes: usize, run: &mut Run) -> Result<()> {
        if piece.len() >= min_bytes {
            run.push(SortedRunPiece { extent: self.spool.put(&[piece])?, bytes: piece.len() });
            piece.clear();
        }
        Ok(())
    }

    /// Merges adjacent runs, `max_runs` at a time.
    fn merge_some(&mut self, max_runs: usize) -> Result<()> {
        let mut merged = Vec::new();
        for group in std::mem::take(&mut self.runs).chunks_mut(max_runs) {
            let mut run = Run::new();
            self.merge(group, &mut |bytes| {
                let mut piece = bytes.to_vec();
                self.put(&mut piece, 1, &mut run)
            })?;
            group
                .iter_mut()
                .flat_map(std::mem::take)
                .for_each(|piece| self.spool.free(piece.extent));
            merged.push(run);
        }
        self.runs = merged;
        Ok(())
    }

    /// Merges some runs, a piece at a time; equal records keep the order of runs.
    fn merge(&self, runs: &[Run], take: &mut Take<'_>) -> Result<()> {
        let mut cursors: Vec<_> = runs.iter().map(|run| SortedRunCursor::new(run)).collect();
        let mut next = BinaryHeap::new();
        for (number, cursor) in cursors.iter_mut().enumerate() {
            next.extend(cursor.key(self)?.map(|key| Reverse((key, number))));
        }
        let mut piece = Vec::new();
        while let Some(Reverse((_, number))) = next.pop() {
            let cursor = &mut cursors[number];
            piece.extend_from_slice(&cursor.records[cursor.at..cursor.at + self.record]);
            cursor.at += self.record;
            next.extend(cursor.key(self)?.map(|key| Reverse((key, number))));
            if piece.len() >= PIECE {
                take(&piece)?;
                piece.clear();
            }
        }
        take(&piece)
    }
}

impl<'a> SortedRunCursor<'a> {
    fn new(run: &'a [SortedRunPiece]) -> Self {
        Self { pieces: run.iter(), records: Vec::new(), at: 0 }
    }

    /// The key of the next record; `None` at the end of the run.
    fn key(&mut self, sorted: &SortedRecords) -> Result<Option<Key>> {
        if self.at == self.records.len() {
            let Some(SortedRunPiece { extent, bytes }) = self.pieces.next() else {
                return Ok(None);
            };
            self.records.resize(*bytes, 0);
            sorted.spool.get(extent, 0, &mut [&mut self.records])?;
            self.at = 0;
        }
        Ok(Some(sorted.order.key(&self.records[self.at..self.at + sorted.record])))
    }
}

impl PointRecords for SortedRecords {
    fn units(&self) -> usize {
        1
    }

    fn unit(&self, _: usize) -> RecordUnit<'_> {
        RecordUnit::of(self.points)
    }

    fn read(&self, _: usize, take: &mut Take<'_>) -> Result<()> {
        self.merge(&self.runs, take)
    }
}

/// Fails if a point format does not support an order.
fn check(by: Sort, format: PointFormat) -> Result<()> {
    if by == Sort::Time && format.time_at().is_none() {
        let number = format.number();
        return Err(Error::usage(format!(
            "‹sort› time requires GPS times, which point format {number} lacks"
        ))
        .remedy("pass ‹sort› morton, or leave out ‹sort›"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_engine::{Cancel, Silent};

    /// Records of format 1 in units of a few.
    struct Listed(Vec<Vec<u8>>);

    impl PointRecords for Listed {
        fn units(&self) -> usize {
            self.0.len().div_ceil(7)
        }

        fn unit(&self, unit: usize) -> RecordUnit<'_> {
            RecordUnit::of(self.0.len().saturating_sub(7 * unit).min(7) as u64)
        }

        fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
            self.0.iter().skip(7 * unit).take(7).try_for_each(|record| take(record))
        }
    }

    fn record(number: usize, position: [i32; 3], time: f64) -> Vec<u8> {
        let mut record = position.map(i32::to_le_bytes).concat();
        record.extend_from_slice(&(number as u64).to_le_bytes());
        record.extend_from_slice(&time.to_le_bytes());
        record
    }

    /// The order of places bit by bit, from the highest on: y before x.
    fn interleaved(x: i32, y: i32) -> Vec<bool> {
        let [x, y] = [x, y].map(|value| i64::from(value) + (1 << 31));
        (0..32).rev().flat_map(|bit| [y >> bit & 1 == 1, x >> bit & 1 == 1]).collect()
    }

    proptest! {
        #[test]
        fn like_a_stable_sort_in_any_memory(
            points in prop::collection::vec((-3..3i32, any::<i32>(), -2..2i32, -2..3i32), 0..120),
            memory in prop::sample::select(vec![0_u64, 300, 2000, 1 << 20]),
            by in prop::sample::select(vec![Sort::Morton, Sort::Time]),
        ) {
            let values = points.into_iter()
                .map(|(x, y, z, time)| ([x, y / 7 * 7 % 50, z], f64::from(time) / 2.0));
            let all: Vec<_> = values.enumerate().collect();
            let records = Listed(all.iter().map(|(i, (at, time))| record(*i, *at, *time)).collect());
            let mut expected = all;
            expected.sort_by(|(_, (a, time)), (_, (b, other))| match by {
                Sort::Morton => interleaved(a[0], a[1]).cmp(&interleaved(b[0], b[1]))
                    .then(a[2].cmp(&b[2])).then(time.total_cmp(other)),
                Sort::Time => time.total_cmp(other),
            });
            let folder = tempfile::tempdir().unwrap();
            let (flow, at) = (RecordFlow { record: 28, round: 100 }, RunControl { progress: &Silent, cancel: &Cancel::default() });
            let format = PointFormat::new(1).unwrap();
            let sorted = SortedRecords::new(&records, by, format, flow, memory, folder.path(), at).unwrap();
            for _ in 0..2 {
                let mut found = Vec::new();
                sorted.read(0, &mut |bytes| {
                    found.extend_from_slice(bytes);
                    Ok(())
                }).unwrap();
                let expected: Vec<_> = expected.iter().map(|(i, (at, time))| record(*i, *at, *time)).collect();
                prop_assert_eq!(found, expected.concat());
            }
        }
    }

    #[test]
    fn points_without_times_are_not_sorted_by_time() {
        assert!(check(Sort::Time, PointFormat::new(2).unwrap()).is_err());
    }
}
