//! The smallest angle that triangles of a grid may have.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_tin::{AngleBound, Local};

/// What the triangles of a grid with this map are held to.
///
/// # Errors
/// An angle that is not above 0, or above the smallest one of a mesh that keeps all samples: nothing is left to
/// insert there.
pub(super) fn angle_bound(degrees: Option<f64>, map: &Affine) -> Result<Option<AngleBound>> {
    let Some(degrees) = degrees else { return Ok(None) };
    let bound = |degrees| AngleBound::new(degrees, [map.a, map.d], [map.b, map.e]);
    let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(col, row)| Local::new(col, row));
    let most = [[a, b, c], [a, b, d]].map(|half| bound(0.0).smallest(half));
    let most = most[0].min(most[1]);
    if !(degrees > 0.0 && degrees <= most + 1e-9) {
        let cells = "triangles of half a cell of this grid have one of";
        return Err(Error::usage(format!(
            "{degrees} degrees is no smallest angle: {cells} {most:.4}"
        ))
        .remedy("ask for less; up to some 25 degrees take few more vertices"));
    }
    Ok(Some(bound(degrees)))
}
