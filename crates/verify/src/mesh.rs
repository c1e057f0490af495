//! `terrane verify` of a mesh file against its grid: what the mesh promises, the proof, and what remains unchecked.

use std::path::Path;

use super::bands::{MultibandProof, not_judged};
use super::context::{MeshRequirements, check_grid};
use super::header::{CheckedHeader, judge_bounds};
use super::options::{MeshProof, ProofQuestion};
use super::parts::verify;
use super::report::{OfGrid, VerifyReport};
use super::stated::{leave_files, open_mesh, stated, tolerance};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Crs;
use terrane_engine::bands::{JoinedBands, label};
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::memory::cache_beside;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::{Cancel, Progress};
use terrane_mesh::{HeightBand, MeshSource, Promises};
use terrane_raster as raster;

/// Verifies a mesh against its grid. A broken promise is not an error: it is reported, with `passed` false.
///
/// # Errors
/// A mesh or a grid that cannot be read; a mesh with invalid or contradictory statements, a solid, or one in another CRS
/// than its grid; options that do not apply; too little memory; `Interrupted`.
pub(super) fn run(
    job: &ProofQuestion<'_, MeshProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let bands = job.options.selected_bands()?;
    let mesh = open_mesh(&job.written.file)?;
    // Keys of statements, the options that replace them, and whether an invalid statement may be ignored: the option is
    // given, or this proof does not use the statement.
    let options = [
        ("max error", "‹max_error›", job.options.tolerance().is_some()),
        ("bound", "‹bound›", job.options.bound.is_some()),
        ("min angle", "‹min_angle›", job.options.min_angle.is_some()),
        ("bands", "‹bands›", bands.is_none()),
        ("weights", "‹weights›", bands.as_ref().is_none_or(|bands| !bands.weights.is_empty())),
        ("heights", "‹band›", bands.as_ref().is_none_or(|bands| bands.heights.is_some())),
    ];
    let stated = stated(mesh.info(), &options).map_err(|e| e.in_file(&job.written.file))?;
    refuse_reprojected(&stated).map_err(|e| e.in_file(&job.written.file))?;
    let (mut report, crs) = match &bands {
        Some(bands) => {
            let proof = MultibandProof { job, mesh: &*mesh, stated: &stated, progress, cancel };
            name_mesh(proof.run(bands), job)?
        }
        None => prove_heights(&*mesh, &stated, job, progress, cancel)?,
    };
    let header = CheckedHeader {
        mesh: &job.written.file,
        info: mesh.info(),
        stated: &stated,
        crs: &crs,
        original: "grid",
    };
    header.judge(&mut report.verdict)?;
    judge_bounds(&*mesh, &mut report.verdict, progress, cancel)?;
    leave_unrequested(&stated, job, &mut report.verdict);
    let mesh = job.written.file.display().to_string();
    let of = OfGrid { raster: job.written.original.to_string(), ..report.of };
    Ok(VerifyReport { mesh, of, ..report })
}

/// Fails for a mesh that was reprojected when it was written: its vertices are not samples of the grid.
fn refuse_reprojected(stated: &Promises) -> Result<()> {
    let Some(from) = &stated.transformed_from else { return Ok(()) };
    let message = format!("was transformed from {from}: its vertices are not samples of the grid");
    Err(Error::unsupported(message).remedy("verify a mesh made without ‹to_crs›"))
}

/// Adds the name of the mesh to errors about its content.
fn name_mesh<T>(result: Result<T>, job: &ProofQuestion<'_, MeshProof>) -> Result<T> {
    result.map_err(|e| match e.kind() {
        ErrorKind::BadInput => e.in_file(&job.written.file),
        _ => e,
    })
}

/// Proves the heights of a mesh, its vertices, edges and outline; also returns the CRS of the grid.
fn prove_heights(
    mesh: &dyn MeshSource,
    stated: &Promises,
    job: &ProofQuestion<'_, MeshProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(VerifyReport, Crs)> {
    let options = job
        .options
        .grid
        .options(&job.options.resources, cache_beside(job.options.resources.memory))?;
    let grid = raster::open_all(job.written.original.names(), &options)?;
    let crs = grid.info().crs.clone();
    let bands = stated.bands.as_deref().map(label);
    // The tolerance that a mesh with bands states is that of the bands, not of the heights.
    let stated_tolerance = tolerance(stated).filter(|_| bands.is_none());
    let tolerance = job.options.tolerance().or(stated_tolerance);
    let grid = match bands.filter(|_| stated.heights == Some(HeightBand::None)) {
        None => grid,
        Some(label) if tolerance.is_some() => {
            return Err(Error::usage("the mesh has no heights to verify")
                .in_file(&job.written.file)
                .remedy(format!("pass ‹bands› {label}")));
        }
        // Without heights all vertices are at 0. Against a flat grid, coverage and edges can still be proved.
        Some(_) => JoinedBands::of(grid).flat(),
    };
    let bound = job.options.bound.or(stated.bound).unwrap_or_default();
    let min_angle = job.options.min_angle.or(stated.min_angle);
    check_grid(&*grid).map_err(|e| e.in_file(Path::new(&job.written.original.to_string())))?;
    let [points, lines] =
        [&job.options.constraints.keep_points, &job.options.constraints.breaklines]
            .map(Option::as_deref);
    let water = options.water.as_ref();
    let kept =
        ConstraintFeatures::read(points, lines, water, &job.options.resources)?.on(grid.info())?;
    let requirements = MeshRequirements { tolerance, bound, min_angle, kept: &kept };
    let report = name_mesh(
        verify(mesh, &*grid, requirements, &job.options.resources, progress, cancel),
        job,
    )?;
    Ok((report, crs))
}

/// Reports a statement as not judged (`note`). If the proof has failed, adds `explanation`: the missing option may be
/// the cause.
fn leave_unjudged(verdict: &mut ProofVerdict, explanation: String, note: String) {
    verdict.failures.extend((!verdict.passed).then_some(explanation));
    verdict.leave(note);
}

/// Reports as not judged what the mesh states about bands and files whose option is not given.
fn leave_unrequested(
    stated: &Promises,
    job: &ProofQuestion<'_, MeshProof>,
    verdict: &mut ProofVerdict,
) {
    if let Some(bands) = stated.bands.as_deref().filter(|_| job.options.bands.is_empty()) {
        let label = label(bands);
        leave_unjudged(
            verdict,
            format!(
                "the mesh states that it was made of bands {label}, and voids of all: pass ‹bands› {label}"
            ),
            not_judged(&label),
        );
    }
    if let Some(clip) = stated.clip.as_deref().filter(|_| job.options.grid.clip.is_none()) {
        leave_unjudged(
            verdict,
            format!("the mesh states that its grid was clipped to {clip}: pass it with ‹clip›"),
            format!("whether its outline follows the polygons of {clip} (‹clip›)"),
        );
    }
    if let Some(file) = stated.water.as_deref().filter(|_| job.options.grid.water.is_none()) {
        leave_unjudged(
            verdict,
            format!("the mesh states that the water of {file} is level: pass ‹water›"),
            format!("whether the water of {file} is level (‹water›)"),
        );
    }
    // Weights and heights without bands are contradictory; nothing can be checked against them.
    if job.options.bands.is_empty() && stated.bands.is_none() {
        let known = Promises { unknown: Vec::new(), ..stated.clone() }.to_lines();
        let keys = ["bands", "weights", "heights"];
        for line in known.iter().filter(|line| keys.iter().any(|key| line.starts_with(key))) {
            verdict.leave(format!("the statement \"{line}\", without bands"));
        }
    }
    leave_files(
        stated,
        [
            job.options.constraints.keep_points.is_some(),
            job.options.constraints.breaklines.is_some(),
        ],
        verdict,
    );
}
