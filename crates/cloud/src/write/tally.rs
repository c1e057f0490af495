//! What a header tells of all points.

/// Returns that a header counts one by one.
pub(super) const RETURNS: usize = 15;

/// Counts and extent of some points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tally {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
    /// Points by number of return, from 1; those beyond 15 or of none count as nothing here.
    pub(super) returns: [u64; RETURNS],
    count: u64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { low: [i32::MAX; 3], high: [i32::MIN; 3], returns: [0; RETURNS], count: 0 }
    }
}

impl Tally {
    /// Of records of so many bytes, of a new format or an old one.
    pub(super) fn of(records: &[u8], size: usize, is_new: bool) -> Self {
        let mut tally = Self::default();
        let mask = if is_new { 15 } else { 7 };
        for record in records.chunks_exact(size) {
            let (fours, _) = record.as_chunks::<4>();
            for axis in 0..3 {
                let step = i32::from_le_bytes(fours[axis]);
                tally.low[axis] = tally.low[axis].min(step);
                tally.high[axis] = tally.high[axis].max(step);
            }
            let number = usize::from(record[14] & mask);
            if let Some(count) = tally.returns.get_mut(number.wrapping_sub(1)) {
                *count += 1;
            }
        }
        tally.count = (records.len() / size) as u64;
        tally
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
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }
}
