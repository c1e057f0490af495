//! Search for the threshold of a number of vertices or bytes in a few trials.
//!
//! The result of a threshold is known only after a trial. The number of vertices without topology is known in
//! advance for all thresholds ([`ThresholdHistogram`]), and the result is nearly linear in that number for any
//! data, so the search interpolates over it.
//!
//! A hierarchy of each line (areas, for methods that use them) gives the number of vertices at any threshold
//! without neighbours, in bins of 1/64 of a power of two. After one trial the excess is treated as a constant;
//! after two, the search interpolates linearly. If neighbours keep more vertices at a large threshold than at a
//! smaller one, a fixed series of thresholds is tried before a goal is refused, so that the reported minimum is
//! reachable.

use std::ops::RangeInclusive;

use super::tool::EVERYTHING;
use terrane_base::error::Result;

/// Largest number of trials, and number of trials between two bounds before bisection: interpolation fails
/// where the result is steep.
const MAX_TRIALS: usize = 24;
const ON_LINES: u32 = 6;
/// Largest unused share of a goal.
const UNUSED: u64 = 50;
/// Number of thresholds tried for the minimum, each smaller by a constant factor.
const RUNGS: i32 = 5;
const RUNG: f64 = 0.25;

/// Float bits below the bin: 64 bins per power of two.
const SHIFT: u32 = 52 - 6;

/// Histogram of kept vertices by threshold.
pub(super) struct ThresholdHistogram {
    bins: Vec<u64>,
    /// Vertices kept at any threshold.
    pub(super) fixed: u64,
    /// All vertices.
    pub(super) total: u64,
}

impl Default for ThresholdHistogram {
    fn default() -> Self {
        Self { bins: vec![0; 1 << (63 - SHIFT)], fixed: 0, total: 0 }
    }
}

impl ThresholdHistogram {
    /// Adds a vertex kept below `threshold`.
    pub(super) fn add(&mut self, threshold: f64) {
        self.bins[(threshold.to_bits() >> SHIFT) as usize] += 1;
    }

    /// Converts to a form for queries.
    pub(super) fn dial(mut self, largest: f64, is_area: bool) -> ThresholdsByCount {
        for bin in (1..self.bins.len()).rev() {
            self.bins[bin - 1] += self.bins[bin];
        }
        let rung = if is_area { RUNG * RUNG } else { RUNG };
        ThresholdsByCount { above: self.bins, fixed: self.fixed, total: self.total, largest, rung }
    }
}

/// Thresholds by number of kept vertices.
pub(super) struct ThresholdsByCount {
    /// Vertices above the lower edge of each bin.
    above: Vec<u64>,
    fixed: u64,
    total: u64,
    /// The largest threshold.
    largest: f64,
    rung: f64,
}

impl ThresholdsByCount {
    /// Threshold that keeps about `count` vertices.
    fn threshold(&self, count: f64) -> f64 {
        let inner = count - self.fixed as f64;
        match inner {
            _ if count >= self.total as f64 => EVERYTHING,
            _ if inner >= self.above[0] as f64 => 0.0,
            _ if inner < 1.0 => self.largest,
            _ => {
                // At least 1: the lowest bin keeps more than `inner`, as the second arm leaves it.
                let bin = self.above.partition_point(|above| *above as f64 > inner);
                let [low, high] = [bin - 1, bin].map(|bin| f64::from_bits((bin as u64) << SHIFT));
                let [more, less] = [bin - 1, bin].map(|bin| self.above[bin] as f64);
                high + (low - high) * (inner - less) / (more - less)
            }
        }
    }

    /// Candidates for the minimum, where neighbours keep more at a large threshold than at a small one.
    fn rungs(&self) -> impl Iterator<Item = f64> {
        (0..RUNGS).map(|rung| self.largest * self.rung.powi(rung))
    }
}

/// A goal in vertices or bytes.
pub(super) struct SizeLimit {
    /// Upper limit.
    pub(super) most: u64,
    /// Approximate value for all vertices.
    pub(super) all: f64,
}

/// Vertices kept at a threshold, and the result.
#[derive(Clone, Copy)]
struct ThresholdTrial {
    at: f64,
    came: f64,
}

/// Searches a threshold whose result is at most the goal and at least 98 % of it, if there is one. `attempt`
/// tries a threshold: it returns `None` if the result lies in the given range and is final, otherwise the size
/// of the result.
///
/// Returns `None` if `attempt` did, otherwise the smallest result found.
///
/// # Errors
/// Those of `attempt`.
pub(super) fn seek(
    target: &SizeLimit,
    dial: &ThresholdsByCount,
    mut attempt: impl FnMut(f64, RangeInclusive<u64>) -> Result<Option<u64>>,
) -> Result<Option<u64>> {
    let most = target.most;
    let mut search = ThresholdSearch::new(target, dial);
    let mut at = search.first(target);
    let mut best: Option<(u64, f64)> = None;
    for _ in 0..MAX_TRIALS {
        let threshold = dial.threshold(at);
        let least = if threshold == EVERYTHING { 0 } else { most - most / UNUSED };
        let Some(came) = attempt(threshold, least..=most)? else { return Ok(None) };
        if came <= most && best.is_none_or(|(known, _)| known < came) {
            best = Some((came, threshold));
        }
        search.learn(ThresholdTrial { at, came: came as f64 }, came <= most);
        at = search.next();
        if search.knows(dial.threshold(at)) {
            break;
        }
    }
    if let Some((_, threshold)) = best {
        return attempt(threshold, 0..=most);
    }
    let mut least = u64::MAX;
    for threshold in dial.rungs() {
        let Some(came) = attempt(threshold, 0..=most)? else { return Ok(None) };
        least = least.min(came);
    }
    Ok(Some(least))
}

/// State of a search.
struct ThresholdSearch<'a> {
    dial: &'a ThresholdsByCount,
    /// Result per vertex, as estimated before the first trial.
    each: f64,
    /// Target value.
    aim: f64,
    /// Last trial below the goal, and last trial above it.
    low: Option<ThresholdTrial>,
    high: Option<ThresholdTrial>,
    /// Trial before the last.
    before: Option<ThresholdTrial>,
    /// Trials since both bounds are known.
    inside: u32,
}

impl<'a> ThresholdSearch<'a> {
    fn new(target: &SizeLimit, dial: &'a ThresholdsByCount) -> Self {
        let aim = target.most as f64 * (1.0 - 0.5 / UNUSED as f64);
        let each = target.all / (dial.total as f64).max(1.0);
        Self { dial, each, aim, low: None, high: None, before: None, inside: 0 }
    }

    /// Estimate with a constant size per vertex; everything, if that fits.
    fn first(&self, target: &SizeLimit) -> f64 {
        let total = self.dial.total as f64;
        match target.most as f64 >= target.all {
            true => total,
            false => self.aim / target.all * total,
        }
    }

    fn learn(&mut self, trial: ThresholdTrial, fits: bool) {
        self.before = self.low.filter(|_| fits).or(self.high.filter(|_| !fits));
        *(if fits { &mut self.low } else { &mut self.high }) = Some(trial);
        self.inside += u32::from(self.low.is_some() && self.high.is_some());
    }

    fn knows(&self, threshold: f64) -> bool {
        let mut trials = [self.low, self.high].into_iter().flatten();
        trials.any(|trial| self.dial.threshold(trial.at) == threshold)
    }

    /// Next threshold.
    fn next(&self) -> f64 {
        let total = self.dial.total as f64;
        match (self.low, self.high) {
            // Bisect every third time: interpolation may fail repeatedly.
            (Some(low), Some(high)) if self.inside.is_multiple_of(3) || self.inside > ON_LINES => {
                f64::midpoint(low.at, high.at)
            }
            (Some(low), Some(high)) => self.between(low, high),
            (Some(low), None) => self.beyond(low).clamp((low.at * 1.02 + 1.0).min(total), total),
            (None, Some(high)) => self.beyond(high).clamp(0.0, high.at * 0.98),
            (None, None) => total,
        }
    }

    fn between(&self, low: ThresholdTrial, high: ThresholdTrial) -> f64 {
        let share = (self.aim - low.came) / (high.came - low.came);
        low.at + (high.at - low.at) * share.clamp(0.02, 0.98)
    }

    /// Interpolation through the last two trials. After a single trial the excess is treated as a constant
    /// (topology, properties) unless it is very large.
    fn beyond(&self, last: ThresholdTrial) -> f64 {
        let mean = last.came / last.at;
        let slope = match self.before {
            Some(before) => (last.came - before.came) / (last.at - before.at),
            None if mean < 3.0 * self.each => mean.min(self.each),
            None => mean,
        };
        let at = last.at + (self.aim - last.came) / slope;
        if slope > 0.0 && at.is_finite() { at } else { last.at / 2.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test data of 10,000 vertices whose thresholds follow a power law.
    fn dial() -> ThresholdsByCount {
        let mut profile =
            ThresholdHistogram { fixed: 100, total: 10_100, ..ThresholdHistogram::default() };
        (1..=9_000).for_each(|rank| profile.add(100.0 / f64::from(rank).powf(1.3)));
        profile.dial(1000.0, false)
    }

    fn kept(threshold: f64) -> f64 {
        match threshold {
            EVERYTHING => 10_100.0,
            0.0 => 9_100.0,
            _ => 100.0 + (100.0 / threshold).powf(1.0 / 1.3).floor().min(9_000.0),
        }
    }

    /// Final result, and number of trials.
    fn sought(most: u64, all: f64, came: impl Fn(f64) -> f64) -> (Option<u64>, Option<u64>, u32) {
        let (mut last, mut trials) = (None, 0);
        let left = seek(&SizeLimit { most, all }, &dial(), |threshold, range| {
            trials += 1;
            let came = came(threshold).round() as u64;
            last = Some(came).filter(|came| range.contains(came));
            Ok(last.is_none().then_some(came))
        });
        (last, left.unwrap(), trials)
    }

    #[test]
    fn few_trials_end_just_below_the_goal() {
        type Law = fn(f64) -> f64;
        let laws: [(&str, f64, Law); 5] = [
            ("as foreseen", 1.0, |t| kept(t)),
            ("fewer", 1.0, |t| kept(t).powf(0.97)),
            ("neighbours keep more", 1.0, |t| kept(t) + 1_000.0 + 0.2 * (10_100.0 - kept(t))),
            ("bytes", 30.0, |t| 5_000.0 + 21.0 * kept(t)),
            ("more bytes than was thought", 4.0, |t| 300.0 + 55.0 * kept(t)),
        ];
        for (name, each, law) in laws {
            for share in [0.999, 0.8, 0.5, 0.36, 0.3] {
                let most = (law(EVERYTHING) * share) as u64;
                let (last, left, trials) = sought(most, each * 10_100.0, law);
                let last = last.unwrap_or_else(|| panic!("{name} {share}: {left:?}"));
                let exact = (law(EVERYTHING) - law(0.0)) / law(EVERYTHING) < 1.0 - share;
                assert!(last <= most, "{name} {share}: {last} of {most}");
                assert!(!exact || last >= most - most / 50, "{name} {share}: {last} of {most}");
                assert!(!exact || trials <= 5, "{name} {share}: {trials} trials");
            }
            let everything = law(EVERYTHING) as u64;
            assert_eq!(sought(everything, each * 10_100.0, law).0, Some(everything), "{name}");
        }
    }

    #[test]
    fn the_least_that_is_told_can_be_had() {
        // Most is left at the largest threshold.
        let law = |t: f64| kept(t) + 200.0 * (1.0 + t).ln();
        let (last, least, _) = sought(50, 10_100.0, law);
        assert_eq!(last, None);
        let least = least.unwrap();
        assert_eq!(sought(least, 10_100.0, law).1, None);
        assert_eq!(sought(least / 2, 10_100.0, law).1, Some(least));
    }

    #[test]
    fn a_steep_fall_is_met_within_a_fiftieth() {
        // As the cone method on a border of equal bumps: few thresholds tell most of what is left.
        for (top, width) in [(4_000.0, 40.0), (2_000.0, 10.0), (8_000.0, 4.0), (900.0, 3.0)] {
            let law = |t: f64| {
                let share = ((kept_smoothly(t) - top + width) / width).clamp(0.0, 1.0);
                30.0 * (300.0 + 6_000.0 * share + 0.1 * kept_smoothly(t))
            };
            for most in [30_000, 60_000, 120_000, 180_000] {
                let (last, left, _) = sought(most, 30.0 * 10_100.0, law);
                let last = last.unwrap_or_else(|| panic!("{top} {width} {most}: {left:?}"));
                let least = most - most / 50;
                assert!((least..=most).contains(&last), "{top} {width}: {last} of {most}");
            }
        }
    }

    /// As many as `kept`, in fractions.
    fn kept_smoothly(threshold: f64) -> f64 {
        match threshold {
            EVERYTHING => 10_100.0,
            0.0 => 9_100.0,
            _ => 100.0 + (100.0 / threshold).powf(1.0 / 1.3).min(9_000.0),
        }
    }

    #[test]
    fn a_jump_is_met_from_below() {
        let law = |t: f64| if t < 0.5 { 8_000.0 } else { 3_000.0 };
        assert_eq!(sought(5_000, 10_100.0, law).0, Some(3_000));
    }
}
