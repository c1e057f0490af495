//! Percentiles, from all values.

use super::method::{StatisticMethod, StatisticSource};
use super::sorted::SortedCellValues;
use terrane_base::error::Error;

const OF: StatisticSource = StatisticSource::Sorted(|statistic, values, units| {
    units.height(statistic.rank().and_then(|rank| percentile(values, rank)))
});

pub(super) const MEDIAN: StatisticMethod = StatisticMethod {
    name: "median",
    about: "median height, same as p50",
    ranks: true,
    check: |_| Ok([Some(50.0), None]),
    of: OF,
    ..StatisticMethod::HEIGHT
};

pub(super) const PERCENTILE: StatisticMethod = StatisticMethod {
    // N is the rank.
    name: "pN",
    about: "percentile, such as p95 or p99.9, linearly interpolated",
    ranks: true,
    check: |given| match given.rank {
        Some(rank) if (0.0..=100.0).contains(&rank) => Ok([Some(rank), None]),
        _ => Err(Error::usage("percentile out of range: expected p0 to p100")),
    },
    of: OF,
    ..StatisticMethod::HEIGHT
};

/// The value below which `rank` per cent of the values lie, interpolated linearly between neighbours.
fn percentile(values: SortedCellValues<'_>, rank: f64) -> Option<f64> {
    let place = rank / 100.0 * values.len().checked_sub(1)? as f64;
    let (at, part) = (place as usize, place.fract());
    let low = values.get(at)?;
    let high = values.get(at + 1).unwrap_or(low);
    Some(low + (high - low) * part)
}
