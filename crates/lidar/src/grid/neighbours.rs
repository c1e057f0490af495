//! Bands computed from the points around a cell, not only those in it.

use super::extent::{CellRequest, GridExtent};
use crate::point_index::{
    ColumnRowPositions, InterpolatedSurface, PointStore, SurroundingPoints, Tiling,
};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Point, PointFrame, Rect};
use terrane_cloud::CloudInfo;
use terrane_delaunay::{ConvexHull, FixedPosition, Location, SiteWindow, interpolate};
use terrane_gridding::{Statistic, SurfaceInterpolation};

/// Bytes that a thread holds for the points around the cells it is at.
pub(crate) const WORKER: u64 = 32 << 20;

/// All points of a cloud, for surfaces through them.
pub(crate) struct CloudSurfaces {
    store: PointStore,
    hull: ConvexHull,
    frame: PointFrame,
}

/// The tiling of the points of a point cloud.
pub(crate) fn tiling(cloud: &CloudInfo) -> Tiling {
    let nowhere = [Point::default(); 2];
    Tiling::new(cloud.bounds.unwrap_or(nowhere), cloud.count)
}

impl CloudSurfaces {
    /// Surfaces through the points of a complete store.
    pub(crate) fn new(store: PointStore, frame: PointFrame) -> Result<Self> {
        let hull = store.hull()?;
        Ok(Self { store, hull, frame })
    }

    /// The points.
    pub(crate) fn store(&self) -> &PointStore {
        &self.store
    }

    /// Bytes that went to the temporary file.
    pub(super) fn spilled_bytes(&self) -> u64 {
        self.store.spilled()
    }

    /// The values of a statistic at the centres of cells, NaN outside the surface.
    pub(super) fn values(
        &self,
        statistic: Statistic,
        piece: CellRequest<'_>,
        out: &mut [f64],
    ) -> Result<()> {
        let shape = match statistic.shape() {
            Some(SurfaceInterpolation::Linear { max_edge }) => {
                SurfaceInterpolation::Linear { max_edge: max_edge.or(piece.max_edge) }
            }
            Some(SurfaceInterpolation::Natural) => SurfaceInterpolation::Natural,
            None => return Ok(()),
        };
        let Self { store, hull, frame } = self;
        if store.is_exceeded() {
            return Err(more_is_needed());
        }
        let surface = InterpolatedSurface { store, hull, frame: *frame, shape };
        let centres = CellCenters::new(piece.extent, piece.rect, frame);
        surface.fill(centres.positions(), out)
    }

    /// The height in steps of the linear surface at each of `points`, which are close together; `None` outside.
    pub(crate) fn under(
        &self,
        points: &[Point],
        mut each: impl FnMut(&Point, Option<f64>),
    ) -> Result<()> {
        let (sites, mut left) = (points.iter().map(|p| [p.x, p.y]), points.iter());
        let Some(window) = SiteWindow::of(sites.clone()) else { return Ok(()) };
        let mut around = SurroundingPoints::new(&self.store, window)?;
        let positions = sites.map(FixedPosition::of);
        around.find_all(&self.hull, positions, |position, location| {
            let height = match location {
                Location::At(point) => Some(f64::from(point.z)),
                Location::Triangle(corners) => Some(interpolate(&corners, position)),
                Location::Outside => None,
            };
            left.next().into_iter().for_each(|point| each(point, height));
        })
    }
}

/// The error of a part that does not suffice.
pub(crate) fn more_is_needed() -> Error {
    Error::new(ErrorKind::Resource, "more of the point cloud has to be read")
}

/// The centres of cells, in steps.
pub(super) struct CellCenters {
    xs: Vec<f64>,
    ys: Vec<f64>,
}

impl CellCenters {
    /// The centres of the cells of `rect`.
    pub(super) fn new(extent: &GridExtent, rect: Rect, frame: &PointFrame) -> Self {
        let (x, y) = (extent.lattice.x, extent.lattice.y);
        let cols = rect.col..rect.col + rect.width;
        let rows = rect.row..rect.row + rect.height;
        let xs = cols.map(|col| frame.steps(0, x.world_centre(col.into()))).collect();
        let ys = rows.map(|row| frame.steps(1, y.world_centre(row.into()))).collect();
        Self { xs, ys }
    }

    pub(super) fn positions(&self) -> ColumnRowPositions<'_> {
        ColumnRowPositions { xs: &self.xs, ys: &self.ys }
    }
}
