//! The lowest and the highest point.

use bytemuck::{Pod, Zeroable};

use super::method::{StatisticMethod, StatisticSource};
use crate::cell::StatisticCell;
use crate::plane::{AccumulatorKind, CellAccumulator};
use terrane_base::geom::Point;

/// Lowest height in steps; the value for no point is above all coordinates.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LowestHeight(i32);

/// Highest height in steps.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct HighestHeight(i32);

const LOW: AccumulatorKind = AccumulatorKind::cells::<LowestHeight>("low");
const HIGH: AccumulatorKind = AccumulatorKind::cells::<HighestHeight>("high");

impl CellAccumulator for LowestHeight {
    const NONE: Self = Self(i32::MAX);

    #[inline(always)]
    fn take(&mut self, point: &Point, _: u128) -> bool {
        self.join(Self(point.z))
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.0 = self.0.min(other.0);
        true
    }
}

impl CellAccumulator for HighestHeight {
    const NONE: Self = Self(i32::MIN);

    #[inline(always)]
    fn take(&mut self, point: &Point, _: u128) -> bool {
        self.join(Self(point.z))
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.0 = self.0.max(other.0);
        true
    }
}

fn low(cell: &StatisticCell<'_>, of: usize) -> Option<f64> {
    Some(cell.accumulator::<LowestHeight>(of).0)
        .filter(|z| *z != LowestHeight::NONE.0)
        .map(f64::from)
}

fn high(cell: &StatisticCell<'_>, of: usize) -> Option<f64> {
    Some(cell.accumulator::<HighestHeight>(of).0)
        .filter(|z| *z != HighestHeight::NONE.0)
        .map(f64::from)
}

pub(super) const MIN: StatisticMethod = StatisticMethod {
    name: "min",
    aliases: &["minimum", "lowest"],
    about: "lowest height",
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![LOW]),
        value: |_, cell| cell.units.height(low(cell, 0)),
    },
    reals: Some(|_, values, units| units.height(values.get(0))),
    ..StatisticMethod::HEIGHT
};

pub(super) const MAX: StatisticMethod = StatisticMethod {
    name: "max",
    aliases: &["maximum", "highest"],
    about: "highest height",
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![HIGH]),
        value: |_, cell| cell.units.height(high(cell, 0)),
    },
    reals: Some(|_, values, units| units.height(values.last())),
    ..StatisticMethod::HEIGHT
};

pub(super) const RANGE: StatisticMethod = StatisticMethod {
    name: "range",
    about: "highest minus lowest height",
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![LOW, HIGH]),
        value: |_, cell| {
            let ends = high(cell, 1).zip(low(cell, 0));
            cell.units.difference(ends.map(|(high, low)| high - low))
        },
    },
    reals: Some(|_, values, units| {
        let ends = values.last().zip(values.get(0));
        units.difference(ends.map(|(high, low)| high - low))
    }),
    ..StatisticMethod::HEIGHT
};
