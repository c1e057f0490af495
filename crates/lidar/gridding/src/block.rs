//! The cells of a part of a grid, with the accumulators of their points.

use super::cell::{CellUnits, StatisticCell};
use super::plane::{AccumulatorPlane, CellHits};
use super::recipe::{StatisticBand, StatisticRecipe};
use terrane_base::error::Result;

/// Cells with the accumulators of their points.
#[derive(Debug)]
pub struct CellBlock {
    planes: Vec<Box<dyn AccumulatorPlane>>,
    /// The region of each plane.
    regions: Vec<usize>,
}

impl CellBlock {
    /// `cells` cells without points.
    pub fn new(recipe: &StatisticRecipe, cells: usize) -> Self {
        let planes = recipe.planes.iter().map(|(_, kind)| (kind.make)(cells, kind.parameters));
        let regions = recipe.planes.iter().map(|(region, _)| *region).collect();
        Self { planes: planes.collect(), regions }
    }

    /// Adds points of a region of the recipe.
    ///
    /// # Errors
    /// More than 2^32 - 1 points in a cell.
    pub fn add(&mut self, region: usize, hits: CellHits<'_>) -> Result<()> {
        let planes = self.planes.iter_mut().zip(&self.regions);
        planes.filter(|(_, of)| **of == region).try_for_each(|(plane, _)| plane.add(hits))
    }

    /// Merges another block of the same cells and recipe.
    ///
    /// # Errors
    /// As for [`add`](Self::add).
    pub fn fold(&mut self, other: &Self) -> Result<()> {
        let mut planes = self.planes.iter_mut().zip(&other.planes);
        planes.try_for_each(|(plane, other)| plane.fold(&**other))
    }

    /// Must be called between the last [`add`](Self::add) or [`fold`](Self::fold) and
    /// [`value`](Self::value).
    pub fn settle(&mut self) {
        self.planes.iter_mut().for_each(|plane| plane.settle());
    }

    /// Bytes in memory.
    pub fn memory_use(&self) -> usize {
        self.planes.iter().map(|plane| plane.memory_use()).sum()
    }

    /// Its content as bytes, valid on this machine only.
    pub fn parts(&self) -> Vec<&[u8]> {
        self.planes.iter().map(|plane| plane.bytes()).collect()
    }

    /// Its content as mutable bytes, resized to these lengths.
    pub fn parts_mut(&mut self, lengths: &[usize]) -> Vec<&mut [u8]> {
        let planes = self.planes.iter_mut().zip(lengths);
        planes.map(|(plane, length)| plane.bytes_mut(*length)).collect()
    }

    /// The value of a band in cell `at`; NaN where there is none.
    pub fn value(&self, band: &StatisticBand, at: usize, units: &CellUnits) -> f64 {
        let units = &band.units(units);
        let cell = StatisticCell { planes: &self.planes, uses: &band.planes, at, units };
        band.statistic.value(&cell, band.is_real)
    }
}
