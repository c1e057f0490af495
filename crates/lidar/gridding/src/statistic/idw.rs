//! Means weighted by inverse distance.

use bytemuck::{Pod, Zeroable};

use super::method::{StatisticMethod, StatisticSource};
use crate::parameter::{NUMBER, RADIUS, StatisticParameter};
use crate::plane::{
    AccumulatorKind, AccumulatorPlane, CellAccumulator, CellHits, DensePlane, like,
};
use crate::region::CellNeighborhood;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

/// Largest supported power of the distance.
pub const MAX_POWER: f64 = 4.0;

/// Fails if the power of the distance is out of range.
pub fn check_power(power: f64) -> Result<()> {
    if power > 0.0 && power <= MAX_POWER {
        return Ok(());
    }
    Err(Error::usage(format!("the power {power} is out of range: expected above 0, at most 4")))
}

const POWER: StatisticParameter = StatisticParameter {
    key: "power",
    value: NUMBER,
    about: "exponent of the inverse-distance weights, at most 4 [‹power›]",
};

pub(super) const IDW: StatisticMethod = StatisticMethod {
    name: "idw",
    about: "mean of the heights within a radius, weighted by inverse distance",
    parameters: &[RADIUS, POWER],
    check: |given| {
        let power = given.positive(POWER.key)?;
        check_power(power.unwrap_or(1.0))?;
        Ok([given.positive(RADIUS.key)?, power])
    },
    of: StatisticSource::Points {
        needs: |statistic, rules| {
            let radius = statistic.parameter(RADIUS.key).unwrap_or(rules.radius);
            let power = statistic.parameter(POWER.key).unwrap_or(rules.power);
            (CellNeighborhood::Disc(radius), vec![weights(radius, power), HIT])
        },
        value: |_, cell| {
            let hit = Some(cell.accumulator::<CenterHeight>(1).0)
                .filter(|z| *z != CenterHeight::NONE.0)
                .map(f64::from);
            let steps = hit.or_else(|| cell.plane::<CellWeights>(0)?.sums.0.get(cell.at)?.mean());
            cell.units.height(steps)
        },
    },
    ..StatisticMethod::HEIGHT
};

/// Lowest of the heights exactly at the centre.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct CenterHeight(i32);

const HIT: AccumulatorKind = AccumulatorKind::cells::<CenterHeight>("hit");

impl CellAccumulator for CenterHeight {
    const BY_DISTANCE: bool = true;
    const NONE: Self = Self(i32::MAX);

    #[inline(always)]
    fn take(&mut self, point: &Point, square: u128) -> bool {
        square != 0 || self.join(Self(point.z))
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.0 = self.0.min(other.0);
        true
    }
}

/// Sums of weights and of weighted heights.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct WeightedHeights {
    weight: u128,
    height: i128,
}

impl WeightedHeights {
    /// The weighted mean of heights, in steps.
    fn mean(self) -> Option<f64> {
        (self.weight > 0).then(|| self.height as f64 / self.weight as f64)
    }
}

impl CellAccumulator for WeightedHeights {
    const NONE: Self = Self { weight: 0, height: 0 };

    /// Points come with weights: [`CellWeights`].
    fn take(&mut self, _: &Point, _: u128) -> bool {
        true
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        self.weight += other.weight;
        self.height += other.height;
        true
    }
}

/// Sums of weights for each cell.
#[derive(Debug)]
struct CellWeights {
    sums: DensePlane<WeightedHeights>,
    falloff: WeightFalloff,
}

fn weights(radius: f64, power: f64) -> AccumulatorKind {
    AccumulatorKind {
        parameters: [radius, power],
        make: |cells, [radius, power]| {
            let falloff = WeightFalloff::new(radius, power);
            Box::new(CellWeights { sums: DensePlane::new(cells), falloff })
        },
        ..AccumulatorKind::cells::<WeightedHeights>("weights")
    }
}

impl AccumulatorPlane for CellWeights {
    fn add(&mut self, hits: CellHits<'_>) -> Result<()> {
        let Self { sums: DensePlane(sums), falloff } = self;
        falloff.weigh(hits, |i, weight| {
            let sum = &mut sums[hits.cells[i] as usize];
            // Whole numbers: a sum of floats would depend on the order in which parts come.
            sum.weight += u128::from(weight.unsigned_abs());
            sum.height += i128::from(weight) * i128::from(hits.points[i].z);
        });
        Ok(())
    }

    fn fold(&mut self, other: &dyn AccumulatorPlane) -> Result<()> {
        self.sums.fold(&like::<Self>(other)?.sums)
    }

    fn bytes(&self) -> &[u8] {
        self.sums.bytes()
    }

    fn bytes_mut(&mut self, bytes: usize) -> &mut [u8] {
        self.sums.bytes_mut(bytes)
    }
}

/// Weights by distance: integers of about 2^24 (radius / distance)^power, so that the rounding of the smallest
/// one, at the radius, is less than 2^-24 of it. None is larger than 2^63, which a distance of less than radius
/// * 2^(-39/power) would take.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WeightFalloff {
    unit: f64,
    power: f64,
}

const WEIGHT_AT_RADIUS: f64 = (1 << 24) as f64;

impl WeightFalloff {
    fn new(radius: f64, power: f64) -> Self {
        Self { unit: WEIGHT_AT_RADIUS * raised(radius * radius, power), power }
    }

    #[inline]
    fn weight(self, divisor: f64) -> i64 {
        (self.unit / divisor + 0.5) as i64
    }

    /// Calls `each` with the weights at the squared distances of `hits`.
    fn weigh(self, hits: CellHits<'_>, mut each: impl FnMut(usize, i64)) {
        let area = hits.unit * hits.unit;
        let squares = hits.squares.iter().map(|square| float(*square) * area).enumerate();
        if self.power == 1.0 {
            squares.for_each(|(i, square)| each(i, self.weight(square.sqrt())));
        } else if self.power == 2.0 {
            squares.for_each(|(i, square)| each(i, self.weight(square)));
        } else {
            squares.for_each(|(i, square)| each(i, self.weight(raised(square, self.power))));
        }
    }
}

/// The nearest float, with a fast path for short integers.
fn float(square: u128) -> f64 {
    match u64::try_from(square) {
        Ok(short) => short as f64,
        Err(_) => square as f64,
    }
}

/// The root of `square` to the power; from products and roots, which are the same on all machines,
/// where the power is a multiple of a half.
fn raised(square: f64, power: f64) -> f64 {
    if (2.0 * power).fract() != 0.0 {
        return square.powf(power / 2.0);
    }
    let distance = square.sqrt();
    let part = if power.fract() == 0.0 { 1.0 } else { distance.sqrt() };
    (0..power as u32).fold(part, |product, _| product * distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_above_nothing_and_at_most_four() {
        let fits = [0.0, -1.0, f64::NAN, 4.1].map(|power| check_power(power).is_ok());
        assert_eq!(fits, [false; 4]);
        assert!(check_power(1e-9).is_ok() && check_power(4.0).is_ok());
    }

    #[test]
    fn weights_are_the_nearest_whole_numbers() {
        for (radius, power, unit) in
            [(3.0, 1.0, 0.5), (3.0, 2.0, 0.25), (2.0, 1.5, 0.01), (7.0, 0.7, 1.0)]
        {
            let squares: Vec<u128> = (1..60).map(|i| i * i * i).collect();
            let (cells, points) = (vec![0; squares.len()], vec![Point::default(); squares.len()]);
            let hits =
                CellHits { cells: &cells, points: &points, squares: &squares, unit, reals: &[] };
            let mut found = Vec::new();
            WeightFalloff::new(radius, power).weigh(hits, |i, weight| found.push((i, weight)));
            assert_eq!(found.len(), squares.len());
            for (i, weight) in found {
                let distance = (squares[i] as f64).sqrt() * unit;
                let exact = (1 << 24) as f64 * (radius / distance).powf(power);
                let off = (weight as f64 - exact).abs();
                assert!(off <= 0.5 + 1e-12 * exact, "{power} {i}: {weight} {exact}");
            }
        }
    }

    /// Powers of floats differ from machine to machine; products and roots do not.
    #[test]
    fn multiples_of_a_half_are_products_and_roots() {
        let mut off = 0;
        for square in (1..2_000).map(|i| f64::from(i) * 1.7) {
            let d = square.sqrt();
            for (power, expected) in [
                (0.5, d.sqrt()),
                (1.0, d),
                (1.5, d.sqrt() * d),
                (3.0, d * d * d),
                (4.0, d * d * d * d),
            ] {
                assert_eq!(raised(square, power).to_bits(), expected.to_bits(), "{square} {power}");
                off += u32::from(square.powf(power / 2.0) != expected);
            }
            assert_eq!(raised(square, 1.3), square.powf(0.65));
        }
        assert!(off > 0);
    }
}
