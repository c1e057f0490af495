//! The part of a point cloud to read for some cells.

use terrane_base::geom::{PointFrame, REACH};
use terrane_delaunay::SiteWindow;

/// Growth factor of a margin that was too small.
const WIDER: i32 = 4;

/// The surroundings of some cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellSurroundings {
    /// Window of the points of the statistics.
    pub(crate) cells: SiteWindow,
    /// Steps around them.
    pub(crate) margin: i32,
}

impl CellSurroundings {
    pub(crate) fn window(self) -> SiteWindow {
        self.cells.grown(self.margin)
    }

    /// The window with its margin.
    pub(crate) fn beyond(self) -> SiteWindow {
        self.window().grown(self.margin)
    }

    pub(crate) fn wider(self) -> Self {
        Self { margin: self.margin.saturating_mul(WIDER).min(REACH), ..self }
    }
}

/// The range of steps of a world interval, with one step more.
pub(crate) fn near_steps(frame: &PointFrame, axis: usize, [low, high]: [f64; 2]) -> [i32; 2] {
    let low = frame.steps(axis, low).floor() - 1.0;
    let high = frame.steps(axis, high).ceil() + 1.0;
    [low, high].map(|steps| steps.clamp(f64::from(-REACH), f64::from(REACH)) as i32)
}
