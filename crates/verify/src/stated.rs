//! Promises stated by a mesh file, and files named by it.

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_baselines::{METHODS, TriangulationRule};
use terrane_engine::proof::ProofVerdict;
use terrane_mesh::{self as mesh, MeshInfo, MeshSource, Promises};

/// Opens a mesh to be proved; a solid is refused.
pub(super) fn open_mesh(path: &Path) -> Result<Box<dyn MeshSource>> {
    let mesh = mesh::open(path)?;
    refuse_solid(mesh.info()).map_err(|e| e.in_file(path))?;
    Ok(mesh)
}

/// Refuses a solid: its walls and bottom are not terrain, and cannot be identified reliably.
pub(super) fn refuse_solid(mesh: &MeshInfo) -> Result<()> {
    if !mesh.solid {
        return Ok(());
    }
    Err(Error::unsupported("is a solid: walls and bottom are not terrain")
        .remedy("pass a mesh made without ‹base› and ‹co› SOLID_BASE"))
}

/// Promises of a mesh. `options` are the key of a statement, the option that replaces it, and whether an invalid
/// statement is accepted because the option is given or it is not used.
///
/// # Errors
/// Contradictory statements, and invalid ones without an option that replaces them.
pub(super) fn stated(mesh: &MeshInfo, options: &[(&str, &str, bool)]) -> Result<Promises> {
    let stated = mesh.promises()?;
    for line in &stated.invalid {
        let remedy = match options.iter().find(|(key, ..)| line.starts_with(key)) {
            Some((.., true)) => continue,
            Some((_, option, _)) => format!("pass {option}"),
            None => "recreate the mesh, or remove this comment".to_owned(),
        };
        let message = format!("invalid statement \"{line}\"");
        return Err(Error::bad_input(message).remedy(remedy));
    }
    Ok(stated)
}

/// The tolerance that a mesh states.
pub(super) fn tolerance(stated: &Promises) -> Option<f64> {
    stated.max_error.as_ref().map(|error| error.value)
}

/// False where the mesh states a triangulation other than Delaunay: "triangulation data-dependent", or the name
/// of a method.
///
/// # Errors
/// An unknown name.
pub(super) fn is_delaunay(stated: &Promises) -> Result<bool> {
    let Some(name) = &stated.triangulation else { return Ok(true) };
    let mut others = METHODS.iter().filter(|method| !method.is_delaunay);
    match name.parse::<TriangulationRule>() {
        Ok(known) => Ok(known == TriangulationRule::Delaunay),
        Err(_) if others.any(|method| method.name == *name) => Ok(false),
        Err(_) => Err(Error::bad_input(format!("unknown statement \"triangulation {name}\""))
            .remedy("recreate the mesh, or remove this comment to have its edges judged")),
    }
}

/// Leaves files of points and lines unjudged that the mesh states and the job does not name.
pub(super) fn leave_files(
    stated: &Promises,
    [points, lines]: [bool; 2],
    verdict: &mut ProofVerdict,
) {
    if let Some(file) = stated.keep_points.as_deref().filter(|_| !points) {
        verdict.leave(format!("whether it keeps the points of {file} (‹keep_points›)"));
    }
    if let Some(file) = stated.breaklines.as_deref().filter(|_| !lines) {
        verdict.leave(format!("whether edges follow the lines of {file} (‹breaklines›)"));
    }
}
