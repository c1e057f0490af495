//! Breaklines: what edges do not follow is found, wherever domains meet and whatever is void, and nothing else is.

use crate::support::{Grid, Mesh, delaunay, noise, split_cells};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use terrane_engine::breaklines::Breaklines;
use terrane_engine::constraints::GridConstraints;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_verify::{MeshRequirements, VerifyReport, verify};

type Ends = [[u32; 2]; 2];

fn prove(mesh: &Mesh, grid: &Grid, lines: &[Ends], memory: u64) -> VerifyReport {
    let kept = GridConstraints::default().with(Breaklines::of(lines.to_vec()));
    let asked = MeshRequirements { kept: &kept, ..MeshRequirements::of_samples(Some(1e9)) };
    let resources = Resources { threads: 2, memory, temp_dir: None };
    verify(mesh, grid, asked, &resources, &Silent, &Cancel::default()).unwrap()
}

/// The samples along a line, by rounding.
fn path([mut a, mut b]: Ends) -> Vec<[i64; 2]> {
    if [b[1], b[0]] < [a[1], a[0]] {
        (a, b) = (b, a);
    }
    let [dx, dy] = [0, 1].map(|axis| f64::from(b[axis]) - f64::from(a[axis]));
    let steps = (dx.abs() + dy.abs()) as u32;
    let sample = |step: u32| {
        let cols = (f64::from(step) * dx.abs() / f64::from(steps.max(1)) + 0.5).floor();
        let gone = [cols * dx.signum(), (f64::from(step) - cols) * dy.signum()];
        [0, 1].map(|axis| (f64::from(a[axis]) + gone[axis]) as i64)
    };
    (0..=steps).map(sample).collect()
}

/// Where lines are not followed, looked up sample by sample; the positions of vertices on lines.
fn twin(mesh: &Mesh, grid: &Grid, lines: &[Ends]) -> (Vec<[i64; 2]>, BTreeSet<[i64; 2]>) {
    let at = |id: u64| {
        let vertex = mesh.vertices[id as usize];
        [vertex[0] as i64, -vertex[1] as i64]
    };
    let mut around: BTreeMap<[i64; 2], BTreeSet<[i64; 2]>> = BTreeMap::new();
    for corners in &mesh.triangles {
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let [a, b] = [at(corners[i]), at(corners[j])];
            around.entry(a).or_default().insert(b);
            around.entry(b).or_default().insert(a);
        }
    }
    let borders = |a: [i64; 2], b: [i64; 2]| {
        let [col, row] = [0, 1].map(|axis| a[axis].min(b[axis]));
        let beside = if a[1] == b[1] { [col, row - 1] } else { [col - 1, row] };
        grid.is_surface(col, row) || grid.is_surface(beside[0], beside[1])
    };
    let has_surface = |[col, row]: [i64; 2]| {
        [(0, 0), (1, 0), (0, 1), (1, 1)].iter().any(|(c, r)| grid.is_surface(col - c, row - r))
    };
    let lines: BTreeSet<Ends> = lines
        .iter()
        .map(|ends| {
            let mut ends = *ends;
            ends.sort_unstable_by_key(|at| [at[1], at[0]]);
            ends
        })
        .collect();
    let (mut wrong, mut on) = (Vec::new(), BTreeSet::new());
    for &line in &lines {
        let path = path(line);
        for (i, &at) in path.iter().enumerate() {
            let before = i > 0 && borders(path[i - 1], at);
            let after = i + 1 < path.len() && borders(at, path[i + 1]);
            let Some(near) = around.get(&at) else {
                wrong.extend((has_surface(at) && !(before && after)).then_some(at));
                continue;
            };
            on.insert(at);
            wrong
                .extend((after && !path[i + 1..].iter().any(|to| near.contains(to))).then_some(at));
        }
    }
    (wrong, on)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn as_many_are_not_followed_as_the_twin_finds(
        width in 2_u32..500, height in 2_u32..80, seed: u32, dense in 0.0..0.6, holes in 0.0..0.1,
        ends in prop::collection::vec([[0..500_u32, 0..80_u32], [0..500_u32, 0..80_u32]], 1..30),
        far in 1_u32..60
    ) {
        let lines: Vec<Ends> = ends.iter().map(|&[a, b]| {
            let a = [a[0] % width, a[1] % height];
            [a, [(a[0] + b[0] % far).min(width - 1), (a[1] + b[1] % far).min(height - 1)]]
        }).collect();
        let mut grid = Grid::new(width, height, |col, row| 8.0 * noise(col, row, 3));
        // Every sample a vertex and some voids, or few vertices.
        let mesh = if dense > 0.3 {
            for (col, row) in (0..height).flat_map(|row| (0..width).map(move |col| (col, row))) {
                if noise(col, row, seed) < holes {
                    grid.set(col, row, f64::NAN);
                }
            }
            split_cells(&grid)
        } else {
            delaunay(&grid, |col, row| noise(col, row, seed) < dense)
        };
        prop_assume!(!mesh.triangles.is_empty());
        let (mut wrong, on) = twin(&mesh, &grid, &lines);
        wrong.sort_unstable_by_key(|at| [at[1], at[0]]);
        for memory in [1 << 20, 64 << 20] {
            let report = prove(&mesh, &grid, &lines, memory);
            prop_assert_eq!(report.of.not_followed.count, wrong.len() as u64);
            let first = report.of.not_followed.first.map(|at| [at.column as i64, at.row as i64]);
            prop_assert_eq!(first, wrong.first().copied());
            prop_assert_eq!(report.verdict.passed, wrong.is_empty());
            prop_assert_eq!(report.of.on_breaklines, on.len() as u64);
            prop_assert_eq!(report.of.breaklines.unwrap().apart, wrong.len() as u64);
        }
    }
}
