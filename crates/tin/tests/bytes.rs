//! What a mesh and a worker say of their memory.

use terrane_base::bound::ErrorBound;
use terrane_tin::{
    HeightWindow, TileInput, TileMesh, TilePosition, TileScratch, TileTriangle, TinSpec,
    triangulate_tile,
};

#[test]
fn a_mesh_holds_its_triangles_vertices_and_heights() {
    let triangle =
        TileTriangle { corners: [TilePosition::new(0, 0); 3], max_error: 0.0, square_sum: 0.0 };
    let mesh = TileMesh {
        triangles: vec![triangle; 7],
        vertices: vec![TilePosition::new(1, 2); 5],
        heights: vec![0.5; 3],
        ..TileMesh::default()
    };
    // Five numbers of four bytes, one of them, and one of eight.
    assert_eq!(mesh.bytes(), 7 * 20 + 5 * 4 + 3 * 8);
    assert_eq!(TileMesh::default().bytes(), 0);
}

#[test]
fn no_mesh_holds_more_than_one_that_keeps_all_samples() {
    let side = 65_u32;
    let noise = |i: u32| f32::from((i.wrapping_mul(i).wrapping_mul(0x9e37_79b9) >> 20) as u16);
    let z: Vec<f32> = (0..side * side).map(noise).collect();
    let heights = HeightWindow { width: side, height: side, f32: &z, f64: None };
    let input = TileInput::alone(heights);
    let tolerance = 0.0;
    let spec = TinSpec {
        tolerance,
        bound: ErrorBound::Samples,
        strict: false,
        drop: true,
        fit_heights: false,
        data_dependent: false,
        min_angle: None,
        single_precision: None,
        measure: false,
    };
    let mesh = triangulate_tile(&input, &spec, &mut TileScratch::default());
    assert!(mesh.vertices.len() as u32 > side * side * 9 / 10);
    let most = TileMesh::max_bytes(u64::from(side).pow(2));
    let used = 20 * mesh.triangles.len() + 12 * mesh.vertices.len();
    assert!(mesh.bytes() >= used as u64, "room that is not used is held");
    assert!(used as u64 <= most && used as u64 > most * 9 / 10, "{used} of {most}");
    assert_eq!(TileMesh::max_bytes(0), 0);
    // Beside the result: the heights twice, a triangle of 32 bytes for each of the result, and lists.
    let worker = TileScratch::bytes(side - 1, false) as f64 / most as f64;
    assert!((3.3..3.5).contains(&worker), "{worker}");
}

/// A sample of each of the one or four that a tile of no cells and one of a single cell have.
#[test]
fn a_worker_has_room_for_every_sample() {
    let each = TileScratch::bytes(0, false);
    assert!(each > 64 + 48 + 40 + 12, "{each}");
    for cells in [1_u32, 2, 9, 256] {
        let samples = u64::from(cells + 1).pow(2);
        let all = TileScratch::bytes(cells, false);
        // A third of a byte is not lost where there are many.
        assert!((samples * each..=samples * (each + 1)).contains(&all), "{cells}: {all}");
        assert_eq!(TileScratch::bytes(cells, true) - all, 8 * samples);
    }
}
