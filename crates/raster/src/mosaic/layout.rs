//! Alignment of grids on one lattice: arithmetic on transforms and sizes.

use crate::grid::GridInfo;
use terrane_base::error::Result;
use terrane_base::geom::Affine;
use terrane_base::limits;

/// Alignment tolerance in cells. Headers give origins and cell sizes with nine to twelve digits, and the
/// error accumulates over a wide mosaic.
pub(super) const SLACK: f64 = 1e-3;
/// Maximum distance from the first grid in columns and rows.
const FAR: f64 = (1_u64 << 40) as f64;

/// Transform and size of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GridShape {
    pub(super) transform: Affine,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl GridShape {
    pub(super) fn of(info: &GridInfo) -> Self {
        let GridInfo { transform, width, height, .. } = *info;
        Self { transform, width, height }
    }
}

/// All grids on one lattice.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MosaicLayout {
    pub(super) transform: Affine,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Column and row of sample (0, 0) of each grid.
    pub(super) places: Vec<[u32; 2]>,
}

/// Reason why a grid does not fit the lattice of the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LatticeMisfit {
    /// Different cell size: this grid's and the first grid's, x and y.
    Cell([f64; 2], [f64; 2]),
    /// Different rotation or shear: change of x by row and of y by column, of this grid and of the first.
    Rotation([f64; 2], [f64; 2]),
    /// Offset in fractions of a cell.
    Offset([f64; 2]),
    /// Too far away for a mosaic.
    Far,
}

/// Aligns `shapes`. The inner error is the first grid that does not fit, and the reason.
///
/// # Errors
/// More columns or rows than [`limits::MAX_SIDE`].
pub(super) fn lay_out(
    shapes: &[GridShape],
) -> Result<std::result::Result<MosaicLayout, (usize, LatticeMisfit)>> {
    let Some(first) = shapes.first() else { return Ok(Err((0, LatticeMisfit::Far))) };
    let mut places = Vec::with_capacity(shapes.len());
    for (i, shape) in shapes.iter().enumerate() {
        match place(&first.transform, shape) {
            Ok(place) => places.push(place),
            Err(misfit) => return Ok(Err((i, misfit))),
        }
    }
    let low = [0, 1].map(|axis| places.iter().map(|p| p[axis]).min().unwrap_or(0));
    let ends = places.iter().zip(shapes);
    let ends = ends.map(|(p, s)| [p[0] + i64::from(s.width), p[1] + i64::from(s.height)]);
    let [width, height] = ends
        .reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
        .map_or([0; 2], |high| [0, 1].map(|axis| (high[axis] - low[axis]) as u64));
    limits::check("number of columns of the mosaic", width, limits::MAX_SIDE)?;
    limits::check("number of rows of the mosaic", height, limits::MAX_SIDE)?;
    Ok(Ok(MosaicLayout {
        transform: origin(shapes, &places, low),
        width: width as u32,
        height: height as u32,
        // Below the limits just checked.
        places: places.iter().map(|p| [0, 1].map(|axis| (p[axis] - low[axis]) as u32)).collect(),
    }))
}

/// True if a grid is on the lattice of `first`.
pub(super) fn fits(first: &Affine, shape: &GridShape) -> bool {
    place(first, shape).is_ok()
}

/// Column and row of the first sample of the grid on the lattice of `first`.
fn place(first: &Affine, shape: &GridShape) -> std::result::Result<[i64; 2], LatticeMisfit> {
    let map = &shape.transform;
    check_steps(first, shape)?;
    let at = first.invert(map.x0, map.y0);
    let nearest = at.map(f64::round);
    // Adding 0 turns -0 into 0.
    let off = [0, 1].map(|axis| at[axis] - nearest[axis] + 0.0);
    if !nearest.iter().all(|n| n.abs() < FAR) {
        return Err(LatticeMisfit::Far);
    }
    if off.iter().any(|o| o.abs() > SLACK) {
        return Err(LatticeMisfit::Offset(off));
    }
    Ok(nearest.map(|n| n as i64))
}

/// Fails if the far corners of the grid drift off the lattice of `first`.
fn check_steps(first: &Affine, shape: &GridShape) -> std::result::Result<(), LatticeMisfit> {
    let map = &shape.transform;
    let (right, down) = (step_of(first, map.a, map.d), step_of(first, map.b, map.e));
    let (cols, rows) = (f64::from(shape.width), f64::from(shape.height));
    // Negated, so that NaN is a misfit.
    if !(right[1].abs() * cols <= SLACK && down[0].abs() * rows <= SLACK) {
        return Err(LatticeMisfit::Rotation([map.b, map.d], [first.b, first.d]));
    }
    if !((right[0] - 1.0).abs() * cols <= SLACK && (down[1] - 1.0).abs() * rows <= SLACK) {
        return Err(LatticeMisfit::Cell([map.a, map.e], [first.a, first.e]));
    }
    Ok(())
}

/// The step (`dx`, `dy`) in columns and rows of `map`.
fn step_of(map: &Affine, dx: f64, dy: f64) -> [f64; 2] {
    let det = map.determinant();
    [(map.e * dx - map.b * dy) / det, (map.a * dy - map.d * dx) / det]
}

/// Transform of the mosaic: on a north-up lattice, the origin is that of the grids in its first column and
/// row, whose headers are exact.
fn origin(shapes: &[GridShape], places: &[[i64; 2]], low: [i64; 2]) -> Affine {
    let first = shapes[0].transform;
    let shifted = first.shifted(low[0] as f64, low[1] as f64);
    if first.b != 0.0 || first.d != 0.0 {
        return shifted;
    }
    // An origin computed from the first grid is off by the rounding of its header, times the distance.
    let [west, north] = [0, 1].map(|axis| places.iter().position(|p| p[axis] == low[axis]));
    let x0 = west.map_or(shifted.x0, |i| shapes[i].transform.x0);
    let y0 = north.map_or(shifted.y0, |i| shapes[i].transform.y0);
    Affine { x0, y0, ..shifted }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shape(x0: f64, y0: f64, cell: f64, width: u32, height: u32) -> GridShape {
        let transform = Affine { x0, a: cell, b: 0.0, y0, d: 0.0, e: -cell };
        GridShape { transform, width, height }
    }

    fn laid(shapes: &[GridShape]) -> MosaicLayout {
        lay_out(shapes).unwrap().unwrap()
    }

    fn misfit(shapes: &[GridShape]) -> (usize, LatticeMisfit) {
        lay_out(shapes).unwrap().unwrap_err()
    }

    #[test]
    fn tiles_that_share_an_edge_overlap_by_one_and_others_butt() {
        let third = 1.0 / 1200.0;
        let srtm = [shape(1.0, 42.0, third, 1201, 1201), shape(1.0, 43.0, third, 1201, 1201)];
        let layout = laid(&srtm);
        assert_eq!((layout.width, layout.height), (1201, 2401));
        assert_eq!(layout.places, [[0, 1200], [0, 0]]);
        assert_eq!((layout.transform.x0, layout.transform.y0), (1.0, 43.0));
        let area = [shape(5.0, 95.0, 10.0, 4, 3), shape(45.0, 95.0, 10.0, 4, 3)];
        let layout = laid(&area);
        assert_eq!((layout.width, layout.places[1]), (8, [4, 0]));
    }

    #[test]
    fn what_does_not_fit_is_told_by_kind() {
        let base = shape(0.0, 0.0, 10.0, 100, 100);
        let with = |change: fn(&mut Affine)| {
            let mut other = base;
            change(&mut other.transform);
            [base, other]
        };
        assert!(matches!(
            misfit(&with(|t| t.a = 30.0)),
            (1, LatticeMisfit::Cell([30.0, _], [10.0, _]))
        ));
        assert!(matches!(misfit(&with(|t| t.e = 10.0)), (1, LatticeMisfit::Cell(..))));
        assert!(matches!(misfit(&with(|t| t.b = 1.0)), (1, LatticeMisfit::Rotation([1.0, _], _))));
        assert!(matches!(misfit(&with(|t| t.x0 = 4.0)), (1, LatticeMisfit::Offset([0.4, 0.0]))));
        assert!(matches!(misfit(&with(|t| t.x0 = 1e18)), (1, LatticeMisfit::Far)));
        // A cell size with fewer digits is accepted while the far edge is on the lattice.
        assert!(lay_out(&with(|t| t.a += 0.9e-4)).unwrap().is_ok());
        assert!(matches!(misfit(&with(|t| t.a += 1.1e-4)), (1, LatticeMisfit::Cell(..))));
        assert!(lay_out(&with(|t| t.x0 = 0.009)).unwrap().is_ok());
        assert!(lay_out(&[]).unwrap().is_err());
    }

    #[test]
    fn a_mosaic_beyond_the_limit_is_refused() {
        let far = f64::from(u32::MAX);
        let error = lay_out(&[shape(0.0, 0.0, 1.0, 2, 2), shape(far, 0.0, 1.0, 2, 2)]);
        assert!(error.unwrap_err().to_string().contains("number of columns of the mosaic"));
    }

    proptest! {
        #[test]
        fn grids_cut_from_one_lattice_are_put_back(
            at in prop::collection::vec((-500_i32..500, -500_i32..500, 1_u32..90, 1_u32..90), 1..20),
            cell in 1e-4_f64..50.0, turn in -0.6_f64..0.6, x0 in -1e6_f64..1e6, y0 in -1e6_f64..1e6,
        ) {
            let whole = Affine {
                x0, a: cell, b: cell * turn, y0, d: cell * turn * 0.5, e: -cell * 0.7,
            };
            let cut = |&(col, row, width, height): &(i32, i32, u32, u32)| GridShape {
                transform: whole.shifted(col.into(), row.into()), width, height,
            };
            let shapes: Vec<GridShape> = at.iter().map(cut).collect();
            let layout = laid(&shapes);
            let low = |axis: fn(&(i32, i32, u32, u32)) -> i32| at.iter().map(axis).min().unwrap();
            let (left, top) = (low(|a| a.0), low(|a| a.1));
            for (place, &(col, row, width, height)) in layout.places.iter().zip(&at) {
                prop_assert_eq!(place.map(i64::from), [col - left, row - top].map(i64::from));
                prop_assert!(place[0] + width <= layout.width && place[1] + height <= layout.height);
            }
            let [x, y] = whole.apply(left.into(), top.into());
            prop_assert!((layout.transform.x0 - x).abs() <= cell * SLACK);
            prop_assert!((layout.transform.y0 - y).abs() <= cell * SLACK);
        }
    }
}
