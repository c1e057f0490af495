//! Lattices for coordinates without a scale: as fine as their decimals, within the range of steps.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{PointFrame, REACH};

use super::frame::ClaimedExtent;

/// Maximum number of decimals.
pub(super) const MAX_DECIMALS: u8 = 9;
/// Maximum number of steps from zero: exact with a margin.
const MAX_STEPS: f64 = (1_u64 << 50) as f64;

/// Range and decimals of positions along each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct PositionSpan {
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
    pub(super) decimals: [u8; 3],
}

impl Default for PositionSpan {
    /// An empty span.
    fn default() -> Self {
        Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3], decimals: [0; 3] }
    }
}

impl PositionSpan {
    pub(super) fn add(&mut self, world: [f64; 3], decimals: [u8; 3]) {
        *self = self.join(&Self { low: world, high: world, decimals });
    }

    pub(super) fn join(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
            decimals: std::array::from_fn(|axis| self.decimals[axis].max(other.decimals[axis])),
        }
    }
}

/// The decimals of a number, up to rounding errors of a sum and product; at most [`MAX_DECIMALS`]. At least `least`
/// are assumed.
pub(super) fn decimals(value: f64, least: u8) -> u8 {
    let fitting = (least..MAX_DECIMALS).find(|decimals| {
        let per_unit = 10_f64.powi((*decimals).into());
        let rounded = (value * per_unit).round() / per_unit;
        (rounded - value).abs() <= 4.0 * f64::EPSILON * value.abs()
    });
    fitting.unwrap_or(MAX_DECIMALS)
}

/// A lattice for points.
pub(super) struct PointLattice {
    /// Steps per unit, a power of ten.
    per_unit: [f64; 3],
    origin: [i64; 3],
    pub(super) note: Option<String>,
}

impl PointLattice {
    /// The finest lattice that fits the points, no finer than their decimals.
    pub(super) fn of(all: &PositionSpan) -> Result<Self> {
        let mut placed = Self { per_unit: [1.0; 3], origin: [0; 3], note: None };
        if all.low[0] > all.high[0] {
            return Ok(placed);
        }
        let across = all.decimals[0].max(all.decimals[1]);
        let found = [across, across, all.decimals[2]];
        let fitting =
            [0, 1, 2].map(|axis| (0..=found[axis]).rev().find(|d| origin(all, axis, *d).is_some()));
        let across = fitting[0].zip(fitting[1]).map(|(x, y)| x.min(y));
        for (axis, fits) in [across, across, fitting[2]].into_iter().enumerate() {
            let origin = fits.and_then(|d| Some((d, origin(all, axis, d)?)));
            let (decimals, origin) = origin.ok_or_else(|| {
                let [low, high] = [all.low[axis], all.high[axis]];
                Error::unsupported(format!(
                    "the range of coordinates is too large: {low} to {high}"
                ))
                .remedy("remove outliers")
            })?;
            placed.per_unit[axis] = 10_f64.powi(decimals.into());
            placed.origin[axis] = origin;
            if decimals < found[axis] || found[axis] == MAX_DECIMALS {
                placed.note = Some(format!(
                    "coordinates are rounded to {decimals} decimals in {}",
                    ["x", "y", "z"][axis]
                ));
            }
        }
        Ok(placed)
    }

    pub(super) fn lattice(&self) -> PointFrame {
        let scale = self.per_unit.map(|n| 1.0 / n);
        let offset = std::array::from_fn(|axis| self.origin[axis] as f64 / self.per_unit[axis]);
        PointFrame { scale, offset }
    }

    pub(super) fn claim(&self, all: &PositionSpan) -> Option<ClaimedExtent> {
        let PointFrame { scale, offset } = self.lattice();
        let (low, high) = (self.quantize(all.low), self.quantize(all.high));
        (all.low[0] <= all.high[0]).then_some(ClaimedExtent { scale, offset, low, high })
    }

    /// The steps of a position within the span.
    pub(super) fn quantize(&self, world: [f64; 3]) -> [i32; 3] {
        std::array::from_fn(|axis| self.steps(axis, world[axis]))
    }

    fn steps(&self, axis: usize, world: f64) -> i32 {
        // Within range of the origin, or clamped: the bounds are of the same points.
        ((world * self.per_unit[axis]).round() - self.origin[axis] as f64) as i32
    }
}

/// Origin of a lattice with this number of decimals that keeps all points within range.
fn origin(all: &PositionSpan, axis: usize, decimals: u8) -> Option<i64> {
    let [low, high] =
        [all.low, all.high].map(|world| (world[axis] * 10_f64.powi(decimals.into())).round());
    let reach = f64::from(REACH);
    if low >= -reach && high <= reach {
        return Some(0);
    }
    let fits = high - low < 2.0 * reach && low.abs().max(high.abs()) < MAX_STEPS;
    fits.then(|| low as i64 + (high as i64 - low as i64) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_decimals_that_they_are_written_with() {
        for (value, found) in [
            (0.0, 0),
            (-3.0, 0),
            (0.5, 1),
            (500_000.01, 2),
            (123.0 * 0.001 + 500_000.0, 3),
            (0.1 + 0.2, 1),
            (std::f64::consts::PI, MAX_DECIMALS),
        ] {
            assert_eq!(decimals(value, 0), found, "{value}");
            assert_eq!(decimals(value, 4), found.max(4), "{value}");
        }
    }
}
