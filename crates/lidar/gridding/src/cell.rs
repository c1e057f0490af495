//! One cell: the numbers kept of its points, and the values of its statistics.

use super::plane::{Cells, Keep, Plane, like};

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

impl Units {
    /// A height in steps as one in world units.
    pub(super) fn height(&self, steps: Option<f64>) -> f64 {
        steps.map_or(f64::NAN, |steps| steps * self.scale + self.offset)
    }

    /// A difference of heights in steps as one in world units.
    pub(super) fn difference(&self, steps: Option<f64>) -> f64 {
        steps.map_or(f64::NAN, |steps| steps * self.scale)
    }
}

/// What has been kept of the points of one cell, for one statistic.
pub(super) struct Cell<'a> {
    pub(super) planes: &'a [Box<dyn Plane>],
    /// The planes of the statistic, in the order it needs them in.
    pub(super) uses: &'a [usize],
    pub(super) at: usize,
    pub(super) units: &'a Units,
}

impl<'a> Cell<'a> {
    /// The plane that the statistic has named at `of`.
    pub(super) fn plane<P: Plane>(&self, of: usize) -> Option<&'a P> {
        like(&*self.planes[self.uses[of]]).ok()
    }

    /// What that plane has kept of the cell.
    pub(super) fn kept<K: Keep>(&self, of: usize) -> K {
        self.plane::<Cells<K>>(of).map_or(K::NONE, |Cells(cells)| cells[self.at])
    }
}
