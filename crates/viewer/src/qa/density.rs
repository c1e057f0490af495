//! Densities of cells: exact counts of cells by number of points.

use std::collections::BTreeMap;

use super::report::QaDensity;

/// Reported percentiles.
const PERCENTILES: [u64; 7] = [1, 5, 25, 50, 75, 95, 99];

/// Cells by their number of points. There are at most sqrt(2 * points) + 1 distinct numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct CellCounts(BTreeMap<u64, u64>);

impl CellCounts {
    /// Adds `cells` cells with this number of points each.
    pub(super) fn add(&mut self, points: u64, cells: u64) {
        if cells > 0 {
            *self.0.entry(points).or_default() += cells;
        }
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> u64 {
        self.0.values().sum()
    }

    /// The number of points that `percent` of the cells do not exceed (nearest rank).
    pub(super) fn percentile(&self, percent: u64) -> u64 {
        let rank = (u128::from(self.cells()) * u128::from(percent)).div_ceil(100).max(1);
        let mut below = 0;
        let mut reached = self.0.iter().filter(|(_, cells)| {
            below += u128::from(**cells);
            below >= rank
        });
        reached.next().map_or(0, |(points, _)| *points)
    }

    /// The report on densities, in points per unit of area; `None` without cells.
    pub(super) fn report(&self, area: f64, required: Option<f64>) -> Option<QaDensity> {
        let cells = self.cells();
        let (lowest, highest) = (self.0.first_key_value()?, self.0.last_key_value()?);
        let points: u64 = self.0.iter().map(|(points, cells)| points * cells).sum();
        let density = |points: u64| points as f64 / area;
        let below = required.map(|required| {
            let below = self.0.iter().filter(|(points, _)| density(**points) < required);
            below.map(|(_, cells)| cells).sum::<u64>() as f64 / cells as f64
        });
        Some(QaDensity {
            points,
            mean: points as f64 / (cells as f64 * area),
            median: density(self.percentile(50)),
            lowest: density(*lowest.0),
            highest: density(*highest.0),
            percentiles: PERCENTILES
                .map(|percent| (percent, density(self.percentile(percent))))
                .to_vec(),
            below,
        })
    }
}
