//! What a result must not depend on: the order of what is handed in, what a worker did before, and the
//! processor.

use super::*;
use fit::mend_fitted;
use terrane_tin::MinimumAngle;

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

/// The bytes of meshes on all processors; a new `REVISION` of the engine may change them.
#[test]
fn meshes_are_those_of_other_processors() {
    const SIDE: u32 = 150;
    let noise = |i: u32| (i.wrapping_mul(0x9e37_79b9) ^ i >> 7).wrapping_mul(0x85eb_ca6b) >> 16;
    let z = (0..SIDE * SIDE).map(|i| {
        let (col, row) = (i % SIDE, i / SIDE);
        let hill = (col * row / 9 + (col / 11) * (row / 13) * 5) % 400;
        (noise(i) % 150 > 0).then_some((hill.min(400 - hill) + noise(i + 7) % 9) as i16)
    });
    let grid = Grid { width: SIDE, height: SIDE, z: z.collect(), ..Grid::default() };
    let plain = spec(4.0);
    let specs = [
        plain,
        TinSpec { fit_heights: true, tolerance: 7.0, ..plain },
        TinSpec { bound: ErrorBound::Surface, fit_heights: true, ..plain },
        TinSpec { strict: true, ..plain },
        TinSpec { min_angle: Some(MinimumAngle::new(20.0, [1.0, 0.0], [0.0, 1.0])), ..plain },
    ];
    let digest = |spec: &TinSpec| {
        let text = format!("{:?} {:?}", whole(&grid, spec), mend_fitted(&grid, SIDE / 2 - 1, spec));
        let fnv = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, fnv))
    };
    let expected = [
        "791949ef397f9d6b",
        "2576f0e9961490f0",
        "c912d83d5820c9f4",
        "2029853b1cd5cf3e",
        "e4227339abc082cc",
    ];
    assert_eq!(specs.each_ref().map(digest), expected);
}
