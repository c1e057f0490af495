//! What a result must not depend on: the order of what is handed in, and what a worker did before.

use super::*;

/// The same items in an order that the seed tells.
fn shuffled<T: Clone>(items: &[T], seed: u32) -> Vec<T> {
    let key = |i: u32| (i ^ seed).wrapping_mul(0x9e37_79b9).rotate_left(15).wrapping_mul(seed | 1);
    let mut order: Vec<u32> = (0..items.len() as u32).collect();
    order.sort_unstable_by_key(|&i| key(i));
    order.iter().map(|&i| items[i as usize].clone()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// All of it: triangles and their order, figures, heights, and what is told of the border.
    #[test]
    fn a_patch_is_that_of_its_triangles_in_any_order(
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50,
        tolerance in 0_i32..20, of_surface: bool, fit: bool, reach in 4_u32..40
    ) {
        let grid = Grid::hills(2 * half + 1, height, seed, holes);
        let spec = TinSpec { bound: ErrorBound::ALL[usize::from(of_surface)], fit_heights: fit, ..spec(tolerance.into()) };
        let tiles = [tile(&grid, 0, half, &spec), tile(&grid, half, 2 * half, &spec)];
        let heights: BTreeMap<TilePosition, f64> = tiles.iter().zip([0, half]).flat_map(|(mesh, from)| {
            let shifted = mesh.vertices.iter().map(move |p| TilePosition::new(p.col() + from, p.row()));
            shifted.zip(mesh.heights.iter().copied())
        }).collect();
        let mut triangles =
            [moved(&tiles[0].triangles, [0, 0]), moved(&tiles[1].triangles, [half, 0])].concat();
        triangles.retain(|t| t.corners.iter().any(|p| p.col().abs_diff(half) <= reach));
        let vertices: Vec<_> = heights.into_iter().collect();
        let mended = |vertices: &[(TilePosition, f64)], triangles: &[TileTriangle]| {
            let input = PatchInput {
                heights: HeightWindow { width: grid.width, height, f32: &grid.f32(), f64: None },
                vertices,
                triangles,
                seam_col: Some(half),
                seam_row: None,
                grid_ends: [true; 4],
                spacing: u32::MAX,
                kept: &[],
                lines: &[],
            };
            format!("{:?}", mend_patch(&input, &spec, &mut TileScratch::default()))
        };
        let other = mended(&shuffled(&vertices, seed + 1), &shuffled(&triangles, seed));
        prop_assert!(mended(&vertices, &triangles) == other);
    }

    #[test]
    fn a_tile_is_the_same_whatever_the_worker_did_before(
        width in 2_u32..40, height in 2_u32..40, seed in 0_u32..1000, holes in 0_u32..4,
        tolerance in 0_i32..20, before in 0_i32..20, of_surface: bool, fit: bool, was_fit: bool
    ) {
        let input = |grid: &Grid, z| {
            let (width, height) = (grid.width, grid.height);
            TileInput::alone(HeightWindow { width, height, f32: z, f64: None })
        };
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let (first, second) = (
            TinSpec { bound, fit_heights: was_fit, ..spec(before.into()) },
            TinSpec { bound, fit_heights: fit, ..spec(tolerance.into()) },
        );
        let (other, grid) = (Grid::hills(47, 31, seed + 1, 1), Grid::hills(width, height, seed, holes));
        let (others, z) = (other.f32(), grid.f32());
        let mut worker = TileScratch::default();
        triangulate_tile(&input(&other, &others), &first, &mut worker);
        let again = triangulate_tile(&input(&grid, &z), &second, &mut worker);
        let fresh = triangulate_tile(&input(&grid, &z), &second, &mut TileScratch::default());
        let [again, fresh] = [again, fresh].map(|mesh| format!("{mesh:?}"));
        prop_assert!(again == fresh);
    }
}
