//! What is seen from above, by one of the methods.

use super::super::extent::Extent;
use super::pit_free::Layers;
use super::spike_free::BySquare;
use terrane_base::error::Result;
use terrane_base::geom::Rect;

/// A surface.
pub(super) enum Top {
    PitFree(Layers),
    SpikeFree(Box<BySquare>),
}

impl Top {
    /// True when points were needed that were not read.
    pub(super) fn is_exceeded(&self) -> bool {
        match self {
            Self::PitFree(layers) => layers.is_exceeded(),
            Self::SpikeFree(heights) => heights.is_exceeded(),
        }
    }

    /// Bytes that went to temporary files.
    pub(super) fn spilled(&self) -> u64 {
        match self {
            Self::PitFree(layers) => layers.spilled(),
            Self::SpikeFree(heights) => heights.spilled(),
        }
    }

    /// World heights at the centres of the cells of `rect`, NaN where there is no surface.
    pub(super) fn values(
        &self,
        max_edge: Option<f64>,
        extent: &Extent,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        match self {
            Self::PitFree(layers) => layers.values(max_edge, extent, rect, out),
            Self::SpikeFree(heights) => heights.values(max_edge, extent, rect, out),
        }
    }
}
