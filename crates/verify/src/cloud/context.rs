//! The context of every pass over a mesh and its cloud.

use crate::stated::is_delaunay;
use crate::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::PointSource;
use terrane_engine::cloud_constraints::OnCloud;
use terrane_engine::constraints::ConstraintFeatures;
use terrane_mesh::Promises;
use terrane_proof::cloud::{LatticeSnapper, VerticalBound};

/// Inputs shared by all passes over a point cloud.
pub(super) struct CloudProofContext<'a> {
    pub(super) work: ProofResources<'a>,
    pub(super) source: &'a dyn PointSource,
    /// Lowest and highest coordinates of all points.
    pub(super) bounds: [Point; 2],
    pub(super) placer: LatticeSnapper,
    pub(super) tolerance: Option<f64>,
    pub(super) bound: Option<VerticalBound>,
    pub(super) constraints: OnCloud,
    /// Promises in the header of the mesh.
    pub(super) stated: Promises,
    /// False where the mesh states a triangulation other than Delaunay.
    pub(super) is_delaunay: bool,
    /// The mesh has vertices on lines that are not given.
    pub(super) has_posts: bool,
}

impl<'a> CloudProofContext<'a> {
    pub(super) fn new(
        mut work: ProofResources<'a>,
        source: &'a dyn PointSource,
        tolerance: Option<f64>,
        features: ConstraintFeatures,
    ) -> Result<Self> {
        let bounds = surface_bounds(source)?;
        let constraints = features.on_cloud(source.info(), bounds)?;
        work.set_aside(constraints.bytes());
        let stated = work.mesh.info().promises()?;
        let is_delaunay = is_delaunay(&stated)?;
        let has_posts = !constraints.has_lines() && stated.breaklines.is_some();
        let (frame, mesh) = (source.info().frame, work.mesh.info());
        let reach = constraints.and_heights(bounds);
        let placer = LatticeSnapper::new(frame, reach, mesh.origin, mesh.single_precision);
        let bound = tolerance.map(|tolerance| VerticalBound::new(tolerance, frame.scale[2]));
        Ok(Self {
            work,
            source,
            bounds,
            placer,
            tolerance,
            bound,
            constraints,
            stated,
            is_delaunay,
            has_posts,
        })
    }
}

/// The bounds of a cloud that may have a surface.
pub(super) fn surface_bounds(source: &dyn PointSource) -> Result<[Point; 2]> {
    source.info().bounds.ok_or_else(no_surface)
}

pub(super) fn no_surface() -> Error {
    Error::bad_input("the points have no surface: fewer than three, or all on a line")
        .remedy("check the filters, or the files with `terrane info`")
}
