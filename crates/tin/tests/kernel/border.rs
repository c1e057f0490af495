//! The border of a patch: where the grid ends it is divided like all else, and elsewhere it stays as it is.

use super::*;

/// A patch of triangles around column `half` of a grid, whose heights are `z`.
pub(super) fn seam<'a>(
    grid: &'a Grid,
    z: &'a [f32],
    half: u32,
    triangles: &'a [TileTriangle],
) -> PatchInput<'a> {
    PatchInput {
        heights: HeightWindow { width: grid.width, height: grid.height, f32: z, f64: None },
        vertices: &[],
        triangles,
        seam_col: Some(half),
        seam_row: None,
        grid_ends: [true; 4],
        spacing: u32::MAX,
        kept: &grid.kept,
        lines: &grid.stretches,
    }
}

/// The samples beside the places where an edge is further than `tolerance` from the line between two
/// neighbouring samples.
fn beyond(grid: &Grid, triangles: &[TileTriangle], tolerance: i64) -> BTreeSet<TilePosition> {
    let mut found = BTreeSet::new();
    each_crossing(grid, triangles, |sides, off, n| {
        if sides[0] != sides[1] && off.abs() > tolerance * n {
            found.extend(sides.map(|[col, row]| TilePosition::new(col as u32, row as u32)));
        }
    });
    found
}

fn patch(
    grid: &Grid,
    triangles: &[TileTriangle],
    col: u32,
    ends: [bool; 4],
    spec: &TinSpec,
) -> PatchMesh {
    let input = PatchInput {
        heights: HeightWindow {
            width: grid.width,
            height: grid.height,
            f32: &grid.f32(),
            f64: None,
        },
        vertices: &[],
        triangles,
        seam_col: Some(col),
        seam_row: None,
        grid_ends: ends,
        spacing: u32::MAX,
        kept: &[],
        lines: &[],
    };
    mend_patch(&input, spec, &mut TileScratch::default())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    /// Two quadrangles side by side, each divided by the diagonal that is not Delaunay: all is done anew.
    #[test]
    fn a_patch_divides_its_border_where_the_grid_ends_alone(
        width in 4_u32..30, height in 3_u32..30, seed in 0_u32..1000, tolerance in 0_i32..20,
        ends: [bool; 4], is_all: bool, of_surface: bool, middle in (0_u32..30, 0_u32..30)
    ) {
        let grid = Grid::hills(width, height, seed, 0);
        let ends = if is_all { [true; 4] } else { ends };
        let (last_col, last_row) = (width - 1, height - 1);
        let [top, bottom] = [middle.0, middle.1].map(|col| 1 + col % (width - 2));
        let corners = [(0, 0), (top, 0), (last_col, 0), (last_col, last_row), (bottom, last_row), (0, last_row)];
        let [a, b, c, d, e, f] = corners.map(|(col, row)| TilePosition::new(col, row));
        let turn = |p: [TilePosition; 4]| {
            let [p, q, r, s] = p.map(lattice);
            in_circle(p, q, r, s)
        };
        let (left, right) = (turn([a, b, e, f]), turn([b, c, d, e]));
        prop_assume!(left != 0 && right != 0);
        let left = if left > 0 { [[a, b, e], [a, e, f]] } else { [[a, b, f], [b, e, f]] };
        let right = if right > 0 { [[b, c, d], [b, d, e]] } else { [[b, c, e], [c, d, e]] };
        let triangles = [left, right].concat()
            .into_iter().map(|corners| TileTriangle { corners, max_error: 0.0, square_sum: 0.0 });
        let spec = TinSpec { bound: ErrorBound::ALL[usize::from(of_surface)], ..spec(tolerance.into()) };
        let mended = patch(&grid, &triangles.collect::<Vec<_>>(), top, ends, &spec);
        check_delaunay(&mended.triangles);
        if ends == [true; 4] {
            check_all(&grid, &mended.triangles, tolerance.into(), 1);
            prop_assert!(mended.left.is_empty());
            prop_assert!(!of_surface || beyond(&grid, &mended.triangles, tolerance.into()).is_empty());
        }
        for p in mended.vertices.iter().filter(|p| ![a, b, c, d, e, f].contains(p)) {
            let sides = [p.col() == 0, p.col() == last_col, p.row() == 0, p.row() == last_row];
            let is_divided = sides.iter().zip(ends).all(|(is_on, is_end)| !is_on || is_end);
            prop_assert!(is_divided, "{:?} {:?}", lattice(*p), ends);
        }
    }

    /// Edges that end on the frozen border may be too far off between samples, and nothing else may.
    #[test]
    fn what_a_patch_cannot_mend_between_samples_is_told(
        half in 8_u32..30, height in 4_u32..40, seed in 0_u32..1000, tolerance in 1_i32..8,
        reach in 0_u32..8
    ) {
        let grid = Grid::hills(2 * half + 1, height, seed, 0);
        let mut triangles = whole(&grid, &spec(tolerance.into())).triangles;
        triangles.retain(|t| t.corners.iter().any(|p| p.col().abs_diff(half) <= reach));
        let spec = TinSpec { bound: ErrorBound::Surface, ..spec(tolerance.into()) };
        let mended = patch(&grid, &triangles, half, [true; 4], &spec);
        let expected = beyond(&grid, &mended.triangles, tolerance.into());
        prop_assert_eq!(mended.left.is_empty(), expected.is_empty());
        prop_assert!(mended.left.iter().all(|p| expected.contains(p)));
    }
}
