//! What is counted of points, by file, by flight line and by cell: sums of integers and extremes, whose order does not
//! matter.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use serde::Serialize;

use crate::cloud_stats::CloudStats;
use terrane_cloud::InspectedPoint;
use terrane_files::KeyedRecord;

/// Lowest and highest value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QaRange {
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
}

/// Extends a range by another one; values that are not numbers are no part of it.
pub(super) fn extend(range: &mut Option<QaRange>, by: Option<QaRange>) {
    let Some(by) = by.filter(|by| by.low <= by.high) else { return };
    *range = Some(
        range.map_or(by, |own| QaRange { low: own.low.min(by.low), high: own.high.max(by.high) }),
    );
}

fn at(value: f64) -> Option<QaRange> {
    Some(QaRange { low: value, high: value })
}

/// Seconds of a week, in which times without an epoch lie.
const WEEK: f64 = 604_800.0;

/// The times that a header allows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AllowedTimes {
    /// See [`StatedHeader::time_offset`](terrane_cloud::StatedHeader::time_offset).
    pub(super) offset: Option<f64>,
    /// The end of the day after the creation, if stated: later times are findings.
    pub(super) created: Option<f64>,
}

impl AllowedTimes {
    fn holds(&self, time: f64) -> bool {
        match self.offset {
            Some(offset) => time + offset >= 0.0 && time.is_finite(),
            None => (0.0..WEEK).contains(&time),
        }
    }
}

/// Counts of the points of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct FileTally {
    pub(super) stats: CloudStats,
    pub(super) intensity: Option<QaRange>,
    pub(super) angle: Option<QaRange>,
    pub(super) time: Option<QaRange>,
    /// Points with times beyond what the header allows, and with times after its creation date.
    pub(super) bad_times: u64,
    pub(super) late_times: u64,
    /// Points with return number 0, or above the number of returns.
    pub(super) bad_returns: u64,
}

impl FileTally {
    pub(super) fn add(&mut self, point: &InspectedPoint<'_>, times: &AllowedTimes) {
        self.stats.count(point.record);
        extend(&mut self.intensity, at(point.intensity.into()));
        extend(&mut self.angle, at(point.angle));
        if let Some(time) = point.time {
            extend(&mut self.time, at(time));
            self.bad_times += u64::from(!times.holds(time));
            self.late_times += u64::from(times.created.is_some_and(|last| time > last));
        }
        let (number, returns) = (point.record.number, point.record.returns);
        self.bad_returns += u64::from(number == 0 || number > returns);
    }

    pub(super) fn and(self, other: Self) -> Self {
        let mut all = Self {
            stats: self.stats.and(other.stats),
            bad_times: self.bad_times + other.bad_times,
            late_times: self.late_times + other.late_times,
            bad_returns: self.bad_returns + other.bad_returns,
            ..self
        };
        extend(&mut all.intensity, other.intensity);
        extend(&mut all.angle, other.angle);
        extend(&mut all.time, other.time);
        all
    }
}

/// Counts of the points of a flight line.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LineTally {
    pub(super) points: u64,
    pub(super) last: u64,
    pub(super) time: Option<QaRange>,
    pub(super) angle: Option<QaRange>,
}

impl LineTally {
    fn add(&mut self, point: &InspectedPoint<'_>) {
        self.points += 1;
        self.last += u64::from(is_last(point));
        extend(&mut self.time, point.time.and_then(at));
        extend(&mut self.angle, at(point.angle));
    }

    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.last += other.last;
        extend(&mut self.time, other.time);
        extend(&mut self.angle, other.angle);
    }
}

fn is_last(point: &InspectedPoint<'_>) -> bool {
    point.record.number >= point.record.returns
}

/// Counts of all flight lines, by point source id.
#[derive(Clone, Debug, Default)]
pub(super) struct LineTallies(pub(super) BTreeMap<u16, LineTally>);

impl LineTallies {
    pub(super) fn add(&mut self, point: &InspectedPoint<'_>) {
        self.0.entry(point.line).or_default().add(point);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        other.0.iter().for_each(|(line, tally)| self.0.entry(*line).or_default().merge(tally));
    }
}

/// Points of a file and a flight line in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct CellTally {
    /// Row from the south and column from the west; those of the headers begin at 0.
    pub(super) cell: [i32; 2],
    pub(super) file: u32,
    pub(super) line: u32,
    pub(super) points: u64,
    /// Last returns, and the sum of their heights in steps.
    pub(super) last: u64,
    pub(super) sum: i64,
    /// Their lowest and highest height in steps.
    pub(super) low: i32,
    pub(super) high: i32,
}

impl CellTally {
    pub(super) fn of(cell: [i32; 2], file: u32, point: &InspectedPoint<'_>) -> Self {
        let (is_last, z) = (is_last(point), point.record.point.z);
        let [low, high] = if is_last { [z; 2] } else { [i32::MAX, i32::MIN] };
        Self {
            cell,
            file,
            line: point.line.into(),
            points: 1,
            last: is_last.into(),
            sum: if is_last { z.into() } else { 0 },
            low,
            high,
        }
    }

    /// The lowest key of a row.
    pub(super) fn row_key(row: i64) -> u128 {
        let row = row.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        key([row, i32::MIN], 0, 0)
    }
}

/// By row, column, line and file.
fn key([row, col]: [i32; 2], line: u32, file: u32) -> u128 {
    let [row, col] = [row, col].map(|at| u128::from(at as u32 ^ 1 << 31));
    row << 96 | col << 64 | u128::from(line) << 32 | u128::from(file)
}

impl KeyedRecord for CellTally {
    fn key(&self) -> u128 {
        key(self.cell, self.line, self.file)
    }

    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.last += other.last;
        // 2^32 points of one cell would have to lie at the end of the range of heights.
        self.sum = self.sum.saturating_add(other.sum);
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }
}
