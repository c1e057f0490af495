//! Point statistics for the header.

use crate::format::{PointFormat, TIME};

/// Number of return numbers counted in the header.
pub(super) const RETURNS: usize = 15;

/// Counts and extent of some points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PointTally {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
    /// Points by return number, from 1; other return numbers are not counted.
    pub(super) returns: [u64; RETURNS],
    count: u64,
    /// Minimum and maximum time, of formats 6 to 10.
    times: [f64; 2],
    /// The same without zeros.
    told: [f64; 2],
}

/// The empty range.
const NEVER: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// The union of two ranges.
fn around([low, high]: [f64; 2], [from, to]: [f64; 2]) -> [f64; 2] {
    [low.min(from), high.max(to)]
}

impl Default for PointTally {
    fn default() -> Self {
        Self {
            low: [i32::MAX; 3],
            high: [i32::MIN; 3],
            returns: [0; RETURNS],
            count: 0,
            times: NEVER,
            told: NEVER,
        }
    }
}

impl PointTally {
    /// Of records of this length, of formats 6 to 10 or older ones.
    pub(super) fn of(records: &[u8], size: usize, is_new: bool) -> Self {
        let mut tally = Self::default();
        let mask = if is_new { 15 } else { 7 };
        for record in records.chunks_exact(size) {
            let (fours, _) = record.as_chunks::<4>();
            for (axis, four) in fours.iter().take(3).enumerate() {
                let step = i32::from_le_bytes(*four);
                tally.low[axis] = tally.low[axis].min(step);
                tally.high[axis] = tally.high[axis].max(step);
            }
            if is_new {
                tally.time(record);
            }
            let number = usize::from(record[14] & mask);
            if let Some(count) = tally.returns.get_mut(number.wrapping_sub(1)) {
                *count += 1;
            }
        }
        tally.count = (records.len() / size) as u64;
        tally
    }

    fn time(&mut self, record: &[u8]) {
        let time =
            record[PointFormat::NEW - TIME..].first_chunk().map_or(0.0, |t| f64::from_le_bytes(*t));
        self.times = around(self.times, [time; 2]);
        if time != 0.0 {
            self.told = around(self.told, [time; 2]);
        }
    }

    /// Minimum and maximum time; zeros if empty.
    pub(super) fn times(&self) -> [f64; 2] {
        if self.times[0] <= self.times[1] { self.times } else { [0.0; 2] }
    }

    /// Minimum and maximum time except 0, which is nodata; zeros if empty.
    pub(super) fn time_range(&self) -> [f64; 2] {
        if self.told[0] <= self.told[1] { self.told } else { [0.0; 2] }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
        for (count, more) in self.returns.iter_mut().zip(other.returns) {
            *count += more;
        }
        self.count += other.count;
        self.times = around(self.times, other.times);
        self.told = around(self.told, other.told);
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }
}
