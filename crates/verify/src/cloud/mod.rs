//! Proof of a written mesh against its source point cloud.
//!
//! Four passes: points, vertices and triangles are spread over rectangles of the plane; then each
//! rectangle is checked by itself ([`terrane_proof::cloud`]).
//!
//! Vertices within the rounding of their storage are mapped back to whole steps, and every point is judged in
//! `i128`. The outline and the area of the mesh must be those of the convex hull, which is computed
//! independently while the points are read.

mod constraints;
mod context;
mod parts;
mod points;
mod report;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::time::Instant;

use super::buckets::MeshSpread;
use super::header::{CheckedHeader, judge_bounds};
use super::options::{CloudMeshProof, ProofQuestion};
use super::stated::{leave_files, open_mesh, stated, tolerance};
use super::work::ProofResources;
use context::{CloudProofContext, no_surface, surface_bounds};
use terrane_base::error::{ErrorKind, Result};
use terrane_cloud::{self as cloud, PointSource};
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::memory::with_polygons;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_mesh::MeshSource;

pub use report::{CloudProofFindings, CloudVerifyReport};

/// Runs a verification. An error means that it could not be done; a mesh that breaks a promise is
/// not an error, but a report with `passed` false.
///
/// # Errors
/// As [`prove_cloud`], and all errors of the files.
pub(super) fn verify_cloud(
    job: &ProofQuestion<'_, CloudMeshProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudVerifyReport> {
    let mesh = open_mesh(&job.written.file)?;
    let options = [("max error", "‹max_error›", job.options.tolerance().is_some())];
    let stated = stated(mesh.info(), &options).map_err(|e| e.in_file(&job.written.file))?;
    let opening = job.options.cloud.options(&job.options.resources)?;
    let source = cloud::source(job.written.original.names(), &opening)?;
    let tolerance = job.options.tolerance().or(tolerance(&stated));
    let [points, lines] =
        [&job.options.constraints.keep_points, &job.options.constraints.breaklines]
            .map(Option::as_deref);
    let features = ConstraintFeatures::read_for_cloud(points, lines, &job.options.resources)?;
    let cloud = job.written.original.names().join(" ");
    surface_bounds(&*source).map_err(|e| e.in_file(Path::new(&cloud)))?;
    let proved = with_polygons(&opening, &job.options.resources, |resources| {
        prove_cloud(&*mesh, &*source, tolerance, features, &resources, progress, cancel)
    });
    let mut report = proved.map_err(|e| match e.kind() {
        ErrorKind::BadInput if e.path().is_none() => e.in_file(&job.written.file),
        _ => e,
    })?;
    let crs = &source.info().crs;
    let header = CheckedHeader {
        mesh: &job.written.file,
        info: mesh.info(),
        stated: &stated,
        crs,
        original: "cloud",
    };
    report.run.memory_budget = job.options.resources.memory;
    header.judge(&mut report.verdict)?;
    judge_bounds(&*mesh, &mut report.verdict, progress, cancel)?;
    for (key, text) in stated.statements().filter(|(key, _)| !OF_CLOUDS.contains(key)) {
        report
            .verdict
            .leave(format!("the statement \"{key} {text}\" (not applicable to point clouds)"));
    }
    let given = [
        job.options.constraints.keep_points.is_some(),
        job.options.constraints.breaklines.is_some(),
    ];
    leave_files(&stated, given, &mut report.verdict);
    let mesh = job.written.file.display().to_string();
    Ok(CloudVerifyReport { mesh, of: CloudProofFindings { cloud, ..report.of }, ..report })
}

/// Keys of statements that are judged for clouds, or are not promises.
const OF_CLOUDS: [&str; 6] =
    ["crs", "source", "max error", "triangulation", "keep points", "breaklines"];

/// Proves `mesh` against the points of `source`, and its constraints. The memory of the two sources is not part of
/// the budget, of which this takes about half.
///
/// # Errors
/// A tolerance that is not a number, points without a surface, a triangle with an invalid vertex index, too
/// little memory, and errors of the sources.
pub fn prove_cloud(
    mesh: &dyn MeshSource,
    source: &dyn PointSource,
    tolerance: Option<f64>,
    features: ConstraintFeatures,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudVerifyReport> {
    let start = Instant::now();
    let work = ProofResources::new(mesh, tolerance, resources, progress, cancel)?;
    let mut context = CloudProofContext::new(work, source, tolerance, features)?;
    let layout = parts::layout(&context)?;
    let points = points::SpreadPoints::fill(&context, layout)?;
    let hull = points.hull.as_ref().ok_or_else(no_surface)?;
    let constraints = constraints::ConstraintChecks::new(&context, &points, hull, layout)?;
    context.work.set_aside(constraints.bytes());
    let spread = MeshSpread::fill(&context.work, &context.placer, layout)?;
    let (tally, respread) = parts::check(&context, &points, hull, &spread, &constraints)?;
    let mut report = report::report(&context, &points, hull, &spread, &constraints, &tally)?;
    let spilled = points.bytes() + spread.bytes() + respread;
    report.run = context.work.statistics(start, resources, spilled);
    report.of.points_per_second = report.run.rate(report.of.points.read);
    Ok(report)
}
