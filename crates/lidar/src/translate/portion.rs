//! Some of the squares of a cloud, made of what lies near them.
//!
//! Where ground is asked for, points are read as far around as the discs of the triangulation reach, and further if
//! that was too little.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::noise::noted::Noise;
use super::squares::{Spans, SquareSplit};
use crate::grid::preset::CloudOverview;
use crate::grid::{CellSurroundings, near_steps};
use crate::points::PointStoreLimits;
use terrane_base::geom::PointFrame;
use terrane_cloud::PointSource;
use terrane_delaunay::SiteWindow;

/// What has to be known of the whole cloud before some squares are made.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct CloudKnowledge {
    /// Which points are noise, where that has to be known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) noise: Option<Noise>,
    /// Of the ground, where something is told of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) seen: Option<CloudOverview>,
}

impl CloudKnowledge {
    /// What was found, one line each.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> + '_ {
        let noise = self.noise.iter().flat_map(|noise| &noise.notes);
        noise.chain(self.seen.iter().flat_map(|seen| &seen.notes)).cloned()
    }
}

/// Squares that are made by themselves.
pub(super) struct SquarePortion<'a> {
    pub(super) spans: Spans,
    /// The points that are looked at, and how far around them the ground is.
    pub(super) near: CellSurroundings,
    /// What is known of the whole cloud.
    pub(super) looked: &'a CloudKnowledge,
    /// The cloud: of its parts only the bounds are asked.
    pub(super) points: &'a dyn PointSource,
    /// Where their files go.
    pub(super) folder: &'a Path,
    exceeded: AtomicBool,
}

impl<'a> SquarePortion<'a> {
    pub(super) fn new(
        (spans, near): (Spans, CellSurroundings),
        looked: &'a CloudKnowledge,
        points: &'a dyn PointSource,
        folder: &'a Path,
    ) -> Self {
        Self { spans, near, looked, points, folder, exceeded: AtomicBool::new(false) }
    }

    /// Which points are noise, where that is known.
    pub(super) fn noise(&self) -> Option<&Noise> {
        self.looked.noise.as_ref()
    }

    /// All points that may be in the files, or decide which are.
    pub(super) fn window(&self) -> SiteWindow {
        self.near.cells
    }

    /// Where the ground is to be known.
    pub(super) fn ground(&self) -> SiteWindow {
        self.near.window()
    }

    /// How far the ground that is read is all there is; where all that surrounds it is known, it is in the store.
    pub(super) fn limits(&self, is_surrounded: bool) -> PointStoreLimits {
        match is_surrounded {
            true => PointStoreLimits::with_hull(self.points, self.ground()),
            false => PointStoreLimits::new(self.points, self.ground()),
        }
    }

    /// Notes that more has to be read.
    pub(super) fn exceed(&self) {
        self.exceeded.store(true, Ordering::Relaxed);
    }

    /// True once more has to be read.
    pub(super) fn is_exceeded(&self) -> bool {
        self.exceeded.load(Ordering::Relaxed)
    }
}

/// What lies in squares, or no further from them than `margin`.
pub(super) fn window(
    squares: &SquareSplit,
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
