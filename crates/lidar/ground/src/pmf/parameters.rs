//! Parameters of the morphological filter.

/// Parameters of the filter. Lengths are in one unit for x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Side of a cell.
    pub cell: f64,
    /// A step of the heights.
    pub step: f64,
    /// Half the width of the largest objects to remove.
    pub window: f64,
    /// Steepest terrain, as rise over run; steeper parts are removed as objects.
    pub slope: f64,
    /// Largest distance of a ground point from the surface on level ground.
    pub height: f64,
    /// Increase of that distance for each unit of rise from a cell to the next: the lowest point of a cell lies
    /// at its lower end.
    pub scaling: f64,
    /// Depth below its neighbours at which a low point is noise.
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
        (self.window / self.cell).ceil().clamp(1.0, MAX_RADIUS) as usize
    }
}

/// Most cells of half a window.
const MAX_RADIUS: f64 = 1024.0;
