//! Bands that need the points around a cell, not only those in it.

use std::path::Path;

use super::extent::Extent;
use crate::cloud::CloudInfo;
use crate::delaunay::Hull;
use crate::error::Result;
use crate::geom::{Frame, Point, Rect};
use crate::gridding::Statistic;
use crate::pipeline::points::{PointStore, Positions, Shape, Surface, Tiling};

/// Bytes that a thread holds for the points around the cells it is at.
pub(super) const WORKER: u64 = 32 << 20;

/// All points of a cloud, for surfaces through them.
pub(super) struct Surfaces {
    store: PointStore,
    hull: Hull,
    frame: Frame,
}

/// A store for the points of a cloud, of which about `memory` bytes may be in memory.
pub(super) fn store(cloud: &CloudInfo, folder: &Path, memory: u64) -> PointStore {
    let nowhere = [Point::default(); 2];
    PointStore::empty(Tiling::new(cloud.bounds.unwrap_or(nowhere), cloud.count), folder, memory)
}

impl Surfaces {
    /// Through the points of a store that is complete.
    pub(super) fn new(store: PointStore, frame: Frame) -> Result<Self> {
        let hull = store.hull()?;
        Ok(Self { store, hull, frame })
    }

    /// Bytes that went to the temporary file.
    pub(super) fn spilled_bytes(&self) -> u64 {
        self.store.spilled()
    }

    /// The values of a statistic at the centres of the cells of `rect`, NaN where there is no surface.
    pub(super) fn values(
        &self,
        statistic: Statistic,
        max_edge: Option<f64>,
        extent: &Extent,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        let shape = match statistic {
            Statistic::Natural => Shape::Natural,
            Statistic::Tin { max_edge: own } => Shape::Linear { max_edge: own.or(max_edge) },
            _ => return Ok(()),
        };
        let Self { store, hull, frame } = self;
        let surface = Surface { store, hull, frame: *frame, shape };
        let (x, y) = (extent.lattice.x, extent.lattice.y);
        let cols = rect.col..rect.col + rect.width;
        let rows = rect.row..rect.row + rect.height;
        let xs: Vec<f64> = cols.map(|col| frame.steps(0, x.world_centre(col.into()))).collect();
        let ys: Vec<f64> = rows.map(|row| frame.steps(1, y.world_centre(row.into()))).collect();
        surface.fill(Positions { xs: &xs, ys: &ys }, out)
    }
}
