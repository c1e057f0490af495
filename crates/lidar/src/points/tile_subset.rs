//! Some of the tiles of a point cloud, computed from the points near them.
//!
//! If the ground is needed, points are read as far around as the circles of the triangulation reach, and
//! further if necessary.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::stages::noise::noise_index::Noise;
use super::tiled_output::{PointTiling, Spans};
use crate::grid::surface_model::CloudOverview;
use crate::grid::{CellSurroundings, near_steps};
use crate::point_index::PointStoreCoverage;
use terrane_base::geom::PointFrame;
use terrane_cloud::PointSource;
use terrane_delaunay::SiteWindow;

/// Statistics of the whole point cloud for a subset of tiles.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct CloudKnowledge {
    /// The noise, if needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) noise: Option<Noise>,
    /// Statistics of the ground, if needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) seen: Option<CloudOverview>,
}

impl CloudKnowledge {
    /// Notes, one line each.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> + '_ {
        let noise = self.noise.iter().flat_map(|noise| &noise.notes);
        noise.chain(self.seen.iter().flat_map(|seen| &seen.notes)).cloned()
    }
}

/// A subset of the tiles.
pub(super) struct TileSubset<'a> {
    pub(super) spans: Spans,
    /// The window of points, and the margin of the ground around it.
    pub(super) near: CellSurroundings,
    /// Statistics of the whole point cloud.
    pub(super) knowledge: &'a CloudKnowledge,
    /// The point cloud; only the bounds of its parts are used.
    pub(super) points: &'a dyn PointSource,
    /// Output folder.
    pub(super) folder: &'a Path,
    exceeded: AtomicBool,
}

impl<'a> TileSubset<'a> {
    pub(super) fn new(
        spans: Spans,
        near: CellSurroundings,
        knowledge: &'a CloudKnowledge,
        points: &'a dyn PointSource,
        folder: &'a Path,
    ) -> Self {
        Self { spans, near, knowledge, points, folder, exceeded: AtomicBool::new(false) }
    }

    /// The noise, if known.
    pub(super) fn noise(&self) -> Option<&Noise> {
        self.knowledge.noise.as_ref()
    }

    /// The window of all points in the files, and of points that affect the selection.
    pub(super) fn window(&self) -> SiteWindow {
        self.near.cells
    }

    /// The window of the ground.
    pub(super) fn ground(&self) -> SiteWindow {
        self.near.window()
    }

    /// Limits of the ground that is read; if its hull is known, it is in the store.
    pub(super) fn limits(&self, is_surrounded: bool) -> PointStoreCoverage {
        match is_surrounded {
            true => PointStoreCoverage::with_hull(self.points, self.ground()),
            false => PointStoreCoverage::new(self.points, self.ground()),
        }
    }

    /// Records that more has to be read.
    pub(super) fn exceed(&self) {
        self.exceeded.store(true, Ordering::Relaxed);
    }

    /// True once more has to be read.
    pub(super) fn is_exceeded(&self) -> bool {
        self.exceeded.load(Ordering::Relaxed)
    }
}

/// The window of tiles with a `margin`.
pub(super) fn window(
    squares: &PointTiling,
    spans: Spans,
    margin: f64,
    frame: &PointFrame,
) -> SiteWindow {
    let margin = margin + squares.buffer;
    let ends = [0, 1].map(|axis| {
        let [first, last] = spans[axis];
        let low = first as f64 * squares.side - margin;
        let high = (last + 1) as f64 * squares.side + margin;
        near_steps(frame, axis, [low, high])
    });
    SiteWindow { low: ends.map(|[low, _]| low), high: ends.map(|[_, high]| high) }
}
