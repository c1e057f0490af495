//! The quality of a written mesh as a triangulation, out of core: measured, not judged.
//!
//! For the mesh alone, triangles are spread over square tiles of the plane through a temporary file, and
//! each tile is measured by itself ([`terrane_proof::quality`]). With a grid, they are spread once more
//! over rectangles of its samples, where triangles are compared with slopes ([`terrane_proof::slope`]).
//! Nothing in the report depends on threads, memory budget, or the order of work.

mod report;
mod shapes;
mod slopes;

use std::path::Path;

use super::context::check_grid;
use super::stated::refuse_solid;
use super::work::{MIN_MEMORY, ProofResources};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point3;
use terrane_engine::ground_units::GroundScale;
use terrane_engine::input::is_geographic;
use terrane_engine::memory::cache_beside;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_mesh::MeshSource;
use terrane_proof::quality::QualityLattice;
use terrane_raster::GridSource;

pub use report::{AngleReport, AngleShare, AspectReport, DegreeReport, QualityReport, SlopeReport};

/// A mesh to be measured.
#[derive(Clone, Copy)]
pub struct MeasuredMesh<'a> {
    /// Its file.
    pub file: &'a Path,
    /// The mesh.
    pub mesh: &'a dyn MeshSource,
    /// Smallest and largest coordinates of its vertices; `None` without any.
    pub bounds: Option<[Point3; 2]>,
}

/// A grid for the comparison of slopes.
#[derive(Clone, Copy)]
pub struct SlopeReference<'a> {
    /// Its file or display name.
    pub name: &'a Path,
    /// The grid.
    pub grid: &'a dyn GridSource,
}

/// Measures the quality of a mesh, and that of its slopes where there is a grid. A caller's caches of both
/// are not part of the memory budget, of which this takes about half.
///
/// # Errors
/// A solid, a triangle with an invalid vertex index, too little memory, a grid with coordinates or
/// heights that are not lengths, and errors of the sources.
pub fn quality(
    measured: MeasuredMesh<'_>,
    against: Option<SlopeReference<'_>>,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<QualityReport> {
    let MeasuredMesh { file, mesh, bounds } = measured;
    refuse_solid(mesh.info()).map_err(|e| in_mesh(e, file))?;
    let against = against.map(|SlopeReference { name, grid }| {
        let ground = check_grid(grid).and_then(|()| GroundScale::of(grid.info()));
        ground.map(|ground| (grid, ground)).map_err(|e| e.in_file(name))
    });
    let against = against.transpose()?;
    // The grid stays open with a cache of decoded blocks.
    let budget = resources.memory;
    let memory = (budget - cache_beside(budget) as u64).max(budget.min(MIN_MEMORY));
    let resources = &Resources { memory, ..resources.clone() };
    let work = || ProofResources::new(mesh, None, resources, progress, cancel);
    let info = mesh.info();
    let has_space = !is_geographic(info);
    // A mesh without vertices has no triangles to place, so any bounds do.
    let plan = QualityLattice::new(bounds.unwrap_or_default(), info.origin, info.single_precision);
    let (found, broken) =
        shapes::measure(&work()?, &plan, has_space).map_err(|e| in_mesh(e, file))?;
    let mut report = QualityReport::new(&found, broken, plan.cell(), has_space);
    if let Some((grid, ground)) = against {
        report.slope = Some(slopes::measure(work()?, grid, &ground).map_err(|e| in_mesh(e, file))?);
    }
    Ok(report)
}

/// Adds the file of the mesh to errors of its contents.
fn in_mesh(error: Error, file: &Path) -> Error {
    match error.kind() {
        ErrorKind::BadInput | ErrorKind::Unsupported => error.in_file(file),
        _ => error,
    }
}
