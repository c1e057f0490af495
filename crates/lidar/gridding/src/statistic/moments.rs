//! Mean and standard deviation, from integer sums.

use bytemuck::{Pod, Zeroable};

use super::method::{StatisticMethod, StatisticSource, Values};
use crate::cell::StatisticCell;
use crate::parameter::{GivenParameters, NUMBER, StatisticParameter};
use crate::plane::{AccumulatorKind, CellAccumulator, PointCount};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

/// Sum of the heights in steps.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct HeightSum(i64);

/// Sum of their squares.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct HeightSquareSum(u128);

const SUM: AccumulatorKind = AccumulatorKind::cells::<HeightSum>("sum");
const SQUARES: AccumulatorKind = AccumulatorKind::cells::<HeightSquareSum>("squares");

impl CellAccumulator for HeightSum {
    const NONE: Self = Self(0);

    #[inline(always)]
    fn take(&mut self, point: &Point, _: u128) -> bool {
        self.0 += i64::from(point.z);
        true
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.0 += other.0;
        true
    }
}

impl CellAccumulator for HeightSquareSum {
    const NONE: Self = Self(0);

    #[inline(always)]
    fn take(&mut self, point: &Point, _: u128) -> bool {
        self.0 += u128::from(i64::from(point.z).unsigned_abs().pow(2));
        true
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.0 += other.0;
        true
    }
}

pub(super) const MEAN: StatisticMethod = StatisticMethod {
    name: "mean",
    aliases: &["average", "avg"],
    about: "mean height",
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![PointCount::KIND, SUM]),
        value: |_, cell| {
            let count = cell.accumulator::<PointCount>(0).0;
            let sum = cell.accumulator::<HeightSum>(1).0 as f64;
            cell.units.height((count > 0).then(|| sum / f64::from(count)))
        },
    },
    reals: Some(|_, values, units| units.height(values.mean())),
    ..StatisticMethod::HEIGHT
};

const DDOF: StatisticParameter = StatisticParameter {
    key: "ddof",
    value: NUMBER,
    about: "0 divides by n (population), 1 by n - 1 (sample) [0]",
};

pub(super) const STD: StatisticMethod = StatisticMethod {
    name: "std",
    aliases: &["stdev", "stddev"],
    about: "standard deviation of heights",
    parameters: &[DDOF],
    check: ddof,
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![PointCount::KIND, SUM, SQUARES]),
        value: |statistic, cell| {
            let ddof = statistic.parameter(DDOF.key).unwrap_or(0.0);
            cell.units.difference(deviation(cell, ddof as u32))
        },
    },
    reals: Some(|statistic, values, units| {
        let divisor = values.len() as f64 - statistic.parameter(DDOF.key).unwrap_or(0.0);
        let spread = values.spread(2).filter(|_| divisor > 0.0);
        units.difference(spread.map(|spread| (spread / divisor).sqrt()))
    }),
    ..StatisticMethod::HEIGHT
};

fn ddof(given: &GivenParameters) -> Result<Values> {
    match given.value(DDOF.key) {
        None | Some(0.0) => Ok([None; 2]),
        Some(1.0) => Ok([Some(1.0), None]),
        Some(other) => Err(Error::usage(format!("ddof={other} is neither 0 nor 1"))),
    }
}

/// n sum(z^2) - sum(z)^2 is an exact integer; only the later steps are rounded.
fn deviation(cell: &StatisticCell<'_>, ddof: u32) -> Option<f64> {
    let count = cell.accumulator::<PointCount>(0).0;
    let divisor = count.checked_sub(ddof).filter(|n| *n > 0)?;
    let sum = u128::from(cell.accumulator::<HeightSum>(1).0.unsigned_abs());
    let spread = u128::from(count) * cell.accumulator::<HeightSquareSum>(2).0 - sum * sum;
    Some((spread as f64 / f64::from(count) / f64::from(divisor)).sqrt())
}
