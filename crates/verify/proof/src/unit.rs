//! Sums, maximum and histogram of errors, a run of [`GridDomain::UNIT`] samples at a time.
//!
//! Sums run in four lanes, and histograms in four copies, so that no addition waits for the last.

use super::domain::GridDomain;
use super::totals::ProofTally;

const LANES: usize = 4;
const RUN: usize = GridDomain::UNIT as usize;

/// Errors of a run of samples in a row; 0 for those that do not count.
pub(crate) struct ErrorRun {
    errors: [f64; RUN],
    counted: u32,
}

impl ErrorRun {
    /// The samples of `errors` (at most a unit) whose bit is set in `due`; samples without an error (below 0)
    /// do not count.
    #[inline]
    pub(crate) fn new(errors: &[f64], due: u32) -> Self {
        match <[f64; RUN]>::try_from(errors) {
            Ok(all) if due == u32::MAX && !all.iter().fold(false, |any, &e| any | (e < 0.0)) => {
                Self { errors: all, counted: due }
            }
            _ => Self::some(errors, due),
        }
    }

    fn some(errors: &[f64], due: u32) -> Self {
        let mut run = Self { errors: [0.0; RUN], counted: 0 };
        for (i, (counted, &error)) in run.errors.iter_mut().zip(errors).enumerate() {
            let counts = due >> i & 1 & u32::from(error >= 0.0);
            *counted = if counts == 1 { error } else { 0.0 };
            run.counted |= counts << i;
        }
        run
    }

    /// Bits of the samples that count.
    pub(crate) fn counted(&self) -> u32 {
        self.counted
    }

    /// The largest error.
    #[inline]
    pub(crate) fn max(&self) -> f64 {
        let mut max = [0.0; LANES];
        for errors in self.errors.chunks_exact(LANES) {
            for (max, &error) in max.iter_mut().zip(errors) {
                *max = if error > *max { error } else { *max };
            }
        }
        max.into_iter().fold(0.0, f64::max)
    }

    /// The first sample with this error, among those that count.
    pub(crate) fn find(&self, error: f64) -> Option<usize> {
        (0..RUN).find(|&i| self.counted >> i & 1 == 1 && self.errors[i] == error)
    }
}

/// Sums of errors and their squares over one unit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ErrorSums {
    errors: [f64; LANES],
    squares: [f64; LANES],
}

impl ErrorSums {
    /// Adds a row of the unit.
    #[inline]
    pub(crate) fn add(&mut self, run: &ErrorRun) {
        for errors in run.errors.chunks_exact(LANES) {
            for (lane, &error) in errors.iter().enumerate() {
                self.errors[lane] += error;
                self.squares[lane] += error * error;
            }
        }
    }

    /// Hands the sums over and starts again.
    pub(crate) fn flush(&mut self, tally: &mut ProofTally) {
        let Self { errors, squares } = std::mem::take(self);
        tally.errors.add(errors.into_iter().sum());
        tally.squares.add(squares.into_iter().sum());
    }
}

/// Samples by error in twentieths of the tolerance.
#[derive(Debug)]
pub(crate) struct Histogram {
    scale: f64,
    lanes: [[u64; ProofTally::BINS]; LANES],
}

impl Histogram {
    pub(crate) fn new(tolerance: f64) -> Self {
        Self { scale: ProofTally::BINS as f64 / tolerance, lanes: [[0; ProofTally::BINS]; LANES] }
    }

    /// Counts a run; errors at and over the tolerance go to the last bin.
    #[inline]
    pub(crate) fn add(&mut self, run: &ErrorRun) {
        for (i, &error) in run.errors.iter().enumerate() {
            // 0 / 0 for a tolerance of 0 is NaN, which casts to bin 0.
            let bin = ((error * self.scale) as usize).min(ProofTally::BINS - 1);
            self.lanes[i % LANES][bin] += u64::from(run.counted >> i & 1);
        }
    }

    /// Hands the counts over; `over` of the last bin are over the tolerance.
    pub(crate) fn flush(&self, over: u64, tally: &mut ProofTally) {
        for (bin, count) in self.lanes.iter().flat_map(|lane| lane.iter().enumerate()) {
            tally.histogram[bin] += count;
        }
        tally.histogram[ProofTally::BINS - 1] -= over;
        tally.histogram[ProofTally::BINS] += over;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_counts_what_is_due_and_has_an_error() {
        let errors: Vec<f64> = (0..20).map(|i| if i == 3 { -1.0 } else { f64::from(i) }).collect();
        let run = ErrorRun::new(&errors, 0b1111_1110 | 1 << 19);
        assert_eq!(run.counted(), 0b1111_0110 | 1 << 19);
        assert_eq!((run.max(), run.find(19.0), run.find(8.0)), (19.0, Some(19), None));
        let (mut tally, mut sums, mut histogram) =
            (ProofTally::default(), ErrorSums::default(), Histogram::new(20.0));
        sums.add(&run);
        sums.flush(&mut tally);
        histogram.add(&run);
        histogram.flush(1, &mut tally);
        assert_eq!(tally.errors.value(), 1.0 + 2.0 + 4.0 + 5.0 + 6.0 + 7.0 + 19.0);
        assert_eq!(tally.squares.value(), 1.0 + 4.0 + 16.0 + 25.0 + 36.0 + 49.0 + 361.0);
        assert_eq!(tally.histogram[..9], [0, 1, 1, 0, 1, 1, 1, 1, 0]);
        assert_eq!(tally.histogram[19..], [0, 1]);
    }
}
