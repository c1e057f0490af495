//! Angles: triangles with smaller ones than they may have are found, wherever domains meet, whatever the cells.

use crate::support::{Grid, Mesh, delaunay, noise};
use proptest::prelude::*;
use terrane_base::geom::Affine;
use terrane_engine::constraints::GridConstraints;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_verify::{MeshRequirements, VerifyReport, verify};

fn prove(mesh: &Mesh, grid: &Grid, degrees: Option<f64>, memory: u64) -> VerifyReport {
    let asked = MeshRequirements {
        min_angle: degrees,
        kept: GridConstraints::NONE,
        ..MeshRequirements::of_samples(Some(1e9))
    };
    let resources = Resources { threads: 2, memory, temp_dir: None };
    verify(mesh, grid, asked, &resources, &Silent, &Cancel::default()).unwrap()
}

/// The smallest angle of a triangle, by the law of cosines at each corner.
fn smallest(corners: [[f64; 2]; 3]) -> f64 {
    let side = |i: usize| {
        let [a, b] = [corners[(i + 1) % 3], corners[(i + 2) % 3]];
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    let angle = |i: usize| {
        let [a, b, c] = [side(i), side((i + 1) % 3), side((i + 2) % 3)];
        ((b * b + c * c - a * a) / (2.0 * b * c)).clamp(-1.0, 1.0).acos().to_degrees()
    };
    (0..3).map(angle).fold(180.0, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn as_many_are_thin_as_the_twin_finds(
        width in 2_u32..300, height in 2_u32..80, seed: u32, dense in 0.0..0.3, degrees in 1.0_f64..40.0,
        (a, b, d, e) in prop_oneof![
            Just((1.0, 0.0, 0.0, -1.0)), Just((10.0, 0.0, 0.0, -25.0)), Just((4.0, 3.0, 3.0, -4.0)),
            Just((2.0, 1.0, 0.0, -3.0)),
        ]
    ) {
        let mut grid = Grid::new(width, height, |col, row| 8.0 * noise(col, row, 3));
        let map = Affine { x0: 0.0, a, b, y0: 0.0, d, e };
        let mut mesh = delaunay(&grid, |col, row| noise(col, row, seed) < dense);
        grid.info.transform = map;
        for vertex in &mut mesh.vertices {
            let [x, y] = map.apply(vertex[0], -vertex[1]);
            [vertex[0], vertex[1]] = [x, y];
        }
        let plan = |id: u64| [mesh.vertices[id as usize][0], mesh.vertices[id as usize][1]];
        let all: Vec<f64> = mesh.triangles.iter().map(|t| smallest(t.map(plan))).collect();
        // The law of cosines is not exact either.
        prop_assume!(all.iter().all(|angle| (angle - degrees).abs() > 1e-4));
        let thin = all.iter().filter(|angle| **angle < degrees).count() as u64;
        for memory in [1 << 20, 64 << 20] {
            let report = prove(&mesh, &grid, Some(degrees), memory);
            prop_assert_eq!(report.of.thin_triangles.count, thin);
            let told = report.verdict.failures.iter().any(|f| f.contains("angle below the minimum"));
            prop_assert_eq!(told, thin > 0);
            prop_assert_eq!(report.of.min_angle, Some(degrees));
            prop_assert_eq!(prove(&mesh, &grid, None, memory).of.thin_triangles.count, 0);
        }
    }
}
