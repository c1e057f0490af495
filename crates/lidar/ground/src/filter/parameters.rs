//! Parameters of the morphological filter.

/// What is ground. Lengths are in one unit, the same for x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Side of a cell.
    pub cell: f64,
    /// A step of the heights.
    pub step: f64,
    /// Half the width of the largest objects that are taken off.
    pub window: f64,
    /// Steepest terrain, as rise over run; what is steeper is cut off as an object.
    pub slope: f64,
    /// How far from the surface a ground point may lie on level ground.
    pub height: f64,
    /// How much further it may lie where the terrain is not level, for each unit that it rises from
    /// a cell to the next: a cell's lowest point lies at its lower end.
    pub scaling: f64,
    /// How far a low point must lie below all but a few around it to be noise.
    pub depth: f64,
}

impl Parameters {
    /// The usual values for cells of side `cell` and heights in steps of `step`, in metres.
    pub fn metres(cell: f64, step: f64) -> Self {
        let (window, slope, height, scaling, depth) = (18.0, 0.15, 0.5, 1.25, 1.0);
        Self { cell, step, window, slope, height, scaling, depth }
    }

    /// Half the width of the largest window, in cells.
    pub(super) fn radius(&self) -> usize {
        (self.window / self.cell).ceil().clamp(1.0, MOST_RADIUS) as usize
    }
}

/// Most cells of half a window.
const MOST_RADIUS: f64 = 1024.0;
