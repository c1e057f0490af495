//! The point nearest to the centre of a cell.

use bytemuck::{Pod, Zeroable};

use super::method::{StatisticMethod, StatisticSource};
use crate::parameter::RADIUS;
use crate::plane::{AccumulatorKind, CellAccumulator};
use crate::region::CellNeighborhood;
use terrane_base::geom::Point;

/// The nearest point so far, of equally near ones the lowest.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct NearestPoint {
    square: u128,
    point: Point,
    unused: u32,
}

impl CellAccumulator for NearestPoint {
    const BY_DISTANCE: bool = true;
    // No coordinate is as large.
    const NONE: Self =
        Self { square: u128::MAX, point: Point::new(i32::MAX, i32::MAX, i32::MAX), unused: 0 };

    #[inline(always)]
    fn take(&mut self, point: &Point, square: u128) -> bool {
        self.join(Self { square, point: *point, unused: 0 })
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        let nearer =
            other.square < self.square || (other.square == self.square && other.point < self.point);
        *self = if nearer { other } else { *self };
        true
    }
}

const NEAR: AccumulatorKind = AccumulatorKind::cells::<NearestPoint>("nearest");

pub(super) const NEAREST: StatisticMethod = StatisticMethod {
    name: "nearest",
    about: "height of the point nearest to the cell centre within a radius",
    parameters: &[RADIUS],
    check: |given| Ok([given.positive(RADIUS.key)?, None]),
    of: StatisticSource::Points {
        needs: |statistic, rules| {
            let radius = statistic.parameter(RADIUS.key).unwrap_or(rules.radius);
            (CellNeighborhood::Disc(radius), vec![NEAR])
        },
        value: |_, cell| {
            let z = cell.accumulator::<NearestPoint>(0).point.z;
            cell.units.height(Some(z).filter(|z| *z != i32::MAX).map(f64::from))
        },
    },
    ..StatisticMethod::HEIGHT
};
