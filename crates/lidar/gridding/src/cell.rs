//! One cell: the accumulators of its points, and the values of its statistics.

use super::plane::{AccumulatorPlane, CellAccumulator, DensePlane, like};

/// Units of the accumulators of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellUnits {
    /// World units of a step of height.
    pub scale: f64,
    /// World height of step 0.
    pub offset: f64,
    /// World area of a cell.
    pub area: f64,
}

impl CellUnits {
    /// A height in steps as one in world units.
    pub(super) fn height(&self, steps: Option<f64>) -> f64 {
        steps.map_or(f64::NAN, |steps| steps * self.scale + self.offset)
    }

    /// A difference of heights in steps as one in world units.
    pub(super) fn difference(&self, steps: Option<f64>) -> f64 {
        steps.map_or(f64::NAN, |steps| steps * self.scale)
    }
}

/// Accumulators of one cell for one statistic.
pub(super) struct StatisticCell<'a> {
    pub(super) planes: &'a [Box<dyn AccumulatorPlane>],
    /// The planes of the statistic, in its order.
    pub(super) uses: &'a [usize],
    pub(super) at: usize,
    pub(super) units: &'a CellUnits,
}

impl<'a> StatisticCell<'a> {
    /// The plane of the statistic at index `of`.
    pub(super) fn plane<P: AccumulatorPlane>(&self, of: usize) -> Option<&'a P> {
        like(&*self.planes[self.uses[of]]).ok()
    }

    /// The accumulator of the cell in that plane.
    pub(super) fn accumulator<K: CellAccumulator>(&self, of: usize) -> K {
        self.plane::<DensePlane<K>>(of).map_or(K::NONE, |DensePlane(cells)| cells[self.at])
    }
}
