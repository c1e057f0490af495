//! What is read of a cloud for some of its cells.

use terrane_base::geom::{PointFrame, REACH};
use terrane_delaunay::SiteWindow;

/// How many times wider a margin becomes when one was too small.
const WIDER: i32 = 4;

/// What lies near some cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellSurroundings {
    /// What statistics of the cells are made of.
    pub(crate) cells: SiteWindow,
    /// Steps around them.
    pub(crate) margin: i32,
}

impl CellSurroundings {
    pub(crate) fn window(self) -> SiteWindow {
        self.cells.grown(self.margin)
    }

    /// What lies near all of the window.
    pub(crate) fn beyond(self) -> SiteWindow {
        self.window().grown(self.margin)
    }

    pub(crate) fn wider(self) -> Self {
        Self { margin: self.margin.saturating_mul(WIDER).min(REACH), ..self }
    }
}

/// The steps that two ends of a world axis lie between, and one more.
pub(crate) fn near_steps(frame: &PointFrame, axis: usize, [low, high]: [f64; 2]) -> [i32; 2] {
    let low = frame.steps(axis, low).floor() - 1.0;
    let high = frame.steps(axis, high).ceil() + 1.0;
    [low, high].map(|steps| steps.clamp(f64::from(-REACH), f64::from(REACH)) as i32)
}
