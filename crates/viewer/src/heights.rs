//! Distribution of heights: counts of steps whose size is a power of two and follows from the lowest and highest height
//! alone, so that the order of heights does not matter.

use serde::Serialize;

/// Most steps that are counted.
const MAX_STEPS: i64 = 1 << 14;
/// The finest steps, as a power of two, and heights beyond which all are one.
const FINEST: i32 = -20;
const MAX_HEIGHT: f64 = (1_u64 << 40) as f64;
/// Sums are of integer parts of a unit, so that their order does not matter.
const PARTS: f64 = (1 << 20) as f64;
/// Most bars of a histogram, and the share of points that may lie beyond them, below and above.
const MAX_BARS: i64 = 24;
const BEYOND: f64 = 0.001;
/// Reported percentiles.
const PERCENTILES: [u64; 7] = [1, 5, 25, 50, 75, 95, 99];

/// Counts of heights by step.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeightCounts {
    /// Steps are of 2^power.
    power: i32,
    /// The lowest step, and points of it and those above.
    first: i64,
    counts: Vec<u64>,
    /// In [`PARTS`] of a unit.
    sum: i128,
}

/// Distribution of heights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeightDistribution {
    /// Mean height.
    pub mean: f64,
    /// Pairs of a percentage and its percentile height.
    pub percentiles: Vec<(u64, f64)>,
    /// See [`percentiles`](Self::percentiles).
    pub within: f64,
    /// From the lowest height up; the first and the last one reach as far as there are points.
    pub histogram: Vec<HistogramBar>,
}

/// Points in a range of heights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistogramBar {
    /// Lower end, included.
    pub low: f64,
    /// Upper end, excluded.
    pub high: f64,
    /// Number of points.
    pub points: u64,
}

impl Default for HeightCounts {
    fn default() -> Self {
        Self { power: FINEST, first: 0, counts: Vec::new(), sum: 0 }
    }
}

impl HeightCounts {
    /// Counts a height.
    pub(crate) fn add(&mut self, height: f64) {
        let height = height.clamp(-MAX_HEIGHT, MAX_HEIGHT);
        // Whole numbers: the sum is the same in any order of the workers.
        self.sum += (height * PARTS).round() as i128;
        loop {
            // By a power of two, which is exact: a step is the same whether it is coarsened before or after the count.
            let step = (height * (-f64::from(self.power)).exp2()).floor() as i64;
            if let Some(count) = self.place(step) {
                *count += 1;
                return;
            }
            self.coarsen();
        }
    }

    /// Merges both.
    pub(crate) fn and(mut self, mut other: Self) -> Self {
        if self.counts.is_empty() {
            return other;
        }
        while self.power < other.power {
            self.coarsen();
        }
        while other.power < self.power {
            other.coarsen();
        }
        while !other.counts.is_empty()
            && self.last().max(other.last()) - self.first.min(other.first) >= MAX_STEPS
        {
            self.coarsen();
            other.coarsen();
        }
        for (step, points) in (other.first..).zip(&other.counts) {
            if let Some(count) = self.place(step) {
                *count += points;
            }
        }
        self.sum += other.sum;
        self
    }

    /// The count of a step, added where it is missing; `None` where the counts would exceed [`MAX_STEPS`].
    fn place(&mut self, step: i64) -> Option<&mut u64> {
        // Steps before the first wrap around to a place beyond the last.
        let place = step.wrapping_sub(self.first) as usize;
        if place < self.counts.len() {
            return self.counts.get_mut(place);
        }
        if self.counts.is_empty() {
            self.first = step;
        }
        let (low, last) = (self.first.min(step), self.last().max(step));
        if last - low >= MAX_STEPS {
            return None;
        }
        let before = (self.first - low) as usize;
        self.counts.splice(0..0, std::iter::repeat_n(0, before));
        self.first = low;
        self.counts.resize((last - low + 1) as usize, 0);
        self.counts.get_mut((step - low) as usize)
    }

    /// Makes steps twice as large.
    fn coarsen(&mut self) {
        let mut counts = Vec::new();
        let first = self.first >> 1;
        for (step, points) in (self.first..).zip(&self.counts) {
            let place = ((step >> 1) - first) as usize;
            counts.resize(place + 1, 0);
            counts[place] += points;
        }
        (self.power, self.first, self.counts) = (self.power + 1, first, counts);
    }

    /// The highest step that has a count.
    fn last(&self) -> i64 {
        self.first + self.counts.len() as i64 - 1
    }

    fn points(&self) -> u64 {
        self.counts.iter().sum()
    }

    fn size(&self) -> f64 {
        f64::from(self.power).exp2()
    }

    /// The step that the height of this rank, from 1, lies in.
    fn step_of(&self, rank: u64) -> i64 {
        let mut below = 0;
        let place = self.counts.iter().position(|points| {
            below += points;
            below >= rank
        });
        self.first + place.unwrap_or(0) as i64
    }

    /// The report; `None` without heights.
    pub(crate) fn distribution(&self) -> Option<HeightDistribution> {
        let points = self.points();
        (points > 0).then(|| HeightDistribution {
            mean: self.sum as f64 / PARTS / points as f64,
            percentiles: PERCENTILES
                .map(|percent| (percent, self.percentile(points, percent)))
                .to_vec(),
            within: self.size() / 2.0,
            histogram: self.histogram(),
        })
    }

    /// The height below which `percent` of the points lie, to half a step.
    fn percentile(&self, points: u64, percent: u64) -> f64 {
        let rank = (points * percent).div_ceil(100).max(1);
        (self.step_of(rank) as f64 + 0.5) * self.size()
    }

    fn histogram(&self) -> Vec<HistogramBar> {
        let points = self.points();
        let beyond = (points as f64 * BEYOND) as u64;
        let [low, high] = [beyond + 1, points - beyond].map(|rank| self.step_of(rank));
        let shift = (0..63).find(|shift| (high >> shift) - (low >> shift) < MAX_BARS).unwrap_or(63);
        let [low, high] = [low >> shift, high >> shift];
        let size = self.size() * f64::from(shift).exp2();
        let mut bars: Vec<HistogramBar> = (low..=high)
            .map(|bar| HistogramBar {
                low: bar as f64 * size,
                high: (bar + 1) as f64 * size,
                points: 0,
            })
            .collect();
        for (step, points) in (self.first..).zip(&self.counts) {
            bars[((step >> shift).clamp(low, high) - low) as usize].points += points;
        }
        let ends = [self.first, self.first + self.counts.len() as i64]
            .map(|step| step as f64 * self.size());
        if let Some(bar) = bars.first_mut() {
            bar.low = bar.low.min(ends[0]);
        }
        if let Some(bar) = bars.last_mut() {
            bar.high = bar.high.max(ends[1]);
        }
        bars
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spread(heights: &[f64]) -> HeightCounts {
        let mut spread = HeightCounts::default();
        heights.iter().for_each(|height| spread.add(*height));
        spread
    }

    proptest! {
        #[test]
        fn the_order_and_the_parts_leave_no_trace(
            heights in prop::collection::vec(prop_oneof![-9.0..9.0, -1e4..1e4, Just(1e9), Just(0.0)], 1..200),
            cut in 0usize..200,
        ) {
            let all = spread(&heights);
            let (one, other) = heights.split_at(cut.min(heights.len()));
            prop_assert_eq!(&spread(one).and(spread(other)), &all);
            prop_assert_eq!(&spread(other).and(spread(one)), &all);
            let mut turned = heights.clone();
            turned.reverse();
            prop_assert_eq!(&spread(&turned), &all);
            // Counted the slow way, in steps of this size.
            prop_assert!(all.counts.len() as i64 <= MAX_STEPS);
            for (step, points) in (all.first..).zip(&all.counts) {
                let is_in = |height: &&f64| (**height / all.size()).floor() as i64 == step;
                prop_assert_eq!(heights.iter().filter(is_in).count() as u64, *points);
            }
        }

        #[test]
        fn percentiles_are_within_what_is_told(heights in prop::collection::vec(-1e3..1e3, 1..300)) {
            let told = spread(&heights).distribution().unwrap();
            let mut sorted = heights.clone();
            sorted.sort_by(f64::total_cmp);
            for (percent, height) in &told.percentiles {
                let rank = (sorted.len() * *percent as usize).div_ceil(100).max(1);
                prop_assert!((height - sorted[rank - 1]).abs() <= told.within);
            }
            let mean = heights.iter().sum::<f64>() / heights.len() as f64;
            prop_assert!((told.mean - mean).abs() < 1e-6);
            prop_assert_eq!(told.histogram.iter().map(|bar| bar.points).sum::<u64>(), heights.len() as u64);
            prop_assert!(told.histogram.len() as i64 <= MAX_BARS);
            prop_assert!(told.histogram[0].low <= sorted[0]);
            prop_assert!(told.histogram.last().unwrap().high > sorted[sorted.len() - 1]);
            prop_assert!(told.histogram.windows(2).all(|pair| pair[0].high == pair[1].low));
        }
    }

    #[test]
    fn a_few_points_far_off_do_not_flatten_the_bars() {
        let mut heights: Vec<f64> =
            (0..10_000).map(|i| 100.0 + f64::from(i % 100) / 10.0).collect();
        heights.extend([-500.0, 9_000.0]);
        let bars = spread(&heights).distribution().unwrap().histogram;
        assert!(bars.len() > 8, "{bars:?}");
        assert!(bars[0].low <= -500.0 && bars.last().unwrap().high > 9_000.0);
        assert_eq!(spread(&[]).distribution(), None);
        let one = spread(&[f64::INFINITY, 3.0]).distribution().unwrap();
        assert!(one.histogram.iter().all(|bar| bar.low.is_finite() && bar.high.is_finite()));
    }
}
