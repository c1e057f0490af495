//! Georeference: tiepoint and scale, or a matrix, with GDAL's half-pixel rule. GeoTIFF 1.1 (OGC 19-008r4)
//! section 7.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;

use super::ifd::GeoTiffDirectory;
use super::tags;

/// Georeference of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Georeference {
    /// Affine transform.
    Affine(Affine),
    /// Ground control points, which no affine transform represents.
    ControlPoints,
    /// None.
    None,
}

/// Reads the georeference; `is_point` for PixelIsPoint.
pub(super) fn read(directory: &GeoTiffDirectory<'_>, is_point: bool) -> Result<Georeference> {
    let scale = directory.doubles(tags::MODEL_PIXEL_SCALE)?.unwrap_or_default();
    let tiepoints = directory.doubles(tags::MODEL_TIEPOINT)?.unwrap_or_default();
    let matrix = directory.doubles(tags::MODEL_TRANSFORMATION)?.unwrap_or_default();
    let half = if is_point { 0.0 } else { 0.5 };
    let map = match (scale.as_slice(), tiepoints.as_slice(), matrix.as_slice()) {
        ([sx, sy, ..], [i, j, _, x, y, _, ..], _) if *sx != 0.0 && *sy != 0.0 => {
            from_tiepoint([*i, *j, *x, *y], *sx, *sy, half)
        }
        (_, _, [a, b, _, x, d, e, _, y, ..]) if matrix.len() == 16 => {
            from_matrix([*x, *a, *b, *y, *d, *e], half)
        }
        (_, [_, ..], _) => return Ok(Georeference::ControlPoints),
        _ => return Ok(Georeference::None),
    };
    if !map.is_valid() {
        return Err(Error::bad_input("georeference is not finite or singular"));
    }
    Ok(Georeference::Affine(map))
}

/// The sign of the scale's y is ignored, as GDAL does: such files are north-up.
fn from_tiepoint([i, j, x, y]: [f64; 4], sx: f64, sy: f64, half: f64) -> Affine {
    let (a, e) = (sx, -sy.abs());
    Affine { x0: x + (half - i) * a, a, b: 0.0, y0: y + (half - j) * e, d: 0.0, e }
}

fn from_matrix([x, a, b, y, d, e]: [f64; 6], half: f64) -> Affine {
    Affine { x0: x + half * (a + b), a, b, y0: y + half * (d + e), d, e }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_and_point_differ_by_half_a_cell() {
        let area = from_tiepoint([0.0, 0.0, 100.0, 200.0], 10.0, 10.0, 0.5);
        assert_eq!(area.apply(0.0, 0.0), [105.0, 195.0]);
        assert_eq!(area.to_gdal(), [100.0, 10.0, 0.0, 200.0, 0.0, -10.0]);
        let point = from_tiepoint([0.0, 0.0, 100.0, 200.0], 10.0, 10.0, 0.0);
        assert_eq!(point.apply(0.0, 0.0), [100.0, 200.0]);
        let tied_elsewhere = from_tiepoint([2.0, 3.0, 100.0, 200.0], 10.0, -10.0, 0.0);
        assert_eq!(tied_elsewhere.apply(2.0, 3.0), [100.0, 200.0]);
    }

    #[test]
    fn a_matrix_may_rotate_and_point_south() {
        let map = from_matrix([100.0, 3.0, 1.0, 200.0, -1.0, 3.0], 0.5);
        assert_eq!(map.to_gdal(), [100.0, 3.0, 1.0, 200.0, -1.0, 3.0]);
        assert_eq!(map.apply(-0.5, -0.5), [100.0, 200.0]);
    }
}
