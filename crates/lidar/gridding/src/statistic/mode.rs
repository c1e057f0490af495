//! The most frequent value, and the number of distinct values.

use super::method::{StatisticMethod, StatisticSource, ValueNature};
use super::sorted::SortedCellValues;
use terrane_base::attribute::CLASS;

pub(super) const MODE: StatisticMethod = StatisticMethod {
    name: "mode",
    aliases: &["majority"],
    about: "most frequent class (or value of another attribute), the lowest in ties",
    nature: ValueNature::Nominal,
    usual: Some(CLASS),
    of: StatisticSource::Sorted(|_, values, units| units.height(mode(values))),
    ..StatisticMethod::HEIGHT
};

pub(super) const VARIETY: StatisticMethod = StatisticMethod {
    name: "variety",
    about: "number of distinct classes (or values of another attribute); 0 in empty cells",
    nature: ValueNature::Count,
    usual: Some(CLASS),
    of: StatisticSource::Sorted(|_, values, _| values.runs().count() as f64),
    ..StatisticMethod::HEIGHT
};

fn mode(values: SortedCellValues<'_>) -> Option<f64> {
    let longest = values.runs().reduce(|best, run| if run.1 > best.1 { run } else { best });
    longest.map(|(value, _)| value)
}
