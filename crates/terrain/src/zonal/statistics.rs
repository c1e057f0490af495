//! Statistics of the samples of a zone, each weighted with the covered share of its cell.

use std::fmt;
use std::str::FromStr;

use crate::annotate::property;
use terrane_vector::{FieldKind, PropertyValue};

/// A statistic of a zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ZoneStatistic {
    /// Sum of the weights.
    Count,
    /// Sum of the weights of voids.
    Voids,
    /// Weighted sum of heights.
    Sum,
    /// Weighted mean.
    Mean,
    /// Least height of a cell with a weight above 0.
    Min,
    /// Greatest height of such a cell.
    Max,
    /// Greatest less least height.
    Range,
    /// Weighted standard deviation of the population.
    Stdev,
    /// Its square.
    Variance,
    /// The least height with at least this percentage of the weight at it and below.
    Percentile(f64),
    /// The 50th percentile.
    Median,
    /// The height with the greatest weight; the least of several.
    Majority,
    /// The height with the least weight; the least of several.
    Minority,
    /// Number of different heights.
    Variety,
}

use ZoneStatistic as S;

/// A statistic by name.
pub struct NamedZoneStatistic {
    /// Its name.
    pub name: &'static str,
    /// Other names.
    pub aliases: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    statistic: ZoneStatistic,
}

const fn named(
    name: &'static str,
    aliases: &'static [&'static str],
    statistic: ZoneStatistic,
    about: &'static str,
) -> NamedZoneStatistic {
    NamedZoneStatistic { name, aliases, about, statistic }
}

/// All statistics but percentiles.
pub const ZONE_STATISTICS: [NamedZoneStatistic; 13] = [
    named("count", &[], S::Count, "total weight of valid samples, in cells"),
    named("voids", &[], S::Voids, "total weight of void samples"),
    named("sum", &[], S::Sum, "weighted sum"),
    named("mean", &["average", "avg"], S::Mean, "weighted mean"),
    named("min", &[], S::Min, "smallest value with a weight above 0"),
    named("max", &[], S::Max, "greatest such value"),
    named("range", &[], S::Range, "max minus min"),
    named("stdev", &["std", "stddev"], S::Stdev, "weighted standard deviation of the population"),
    named("variance", &[], S::Variance, "its square"),
    named(
        "median",
        &[],
        S::Median,
        "p50; p0 to p100: smallest value whose cumulative weight reaches N %",
    ),
    named(
        "majority",
        &["mode"],
        S::Majority,
        "value with the greatest total weight; the smallest of several",
    ),
    named(
        "minority",
        &[],
        S::Minority,
        "value with the least total weight; the smallest of several",
    ),
    named("variety", &[], S::Variety, "number of different values"),
];

impl ZoneStatistic {
    /// Its name, as in options.
    pub fn name(self) -> String {
        match (self, ZONE_STATISTICS.iter().find(|own| own.statistic == self)) {
            (Self::Percentile(percent), _) => format!("p{percent}"),
            (_, found) => found.map_or_else(String::new, |own| own.name.to_owned()),
        }
    }

    /// The type of its property; `is_whole` if all samples are whole numbers.
    pub(super) fn kind(self, is_whole: bool) -> FieldKind {
        match self {
            S::Variety => FieldKind::Int,
            S::Min | S::Max | S::Range | S::Percentile(_) if is_whole => FieldKind::Int,
            S::Median | S::Majority | S::Minority if is_whole => FieldKind::Int,
            _ => FieldKind::Real,
        }
    }

    /// True if it takes all values of a zone.
    pub(super) fn needs_values(self) -> bool {
        match self {
            S::Percentile(_) | S::Median | S::Majority | S::Minority | S::Variety => true,
            S::Count | S::Voids | S::Sum | S::Mean | S::Min | S::Max => false,
            S::Range | S::Stdev | S::Variance => false,
        }
    }
}

impl FromStr for ZoneStatistic {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim().to_ascii_lowercase();
        let is_named =
            |own: &&NamedZoneStatistic| own.name == text || own.aliases.contains(&&*text);
        if let Some(own) = ZONE_STATISTICS.iter().find(is_named) {
            return Ok(own.statistic);
        }
        let percent = text.strip_prefix('p').and_then(|number| number.parse::<f64>().ok());
        match percent.filter(|percent| (0.0..=100.0).contains(percent)) {
            Some(percent) => Ok(S::Percentile(percent)),
            None => {
                let names = ZONE_STATISTICS.map(|own| own.name).join(", ");
                Err(format!("expected p0 to p100 or {names}"))
            }
        }
    }
}

/// A list of statistics, in the order of their properties.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneStatistics(pub Vec<ZoneStatistic>);

impl Default for ZoneStatistics {
    fn default() -> Self {
        Self(vec![S::Count, S::Mean, S::Min, S::Max])
    }
}

impl<const N: usize> From<[ZoneStatistic; N]> for ZoneStatistics {
    fn from(all: [ZoneStatistic; N]) -> Self {
        Self(all.to_vec())
    }
}

impl FromStr for ZoneStatistics {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all: Vec<ZoneStatistic> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let twice = (1..all.len()).find(|at| all[..*at].contains(&all[*at]));
        match twice {
            Some(at) => Err(format!("{} is given twice", all[at].name())),
            None => Ok(Self(all)),
        }
    }
}

impl fmt::Display for ZoneStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.0.iter().map(|statistic| statistic.name()).collect();
        f.write_str(&names.join(","))
    }
}

/// The notation of a list.
pub struct ZoneStatisticList;

terrane_engine::by_text!(ZoneStatisticList, terrane_options::OptionKind::Text, ZoneStatistics);

/// Sums over a part of a zone. Parts are merged in the order of the grid, so that sums do not depend on threads.
#[derive(Clone, Debug, Default)]
pub(super) struct ZoneTally {
    count: f64,
    voids: f64,
    sum: f64,
    mean: f64,
    /// Weighted sum of squared differences from the mean.
    squares: f64,
    range: Option<[f64; 2]>,
    values: WeightedValues,
}

impl ZoneTally {
    /// The tally of samples with the weights of their cells.
    pub(super) fn of(heights: &[f64], weights: &[f64], keeps_values: bool) -> Self {
        let mut tally = Self::default();
        let samples = || heights.iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
        let valid = || samples().filter(|(height, _)| !height.is_nan());
        for (height, weight) in samples() {
            match height.is_nan() {
                true => tally.voids += weight,
                false => {
                    tally.count += weight;
                    tally.sum += weight * height;
                    let [low, high] = tally.range.unwrap_or([*height; 2]);
                    tally.range = Some([low.min(*height), high.max(*height)]);
                }
            }
        }
        if tally.count == 0.0 {
            return tally;
        }
        tally.mean = tally.sum / tally.count;
        let differences = valid().map(|(height, weight)| weight * (height - tally.mean).powi(2));
        tally.squares = differences.sum();
        if keeps_values {
            // Zero has one sign.
            tally.values.all =
                valid().map(|(height, weight)| (height + 0.0, units(*weight))).collect();
            tally.values.compact();
        }
        tally
    }

    /// Adds the next part. Equal values are added up once there are more than `most`, or twice as many as before.
    pub(super) fn add(&mut self, other: Self, most: usize) {
        self.voids += other.voids;
        let count = self.count + other.count;
        if other.count > 0.0 {
            let apart = other.mean - self.mean;
            self.squares += other.squares + apart * apart * (self.count * other.count / count);
            self.sum += other.sum;
            self.count = count;
            self.mean = self.sum / count;
            let [low, high] = other.range.unwrap_or_default();
            let [own_low, own_high] = self.range.unwrap_or([low, high]);
            self.range = Some([own_low.min(low), own_high.max(high)]);
        }
        self.values.add(other.values, most);
    }

    /// Number of values that are kept.
    pub(super) fn values(&self) -> usize {
        self.values.all.len()
    }

    /// True without a sample that is no void.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0.0
    }

    /// The properties of a zone; `is_whole` if all samples are whole numbers.
    pub(super) fn properties(
        mut self,
        statistics: &[ZoneStatistic],
        is_whole: bool,
    ) -> Vec<PropertyValue> {
        self.values.compact();
        let kinds = statistics.iter().map(|statistic| (statistic, statistic.kind(is_whole)));
        kinds.map(|(own, kind)| property(self.value(*own), kind == FieldKind::Int)).collect()
    }

    /// The value of a statistic; NaN for none.
    fn value(&self, statistic: ZoneStatistic) -> f64 {
        match statistic {
            S::Variety => return self.values.all.len() as f64,
            S::Count => return self.count,
            S::Voids => return self.voids,
            _ => {}
        }
        let Some([low, high]) = self.range else { return f64::NAN };
        // Sums that overflow have no mean.
        let mean = if self.sum.is_finite() { self.mean.clamp(low, high) } else { f64::NAN };
        let variance = if mean.is_nan() { mean } else { (self.squares / self.count).max(0.0) };
        match statistic {
            S::Sum => self.sum,
            S::Mean => mean,
            S::Min => low,
            S::Max => high,
            S::Range => high - low,
            S::Stdev => variance.sqrt(),
            S::Variance => variance,
            S::Median => self.values.percentile(50.0),
            S::Percentile(percent) => self.values.percentile(percent),
            S::Majority => self.values.extreme(|weight, best| weight > best),
            S::Minority => self.values.extreme(|weight, best| weight < best),
            S::Variety | S::Count | S::Voids => f64::NAN,
        }
    }
}

/// Values and their weights. Weights are whole numbers of units, whose sums do not depend on their order.
#[derive(Clone, Debug, Default)]
struct WeightedValues {
    all: Vec<(f64, u64)>,
    /// How many there were when equal values were last added up.
    compacted: usize,
}

/// Units of the weight of a whole cell: a zone may have 2^40 cells.
const UNITS: f64 = (1_u64 << 24) as f64;
/// Values up to which nothing is added up.
const FEW: usize = 1 << 16;
/// A cumulative weight this much of the total below a percentage reaches it: percentages are rounded.
const NEARLY: f64 = 1e-12;

/// A weight in units; at least one, as each sample with a weight counts.
fn units(weight: f64) -> u64 {
    ((weight * UNITS).round() as u64).max(1)
}

impl WeightedValues {
    fn add(&mut self, other: Self, most: usize) {
        self.all.extend(other.all);
        if self.all.len() > most.min(2 * self.compacted.max(FEW)) {
            self.compact();
        }
    }

    /// Sorts the values and adds up the weights of equal ones.
    fn compact(&mut self) {
        self.all.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        self.all.dedup_by(|(value, weight), (kept, sum)| {
            let is_same = value == kept;
            if is_same {
                *sum += *weight;
            }
            is_same
        });
        self.compacted = self.all.len();
    }

    fn percentile(&self, percent: f64) -> f64 {
        let total: u64 = self.all.iter().map(|(_, weight)| weight).sum();
        let share = percent / 100.0 - NEARLY;
        let mut below = 0;
        let found = self.all.iter().find(|(_, weight)| {
            below += weight;
            below as f64 / total as f64 >= share
        });
        found.or(self.all.last()).map_or(f64::NAN, |(value, _)| *value)
    }

    /// The value whose weight is better than those of all smaller values.
    fn extreme(&self, is_better: impl Fn(u64, u64) -> bool) -> f64 {
        let best = self.all.iter().copied().reduce(|best, own| match is_better(own.1, best.1) {
            true => own,
            false => best,
        });
        best.map_or(f64::NAN, |(value, _)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(heights: &[f64], weights: &[f64]) -> ZoneTally {
        ZoneTally::of(heights, weights, true)
    }

    /// The N-th percentile of 1 to 100 is N, whatever the weight of a cell.
    #[test]
    fn percentiles_are_not_rounded_up() {
        let heights: Vec<f64> = (1..=100).map(f64::from).collect();
        for weight in [1.0, 0.7, 1.0 / 3.0, 1e-6] {
            let tally = tally(&heights, &[weight; 100]);
            for percent in 1..=100 {
                let found = tally.value(S::Percentile(percent.into()));
                assert_eq!(found, f64::from(percent), "{weight}");
            }
            assert_eq!(tally.value(S::Percentile(0.0)), 1.0);
        }
    }

    #[test]
    fn of_equal_weights_the_smallest_value_counts() {
        let tally = tally(&[1.0, 2.0, 2.0, 3.0], &[0.3, 0.1, 0.2, 0.3]);
        assert_eq!([S::Majority, S::Minority].map(|own| tally.value(own)), [1.0, 1.0]);
    }

    #[test]
    fn sums_that_overflow_have_no_mean() {
        let tally = tally(&[1.7e308, 1.7e308, 1.0, 1.0], &[1.0; 4]);
        for none in [S::Sum, S::Mean, S::Stdev, S::Variance] {
            assert!(!tally.value(none).is_finite(), "{none:?}");
        }
        assert_eq!(tally.value(S::Min), 1.0);
    }

    /// Parts of any size and any limit of values give the same.
    #[test]
    fn values_are_added_up_in_any_parts() {
        let heights: Vec<f64> = (0..5000).map(|i| f64::from(i * 7919 % 613)).collect();
        let weights: Vec<f64> = (0..5000).map(|i| f64::from(i * 104_729 % 997) / 997.0).collect();
        let statistics = [S::Median, S::Majority, S::Minority, S::Variety, S::Percentile(90.0)];
        let whole = statistics.map(|own| tally(&heights, &weights).value(own));
        for (size, most) in [(1, 700), (64, 613), (999, 1 << 20)] {
            let mut sum = ZoneTally::default();
            for (heights, weights) in heights.chunks(size).zip(weights.chunks(size)) {
                sum.add(tally(heights, weights), most);
            }
            assert!(sum.values() <= most);
            sum.values.compact();
            assert_eq!(statistics.map(|own| sum.value(own)), whole);
        }
    }
}
