//! Heights that are free: the bound they keep, what they spare, and which stay as they are.

use super::*;

/// Vertices by position, and their heights.
type Placed = BTreeMap<TilePosition, f64>;

fn placed(mesh: &TileMesh, [col, row]: [u32; 2]) -> Placed {
    let shift = |p: &TilePosition| TilePosition::new(p.col() + col, p.row() + row);
    mesh.vertices.iter().map(shift).zip(mesh.heights.iter().copied()).collect()
}

/// Two tiles that meet at column `half`, their vertices, and the patch of all their triangles.
pub(super) fn mend_fitted(grid: &Grid, half: u32, spec: &TinSpec) -> (Placed, PatchMesh) {
    let tiles = [tile(grid, 0, half, spec), tile(grid, half, 2 * half, spec)];
    let mut heights = placed(&tiles[0], [0, 0]);
    heights.extend(placed(&tiles[1], [half, 0]));
    let triangles =
        [moved(&tiles[0].triangles, [0, 0]), moved(&tiles[1].triangles, [half, 0])].concat();
    let vertices: Vec<_> = heights.iter().map(|(&at, &z)| (at, z)).collect();
    let z = grid.f32();
    let input = PatchInput { vertices: &vertices, ..seam(grid, &z, half, &triangles) };
    let patch = mend_patch(&input, spec, &mut TileScratch::default());
    (heights, patch)
}

/// As [`check_all`], of triangles whose corners have their own heights; all but a rounding of `f64`.
fn check_fitted(grid: &Grid, triangles: &[TileTriangle], heights: &Placed, tolerance: f64) {
    let most = tolerance * (1.0 + 1e-12) + 1e-9;
    let sample = |q: Lattice| grid.at(q[0] as u32, q[1] as u32).expect("a valid sample") as f64;
    let mut area = 0;
    for triangle in triangles {
        let p = triangle.corners.map(lattice);
        let z = triangle.corners.map(|at| heights[&at]);
        let double_area = orient(p[0], p[1], p[2]);
        area += double_area;
        let range = |axis: usize| {
            let along = p.map(|q| q[axis]);
            along.into_iter().min().unwrap()..=along.into_iter().max().unwrap()
        };
        let mut largest = 0.0_f64;
        for q in range(1).flat_map(|row| range(0).map(move |col| [col, row])) {
            let w = [orient(p[1], p[2], q), orient(p[2], p[0], q), orient(p[0], p[1], q)];
            if w.iter().all(|&w| w >= 0) {
                let plane: f64 = (0..3).map(|i| w[i] as f64 * z[i]).sum();
                largest = largest.max((plane / double_area as f64 - sample(q)).abs());
            }
        }
        assert!(largest <= most, "{largest} in {p:?}");
        assert!(largest <= f64::from(triangle.max_error) + 1e-9, "{largest} is not told of {p:?}");
    }
    assert_eq!(area, 2 * grid.cells(), "the mesh does not cover the surface");
    check_delaunay(triangles);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    #[test]
    fn fitted_heights_keep_the_tolerance(
        width in 2_u32..50, height in 2_u32..50, seed in 0_u32..1000, holes in 0_u32..4,
        quarters in 0_i32..60, of_surface: bool, single: bool
    ) {
        let grid = Grid::hills(width, height, seed, holes);
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let single_precision = single.then_some(HeightQuantization::about(0.0));
        let spec =
            TinSpec { fit_heights: true, bound, single_precision, ..spec(f64::from(quarters) / 4.0) };
        let mesh = whole(&grid, &spec);
        let placed = placed(&mesh, [0, 0]);
        check_fitted(&grid, &mesh.triangles, &placed, spec.tolerance);
        if single {
            prop_assert!(mesh.heights.iter().all(|&z| f64::from(z as f32) == z));
        }
        if of_surface {
            check_fitted_between(&grid, &mesh.triangles, &placed, spec.tolerance);
        }
        for (at, z) in placed {
            let sample = grid.at(at.col(), at.row()).unwrap() as f64;
            let cells = [at.col().wrapping_sub(1), at.col()].map(|col| {
                [at.row().wrapping_sub(1), at.row()].map(|row| {
                    col < width - 1 && row < height - 1 && grid.is_cell(col, row)
                })
            });
            if cells.as_flattened().contains(&false) {
                prop_assert_eq!(z, sample, "on the outline");
            }
            prop_assert!((z - sample).abs() <= spec.tolerance, "a vertex is {} off", z - sample);
        }
    }

    /// The patch is told the heights that the tiles have given their vertices, and changes none that a
    /// triangle beyond it has.
    #[test]
    fn two_fitted_tiles_mend_into_one_mesh(
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50,
        tolerance in 0_i32..20, of_surface: bool
    ) {
        let grid = Grid::hills(2 * half + 1, height, seed, holes);
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { fit_heights: true, bound, ..spec(tolerance.into()) };
        let (_, patch) = mend_fitted(&grid, half, &spec);
        let mended: Placed =
            patch.vertices.iter().copied().zip(patch.heights.iter().copied()).collect();
        check_fitted(&grid, &patch.triangles, &mended, spec.tolerance);
        if of_surface {
            prop_assert!(patch.left.is_empty());
            check_fitted_between(&grid, &patch.triangles, &mended, spec.tolerance);
        }
    }
}

/// As [`check_between`], of corners with their own heights.
fn check_fitted_between(grid: &Grid, triangles: &[TileTriangle], heights: &Placed, tolerance: f64) {
    let height = |[col, row]: [f64; 2]| grid.at(col as u32, row as u32).unwrap() as f64;
    for (from, to) in edges(triangles).into_keys() {
        let [a, b] = [from, to].map(|end| lattice(end).map(f64::from));
        for axis in [0, 1] {
            let n = (b[axis] - a[axis]).abs();
            for k in 1..n as u32 {
                let part = f64::from(k) / n;
                let across = a[axis] + (b[axis] - a[axis]).signum() * f64::from(k);
                let along = a[1 - axis] + (b[1 - axis] - a[1 - axis]) * part;
                let sample =
                    |along: f64| height(if axis == 0 { [across, along] } else { [along, across] });
                let (first, rest) = ((along + 1e-9).floor(), along - (along + 1e-9).floor());
                let far = if rest.abs() < 1e-6 { 0.0 } else { rest * sample(first + 1.0) };
                let mesh = heights[&from] * (1.0 - part) + heights[&to] * part;
                let off = mesh - sample(first) * (1.0 - rest) - far;
                assert!(off.abs() <= tolerance + 1e-5, "{off} from {a:?} to {b:?} at {across}");
            }
        }
    }
}

#[test]
fn fitted_heights_take_fewer_vertices() {
    let grid = Grid::hills(257, 257, 11, 0);
    for (tolerance, share) in [(4.0, 0.9), (8.0, 0.85), (20.0, 0.9)] {
        let count = |fit| {
            whole(&grid, &TinSpec { fit_heights: fit, ..spec(tolerance) }).vertices.len() as f64
        };
        let (fitted, samples) = (count(true), count(false));
        assert!(fitted <= share * samples, "{fitted} of {samples} at {tolerance}");
    }
}

/// Tiles leave the vertices of a rim at their samples, and the patch moves those it can.
#[test]
fn vertices_of_a_seam_are_fitted_too() {
    let (half, height) = (60, 90);
    let grid = Grid::hills(2 * half + 1, height, 11, 0);
    let spec = TinSpec { fit_heights: true, ..spec(6.0) };
    let (before, patch) = mend_fitted(&grid, half, &spec);
    let all = patch.vertices.iter().zip(&patch.heights);
    let seam = all.filter(|(p, _)| p.col() == half && before.contains_key(p));
    let is_moved =
        |(p, z): &(&TilePosition, &f64)| **z != grid.at(p.col(), p.row()).unwrap() as f64;
    let (moved, stay): (Vec<_>, Vec<_>) = seam.partition(is_moved);
    assert!(!moved.is_empty(), "{} vertices stay", stay.len());
}
