//! The four versions against each other: the same vertices in the same order.

use super::all_points::AllPoints;
use super::by_triangle::ByTriangle;
use super::candidates::CandidateHeap;
use super::point_heap::PointHeap;
use super::{CandidateSearch, insert};
use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::BaselineMesh;
use crate::result::BaselineTin;
use crate::settings::{BaselineGoal, BaselineTask};
use crate::tests::{grids, tolerances};
use crate::triangulation::TriangulationRule;
use proptest::prelude::*;
use terrane_base::geom::predicates::orient;

fn order<S: CandidateSearch>(task: &BaselineTask<'_>) -> (Vec<PackedSample>, BaselineTin) {
    let mut mesh = BaselineMesh::of_outline(&task.grid).unwrap();
    let mut order = Vec::new();
    insert::<S>(task, &mut mesh, |at| order.push(at)).unwrap();
    mesh.validate();
    (order, BaselineTin::of_mesh(&task.grid, &mesh))
}

proptest! {
    #[test]
    fn all_versions_choose_the_same_vertices_in_the_same_order(
        heights in grids(), tolerance in tolerances(), fraction in prop::bool::ANY,
        budget in prop::option::of(4_u64..90),
    ) {
        let scale = if fraction { 0.1 } else { 1.0 };
        let values: Vec<f64> = heights.values.iter().map(|z| z * scale).collect();
        let grid = HeightGrid::new(heights.width, heights.height, &values, None).unwrap();
        prop_assume!(crate::mesh::check_surface(&grid).is_ok());
        for triangulation in TriangulationRule::ALL {
            let goal = budget.map_or(BaselineGoal::MaxError(tolerance * scale), BaselineGoal::MaxVertices);
            let task = BaselineTask { triangulation, ..BaselineTask::new(grid, goal) };
            prop_assume!(crate::settings::SurfaceSize::of(&BaselineMesh::of_outline(&grid)?, goal).is_ok());
            let first = order::<AllPoints>(&task);
            prop_assert_eq!(&first, &order::<ByTriangle>(&task));
            prop_assert_eq!(&first, &order::<PointHeap>(&task));
            prop_assert_eq!(&first, &order::<CandidateHeap>(&task));
            if let Some(budget) = budget {
                let count = first.1.vertices.len() as u64;
                prop_assert!(count == budget || (count < budget && first.1.max_error == 0.0));
            }
        }
    }

    /// On a tile that is the whole grid, with level rims, the engine chooses nothing beforehand.
    #[test]
    fn the_last_version_chooses_what_the_engine_does_one_by_one(
        heights in prop::collection::vec(-30_i8..30, 14 * 11), tolerance in 0_u8..25
    ) {
        let is_rim = |i: usize| [0, 13].contains(&(i % 14)) || [0, 10].contains(&(i / 14));
        let level = |(i, z)| if is_rim(i) { 0.0 } else { f32::from(z) };
        let heights: Vec<f32> = heights.into_iter().enumerate().map(level).collect();
        let values: Vec<f64> = heights.iter().map(|&z| f64::from(z)).collect();
        let grid = HeightGrid::new(14, 11, &values, None).unwrap();
        let tolerance = f64::from(tolerance);
        let (_, tin) = order::<CandidateHeap>(&BaselineTask::new(grid, BaselineGoal::MaxError(tolerance)));
        let place = |&i: &u32| [tin.vertices[i as usize].col(), tin.vertices[i as usize].row()];
        let mut ours: Vec<_> =
            tin.triangles.iter().map(|ids| [place(&ids[0]), place(&ids[1]), place(&ids[2])]).collect();
        let mut theirs = by_engine(&heights, tolerance);
        ours.sort_unstable();
        theirs.sort_unstable();
        prop_assert_eq!(ours, theirs);
    }

    #[test]
    fn a_flip_makes_the_sum_of_largest_errors_smaller(
        heights in prop::collection::vec(-9_i8..9, 13 * 13), rows in prop::collection::vec(0_u32..13, 4),
        cols in (0_u32..6, 7_u32..13)
    ) {
        let heights: Vec<f64> = heights.into_iter().map(f64::from).collect();
        let grid = HeightGrid::new(13, 13, &heights, None).unwrap();
        prop_assume!(rows[1] != rows[2]);
        let [low, high] = [rows[1].min(rows[2]), rows[1].max(rows[2])];
        let [a, b] = [PackedSample::new(6, low), PackedSample::new(6, high)];
        let [p, d] = [PackedSample::new(cols.0, rows[0]), PackedSample::new(cols.1, rows[3])];
        let (before, after) = (naive(&grid, [[p, a, b], [a, d, b]]), naive(&grid, [[p, a, d], [p, d, b]]));
        let is_smaller = after.is_some_and(|after| after < before.unwrap() - 1e-9);
        let is_larger = after.is_none_or(|after| after > before.unwrap() + 1e-9);
        let flips = TriangulationRule::DataDependent.flips(&grid, [p, a, b, d]);
        prop_assert!(!(flips && is_larger) && (flips || !is_smaller));
    }
}

/// The sum of the largest errors of two triangles; none where one is not counter-clockwise.
fn naive(grid: &HeightGrid<'_>, triangles: [[PackedSample; 3]; 2]) -> Option<f64> {
    let mut sum = 0.0;
    for triangle in triangles {
        let [a, b, c] = triangle.map(PackedSample::lattice);
        let [x, y, z] = triangle.map(|corner| grid.sample(corner));
        let area = orient(a, b, c);
        if area <= 0 {
            return None;
        }
        let error = |at: PackedSample| {
            let q = at.lattice();
            let [u, v, w] = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
            let height = (u as f64 * x + v as f64 * y + w as f64 * z) / area as f64;
            if u.min(v).min(w) < 0 { 0.0 } else { (grid.sample(at) - height).abs() }
        };
        sum += grid.samples().map(error).fold(0.0, f64::max);
    }
    Some(sum)
}

/// The triangles of the engine's kernel on one tile, the largest error first and nothing dropped.
fn by_engine(heights: &[f32], tolerance: f64) -> Vec<[[u32; 2]; 3]> {
    let heights = terrane_tin::HeightWindow { width: 14, height: 11, f32: heights, f64: None };
    let [apron_left, apron_right, apron_above, apron_below] = [0; 4];
    let input = terrane_tin::TileInput {
        heights,
        apron_left,
        apron_right,
        apron_above,
        apron_below,
        spacing: 99,
        kept: &[],
        lines: &[],
    };
    let spec = terrane_tin::TinSpec {
        tolerance,
        bound: terrane_base::bound::ErrorBound::Samples,
        strict: true,
        drop: false,
        fit_heights: false,
        data_dependent: false,
        min_angle: None,
        single_precision: None,
        measure: false,
    };
    let made =
        terrane_tin::triangulate_tile(&input, &spec, &mut terrane_tin::TileScratch::default());
    let place = |corner: terrane_tin::TilePosition| [corner.col(), corner.row()];
    made.triangles.iter().map(|triangle| triangle.corners.map(place)).collect()
}
