//! Statistics of the samples of a zone, each weighted with the covered share of its cell.

use std::fmt;
use std::str::FromStr;

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

/// Names of all but percentiles.
const NAMES: [(&str, ZoneStatistic); 13] = [
    ("count", S::Count),
    ("voids", S::Voids),
    ("sum", S::Sum),
    ("mean", S::Mean),
    ("min", S::Min),
    ("max", S::Max),
    ("range", S::Range),
    ("stdev", S::Stdev),
    ("variance", S::Variance),
    ("median", S::Median),
    ("majority", S::Majority),
    ("minority", S::Minority),
    ("variety", S::Variety),
];

impl ZoneStatistic {
    /// Its name, as in options.
    pub fn name(self) -> String {
        match (self, NAMES.iter().find(|(_, own)| *own == self)) {
            (Self::Percentile(percent), _) => format!("p{percent}"),
            (_, found) => found.map_or_else(String::new, |(name, _)| (*name).to_owned()),
        }
    }

    /// The type of its property.
    pub(super) fn kind(self) -> FieldKind {
        if self == Self::Variety { FieldKind::Int } else { FieldKind::Real }
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
        let text = if text == "std" { "stdev" } else { text.as_str() };
        if let Some((_, statistic)) = NAMES.iter().find(|(name, _)| *name == text) {
            return Ok(*statistic);
        }
        let percent = text.strip_prefix('p').and_then(|number| number.parse::<f64>().ok());
        match percent.filter(|percent| (0.0..=100.0).contains(percent)) {
            Some(percent) => Ok(S::Percentile(percent)),
            None => {
                Err(format!("expected p0 to p100 or {}", NAMES.map(|(name, _)| name).join(", ")))
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
            tally.values.all = valid().map(|(height, weight)| (height + 0.0, *weight)).collect();
            tally.values.compact();
        }
        tally
    }

    /// Adds the next part.
    pub(super) fn add(&mut self, other: Self) {
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
        self.values.add(other.values);
    }

    /// Number of values that are kept.
    pub(super) fn values(&self) -> u64 {
        self.values.all.len() as u64
    }

    /// True without a sample that is no void.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0.0
    }

    /// The properties of a zone.
    pub(super) fn properties(mut self, statistics: &[ZoneStatistic]) -> Vec<PropertyValue> {
        self.values.compact();
        statistics.iter().map(|statistic| self.property(*statistic)).collect()
    }

    fn property(&self, statistic: ZoneStatistic) -> PropertyValue {
        match statistic {
            S::Variety => return PropertyValue::Int(self.values.all.len() as i64),
            S::Count => return PropertyValue::Real(self.count),
            S::Voids => return PropertyValue::Real(self.voids),
            _ => {}
        }
        let Some([low, high]) = self.range else { return PropertyValue::Null };
        let variance = (self.squares / self.count).max(0.0);
        PropertyValue::Real(match statistic {
            S::Sum => self.sum,
            S::Mean => self.mean.clamp(low, high),
            S::Min => low,
            S::Max => high,
            S::Range => high - low,
            S::Stdev => variance.sqrt(),
            S::Variance => variance,
            S::Median => self.values.percentile(50.0),
            S::Percentile(percent) => self.values.percentile(percent),
            S::Majority => self.values.extreme(|weight, best| weight > best),
            S::Minority => self.values.extreme(|weight, best| weight < best),
            S::Variety | S::Count | S::Voids => 0.0,
        })
    }
}

/// Values and their weights.
#[derive(Clone, Debug, Default)]
struct WeightedValues {
    all: Vec<(f64, f64)>,
    /// How many there were when equal values were last added up.
    compacted: usize,
}

/// Values up to which nothing is added up.
const FEW: usize = 1 << 16;

impl WeightedValues {
    fn add(&mut self, other: Self) {
        self.all.extend(other.all);
        if self.all.len() > 2 * self.compacted.max(FEW) {
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
        let total: f64 = self.all.iter().map(|(_, weight)| weight).sum();
        let mut below = 0.0;
        let found = self.all.iter().find(|(_, weight)| {
            below += weight;
            below >= total * (percent / 100.0)
        });
        found.or(self.all.last()).map_or(f64::NAN, |(value, _)| *value)
    }

    fn extreme(&self, is_better: impl Fn(f64, f64) -> bool) -> f64 {
        let best = self.all.iter().copied().reduce(|best, own| match is_better(own.1, best.1) {
            true => own,
            false => best,
        });
        best.map_or(f64::NAN, |(value, _)| value)
    }
}
