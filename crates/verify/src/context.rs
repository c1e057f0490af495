//! The context of every pass over a mesh and its grid.

use super::stated::is_delaunay;
use super::work::ProofResources;
use terrane_base::bound::ErrorBound;
use terrane_base::error::{Error, Result};
use terrane_engine::constraints::GridConstraints;
use terrane_mesh::Promises;
use terrane_proof::{HeightPrecision, Snapper};
use terrane_raster::GridSource;

/// Requirements that a mesh is checked against.
#[derive(Clone, Copy, Debug)]
pub struct MeshRequirements<'a> {
    /// Largest allowed vertical distance; errors are measured, not judged, when `None`.
    pub tolerance: Option<f64>,
    /// Where the tolerance holds.
    pub bound: ErrorBound,
    /// Minimum triangle angle in plan view, in degrees.
    pub min_angle: Option<f64>,
    /// Required samples and breaklines.
    pub kept: &'a GridConstraints,
}

impl MeshRequirements<'_> {
    /// A tolerance at samples.
    pub fn of_samples(tolerance: Option<f64>) -> Self {
        Self { tolerance, bound: ErrorBound::Samples, min_angle: None, kept: GridConstraints::NONE }
    }
}

/// Inputs shared by all passes over a grid.
pub(super) struct GridProofContext<'a> {
    pub(super) work: ProofResources<'a>,
    pub(super) grid: &'a dyn GridSource,
    pub(super) requirements: MeshRequirements<'a>,
    /// Promises in the header of the mesh.
    pub(super) stated: Promises,
    /// Vertices may lie above or below their samples.
    pub(super) is_fitted: bool,
    /// False where the mesh states a triangulation other than Delaunay.
    pub(super) is_delaunay: bool,
    pub(super) snapper: Snapper,
    pub(super) precision: HeightPrecision,
    /// See [`terrane_proof::GridProofPart::orientation`].
    pub(super) orientation: i128,
}

impl<'a> GridProofContext<'a> {
    pub(super) fn new(
        work: ProofResources<'a>,
        grid: &'a dyn GridSource,
        requirements: MeshRequirements<'a>,
    ) -> Result<Self> {
        check_grid(grid)?;
        let (info, map) = (work.mesh.info(), grid.info().transform);
        let size = [grid.info().width, grid.info().height];
        let stated = info.promises()?;
        Ok(Self {
            grid,
            requirements,
            is_fitted: stated.fitted.is_some(),
            is_delaunay: is_delaunay(&stated)?,
            stated,
            snapper: Snapper::new(map, size, info.origin, info.single_precision),
            precision: match info.single_precision {
                true => HeightPrecision::Single { origin: info.origin[2], scale: info.scale[2] },
                false => HeightPrecision::Double,
            },
            orientation: if map.determinant() < 0.0 { -1 } else { 1 },
            work,
        })
    }
}

pub(super) fn check_grid(grid: &dyn GridSource) -> Result<()> {
    if !grid.info().transform.is_valid() {
        return Err(Error::bad_input("the geotransform of the raster is not invertible"));
    }
    if grid.info().bounds().is_empty() {
        return Err(Error::bad_input("the raster has no samples"));
    }
    Ok(())
}
