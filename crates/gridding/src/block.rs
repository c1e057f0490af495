//! The cells of a part of a grid, and what has been kept of their points.

use super::method::Statistic;
use super::plane::{Hits, Plane};
use super::recipe::{Band, Recipe};
use terrane_base::error::Result;

/// What the numbers of cells are worth in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// World units of a step of height.
    pub scale: f64,
    /// World height of step 0.
    pub offset: f64,
    /// World area of a cell.
    pub area: f64,
}

/// Cells and what has been kept of their points.
#[derive(Clone, Debug)]
pub struct Block {
    planes: Vec<Plane>,
    /// The region that each plane is of.
    regions: Vec<usize>,
}

impl Block {
    /// `cells` cells without points.
    pub fn new(recipe: &Recipe, cells: usize) -> Self {
        let planes = recipe.planes.iter().map(|(_, primitive)| Plane::new(*primitive, cells));
        let regions = recipe.planes.iter().map(|(region, _)| *region).collect();
        Self { planes: planes.collect(), regions }
    }

    /// Takes in points of a region of the recipe.
    ///
    /// # Errors
    /// More than 2^32 - 1 points in a cell.
    pub fn add(&mut self, region: usize, hits: Hits<'_>) -> Result<()> {
        let planes = self.planes.iter_mut().zip(&self.regions);
        planes.filter(|(_, of)| **of == region).try_for_each(|(plane, _)| plane.add(hits))
    }

    /// Takes in what another block of the same cells and recipe has taken in.
    ///
    /// # Errors
    /// As for [`add`](Self::add).
    pub fn fold(&mut self, other: &Self) -> Result<()> {
        let mut planes = self.planes.iter_mut().zip(&other.planes);
        planes.try_for_each(|(plane, other)| plane.fold(other))
    }

    /// Must be called between the last [`add`](Self::add) or [`fold`](Self::fold) and
    /// [`value`](Self::value).
    pub fn settle(&mut self) {
        self.planes.iter_mut().for_each(Plane::settle);
    }

    /// Bytes it takes in memory.
    pub fn held(&self) -> usize {
        self.planes.iter().map(Plane::held).sum()
    }

    /// All it holds, as bytes that mean the same on this machine only.
    pub fn parts(&self) -> Vec<&[u8]> {
        self.planes.iter().map(Plane::bytes).collect()
    }

    /// The same, to be overwritten with parts of these lengths.
    pub fn parts_mut(&mut self, lengths: &[usize]) -> Vec<&mut [u8]> {
        let planes = self.planes.iter_mut().zip(lengths);
        planes.map(|(plane, length)| plane.bytes_mut(*length)).collect()
    }

    /// The value of a band in cell `at`; NaN where there is none.
    pub fn value(&self, band: &Band, at: usize, units: &Units) -> f64 {
        let steps = match band.statistic {
            Statistic::Count => return f64::from(self.plane(band, 0).count(at)),
            Statistic::Density => return f64::from(self.plane(band, 0).count(at)) / units.area,
            Statistic::Range => return self.range(band, at).map_or(f64::NAN, |z| z * units.scale),
            Statistic::Std { ddof } => {
                return self.deviation(band, at, ddof).map_or(f64::NAN, |z| z * units.scale);
            }
            Statistic::Min | Statistic::Max | Statistic::Nearest { .. } => self.height(band, 0, at),
            Statistic::Mean => self.mean(band, at),
            Statistic::Idw { .. } => {
                self.height(band, 1, at).or_else(|| self.plane(band, 0).weighted(at))
            }
            Statistic::Percentile { rank } => self.plane(band, 0).percentile(at, rank),
            // Cells know nothing of the points around them.
            Statistic::Tin { .. } | Statistic::Natural => None,
        };
        steps.map_or(f64::NAN, |steps| steps * units.scale + units.offset)
    }

    fn plane(&self, band: &Band, use_: usize) -> &Plane {
        &self.planes[band.planes[use_]]
    }

    fn height(&self, band: &Band, use_: usize, at: usize) -> Option<f64> {
        self.plane(band, use_).height(at).map(f64::from)
    }

    fn range(&self, band: &Band, at: usize) -> Option<f64> {
        Some(self.height(band, 1, at)? - self.height(band, 0, at)?)
    }

    fn mean(&self, band: &Band, at: usize) -> Option<f64> {
        let count = self.plane(band, 0).count(at);
        (count > 0).then(|| self.plane(band, 1).sum(at) as f64 / f64::from(count))
    }

    /// n sum(z^2) - sum(z)^2 is a whole number; only what follows is rounded.
    fn deviation(&self, band: &Band, at: usize, ddof: u8) -> Option<f64> {
        let count = self.plane(band, 0).count(at);
        let divisor = count.checked_sub(u32::from(ddof)).filter(|n| *n > 0)?;
        let sum = u128::from(self.plane(band, 1).sum(at).unsigned_abs());
        let spread = u128::from(count) * self.plane(band, 2).squares(at) - sum * sum;
        Some((spread as f64 / f64::from(count) / f64::from(divisor)).sqrt())
    }
}
