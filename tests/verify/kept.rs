//! Samples to keep: those that are no vertices are found, wherever domains meet, and nothing else is.

use crate::support::{Grid, Mesh, delaunay, noise, split_cells};
use proptest::prelude::*;
use std::collections::BTreeSet;
use terrane_engine::constraints::GridConstraints;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_verify::{GridLocation, MeshRequirements, VerifyReport, verify};

fn prove(mesh: &Mesh, grid: &Grid, kept: &GridConstraints, memory: u64) -> VerifyReport {
    let asked = MeshRequirements { kept, ..MeshRequirements::of_samples(Some(1e9)) };
    let resources = Resources { threads: 2, memory, temp_dir: None };
    verify(mesh, grid, asked, &resources, &Silent, &Cancel::default()).unwrap()
}

fn grid(width: u32, height: u32) -> Grid {
    Grid::new(width, height, |col, row| 8.0 * noise(col, row, 3))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Its twin looks each sample up among all vertices.
    #[test]
    fn as_many_are_missing_as_the_twin_finds(
        width in 2_u32..600, height in 2_u32..80, seed: u32, dense in 0.0..0.3, wanted in 0.0..0.3
    ) {
        let grid = grid(width, height);
        let mesh = delaunay(&grid, |col, row| noise(col, row, seed) < dense);
        let all = (0..height).flat_map(|row| (0..width).map(move |col| [col, row]));
        let samples: Vec<_> =
            all.filter(|&[col, row]| noise(col, row, !seed) < wanted || noise(col, row, seed) < 0.1).collect();
        let vertices: BTreeSet<[u32; 2]> =
            mesh.vertices.iter().map(|v| [v[0] as u32, -v[1] as u32]).collect();
        let missing: Vec<_> = samples.iter().filter(|at| !vertices.contains(*at)).collect();
        let kept = GridConstraints::of(samples.clone());
        for memory in [1 << 20, 64 << 20] {
            let report = prove(&mesh, &grid, &kept, memory);
            prop_assert_eq!(report.of.not_kept.count, missing.len() as u64);
            let first = report.of.not_kept.first.map(|at| [at.column as u32, at.row as u32]);
            prop_assert_eq!(first.as_ref(), missing.first().copied());
            prop_assert_eq!(report.verdict.passed, missing.is_empty());
            let told = report.of.keep_points.unwrap_or_default();
            prop_assert_eq!(told.samples, samples.len() as u64);
            prop_assert_eq!(told.vertices, (samples.len() - missing.len()) as u64);
        }
    }
}

#[test]
fn a_vertex_at_another_height_is_not_kept_even_where_heights_are_fitted() {
    let grid = grid(12, 9);
    let kept = GridConstraints::of(vec![[5, 4], [6, 4]]);
    for fitted in [false, true] {
        let mut mesh = split_cells(&grid);
        if fitted {
            mesh.info.details.push(("comment".to_owned(), "fitted heights".to_owned()));
        }
        assert!(prove(&mesh, &grid, &kept, 64 << 20).verdict.passed);
        let id = mesh.find(5.0, -4.0) as usize;
        mesh.vertices[id][2] += 0.5;
        let report = prove(&mesh, &grid, &kept, 64 << 20);
        assert_eq!(report.of.fitted, fitted);
        assert_eq!(report.of.not_kept.count, 1);
        let GridLocation { column, row, .. } = report.of.not_kept.first.unwrap();
        assert_eq!((column, row), (5.0, 4.0));
        assert_eq!(
            report.verdict.failures,
            [
                "1 required samples that are not vertices at their height, first at column 5, row 4 (x 5, y -4)"
            ]
        );
    }
}

#[test]
fn what_has_no_surface_cannot_be_kept() {
    let mut grid = grid(9, 9);
    // (0, 0) is left with no cell, (1, 1) is void, (2, 2) is on the outline.
    grid.set(1, 1, f64::NAN);
    let kept = GridConstraints::of(vec![[0, 0], [1, 1], [2, 2]]);
    let report = prove(&split_cells(&grid), &grid, &kept, 64 << 20);
    assert!(report.verdict.passed, "{:?}", report.verdict.failures);
    let told = report.of.keep_points.unwrap();
    assert_eq!((told.samples, told.without_surface, told.vertices), (3, 2, 1));
}
