//! How values are distributed: skewness, kurtosis and entropy.

use super::method::{StatisticMethod, StatisticSource, ValueNature};
use super::sorted::SortedCellValues;
use crate::cell::CellUnits;
use crate::parameter::{NUMBER, StatisticParameter};

pub(super) const SKEWNESS: StatisticMethod = StatisticMethod {
    name: "skewness",
    aliases: &["skew"],
    about: "skewness of heights: third standardized moment, for a population",
    nature: ValueNature::Ratio,
    of: StatisticSource::Sorted(|_, values, _| moment(values, 3).unwrap_or(f64::NAN)),
    ..StatisticMethod::HEIGHT
};

pub(super) const KURTOSIS: StatisticMethod = StatisticMethod {
    name: "kurtosis",
    aliases: &["kurt"],
    about: "kurtosis of heights: fourth standardized moment, 3 for a normal distribution",
    nature: ValueNature::Ratio,
    of: StatisticSource::Sorted(|_, values, _| moment(values, 4).unwrap_or(f64::NAN)),
    ..StatisticMethod::HEIGHT
};

/// The standardized central moment of this order; `None` if all values are equal.
fn moment(values: SortedCellValues<'_>, power: i32) -> Option<f64> {
    let n = values.len() as f64;
    let variance = Some(values.spread(2)? / n).filter(|variance| *variance > 0.0)?;
    let scale = if power == 3 { variance * variance.sqrt() } else { variance * variance };
    Some(values.spread(power)? / n / scale)
}

const LAYER: StatisticParameter =
    StatisticParameter { key: "layer", value: NUMBER, about: "layer height, counted from 0 [1]" };

pub(super) const ENTROPY: StatisticMethod = StatisticMethod {
    name: "entropy",
    about: "normalized Shannon entropy of point shares in height layers from 0 to the highest point",
    parameters: &[LAYER],
    nature: ValueNature::Ratio,
    check: |given| Ok([given.positive(LAYER.key)?, None]),
    of: StatisticSource::Sorted(|statistic, values, units| {
        let layer = statistic.parameter(LAYER.key).unwrap_or(1.0);
        entropy(values, layer, units).unwrap_or(f64::NAN)
    }),
    ..StatisticMethod::HEIGHT
};

/// Normalized entropy of the heights from 0 on, in layers of `layer`; `None` if the highest is below two
/// layers.
fn entropy(values: SortedCellValues<'_>, layer: f64, units: &CellUnits) -> Option<f64> {
    let highest = units.height(values.last());
    // Void is not above anything.
    let layers = Some((highest / layer).ceil()).filter(|_| highest >= 2.0 * layer)?;
    // The highest layer has its upper end, too.
    let layer_of = |value: f64| (units.height(Some(value)) / layer).floor().min(layers - 1.0);
    let lowest = values.behind(0, |value| units.height(Some(value)) < 0.0);
    let (count, mut at, mut sum) = ((values.len() - lowest) as f64, lowest, 0.0);
    while let Some(value) = values.get(at) {
        let own = layer_of(value);
        let end = values.behind(at, |other| layer_of(other) == own);
        let share = (end - at) as f64 / count;
        sum -= share * share.ln();
        at = end;
    }
    // A single share is 0, not -0.
    Some(sum.max(0.0) / layers.ln())
}
