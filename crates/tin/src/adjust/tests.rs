//! Tests of adjusted heights.

use super::star::{ErrorChunk, GAIN};
use super::*;
use crate::greedy::{WorkLists, fit};
use crate::heights::HeightWindow;
use crate::scan::{available, available_star};
use proptest::prelude::*;
use terrane_base::geom::HeightQuantization;
use terrane_base::geom::predicates::orient;

const SIDE: u32 = 12;

fn field(heights: &[f32], rounding: Option<HeightQuantization>) -> HeightField {
    let heights = HeightWindow { width: SIDE, height: SIDE, f32: heights, f64: None };
    let mut field = HeightField::default();
    field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], rounding);
    field.free_heights();
    field
}

fn samples() -> impl Iterator<Item = TilePosition> {
    (0..SIDE * SIDE).map(|i| TilePosition::new(i % SIDE, i / SIDE))
}

/// Whole heights, and a triangle that turns the right way.
fn ground() -> impl Strategy<Value = (Vec<f32>, [TilePosition; 3])> {
    let heights = prop::collection::vec(-40..40_i32, (SIDE * SIDE) as usize)
        .prop_map(|z| z.into_iter().map(|z| z as f32).collect());
    let corners = prop::array::uniform3((0..SIDE, 0..SIDE))
        .prop_map(|p| p.map(|(col, row)| TilePosition::new(col, row)));
    let turned = corners.prop_filter_map("a line", |[a, b, c]| {
        match orient(a.lattice(), b.lattice(), c.lattice()) {
            0 => None,
            1.. => Some([a, b, c]),
            _ => Some([a, c, b]),
        }
    });
    (heights, turned)
}

/// How much each corner shares in the height of a triangle, at a sample that is in it.
fn shares(corners: [TilePosition; 3], at: TilePosition) -> Option<[f64; 3]> {
    let ([a, b, c], q) = (corners.map(TilePosition::lattice), at.lattice());
    let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
    let double_area = orient(a, b, c) as f64;
    weights.iter().all(|&w| w >= 0).then(|| weights.map(|w| w as f64 / double_area))
}

/// How far the samples of a triangle are off at most.
fn error(field: &HeightField, corners: [TilePosition; 3]) -> f64 {
    let z = field.vertices(corners);
    let error = |at| {
        let parts = shares(corners, at)?;
        Some(((0..3).map(|i| parts[i] * z[i]).sum::<f64>() - field.sample(at)).abs())
    };
    samples().filter_map(error).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// When nothing moves any more, no vertex has a place that leaves much less of the largest error
    /// around it, however far from zero heights are.
    #[test]
    fn sweeps_leave_no_vertex_that_is_much_better_elsewhere(
        (heights, _) in ground(), far in prop_oneof![Just(0.0), Just(3000.0_f32)],
        looser in prop_oneof![Just(1.0), Just(1.2)]
    ) {
        const TOLERANCE: f64 = 30.0;
        let heights: Vec<_> = heights.iter().map(|z| z + far).collect();
        let field = field(&heights, None);
        let [scan, ..] = available()[..] else { unreachable!() };
        let judge = InsertionCriteria::of_samples(&field, scan.1, looser * TOLERANCE);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
        fit(&judge, &mut mesh, &mut WorkLists::default(), false);
        let is_on_rim = |at: TilePosition| [at.col(), at.row()].iter().any(|&i| i == 0 || i == SIDE - 1);
        let corners = mesh.tris.iter().flat_map(|tri| tri.corners);
        let inner: Vec<_> = corners.filter(|&at| !is_on_rim(at)).collect();
        for &at in &inner {
            prop_assert!((field.vertex(at) - field.sample(at)).abs() > 0.1 * TOLERANCE, "not put in");
        }
        let mut scratch = AdjustScratch::default();
        scratch.reset(&field, &[]);
        scratch.mark_due(&field, &mesh, |_| true);
        while scratch.sweep(&judge, &mesh, TOLERANCE) {}
        for &at in &inner {
            let around = || mesh.tris.iter().filter(|tri| tri.corners.contains(&at));
            let largest = || around().map(|tri| error(&field, tri.corners)).fold(0.0, f64::max);
            let (height, least) = (field.vertex(at), largest());
            for k in -4..=4 {
                field.move_vertex(at, field.sample(at) + f64::from(k) * TOLERANCE / 4.0);
                prop_assert!(largest() >= 0.6 * least, "{at:?} {k}: {} for {least}", largest());
            }
            field.move_vertex(at, height);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Heights are stored in steps of 2, so that the nearest to the end of a move may be beyond it.
    #[test]
    fn no_vertex_goes_further_than_the_tolerance((heights, _) in ground()) {
        const TOLERANCE: f64 = 29.0;
        let heights: Vec<_> = heights.iter().map(|z| z + 3e7).collect();
        let field = field(&heights, Some(HeightQuantization::about(0.0)));
        let judge = InsertionCriteria::of_samples(&field, available()[0].1, 1.2 * TOLERANCE);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
        fit(&judge, &mut mesh, &mut WorkLists::default(), false);
        let mut scratch = AdjustScratch::default();
        scratch.reset(&field, &[]);
        scratch.mark_due(&field, &mesh, |_| true);
        prop_assert!(scratch.sweep(&judge, &mesh, TOLERANCE));
        while scratch.sweep(&judge, &mesh, TOLERANCE) {}
        for at in samples() {
            let off = field.vertex(at) - field.sample(at);
            prop_assert!(off.abs() <= TOLERANCE && off % 2.0 == 0.0, "{at:?} {off}");
        }
    }
}

proptest! {
    #[test]
    fn a_triangle_lists_its_samples_with_their_shares(
        (heights, corners) in ground(), raised in -9.0..9.0_f64
    ) {
        let field = field(&heights, None);
        field.move_vertex(corners[0], field.sample(corners[0]) + raised);
        let z = field.vertices(corners);
        let facet = PlaneFacet::new(corners, z);
        for (level, (name, kernels)) in (0..3).flat_map(|l| available_star().into_iter().map(move |k| (l, k))) {
            let level = field.level(level);
            let is_at_level = |at: &TilePosition| (at.col() | at.row()).is_multiple_of(1 << level.shift);
            let [left, _] = facet.column_range(&level);
            // In strips of the columns of a chunk.
            let place = |at: TilePosition| (((at.col() >> level.shift) as i32 - left) / 8, at);
            let inside = samples().filter(is_at_level).filter_map(|at| Some((place(at), shares(corners, at)?)));
            let mut expected: Vec<_> = inside.collect();
            expected.sort_by_key(|&(place, _)| place);
            let mut chunks = vec![ErrorChunk::default(); star::chunks_of(&level, &facet)];
            let count = (kernels.list)(&mut chunks, &level, &facet);
            let all = chunks[..count].iter().flat_map(|chunk| chunk.offsets.into_iter().zip(chunk.shares));
            let found: Vec<_> = all.filter(|(offset, _)| !offset.is_nan()).collect();
            prop_assert_eq!(found.len(), expected.len(), "{}", name);
            for ((offset, share), ((_, at), parts)) in found.into_iter().zip(expected) {
                let plane: f64 = (0..3).map(|i| parts[i] * z[i]).sum();
                prop_assert!((f64::from(offset) - (plane - field.sample(at))).abs() < 1e-4);
                prop_assert!((f64::from(share) - parts[0]).abs() < 1e-5);
            }
        }
    }

    /// With whole heights and with such as are stored in steps of 1 / 16, half the tolerance or more.
    #[test]
    fn a_vertex_is_put_in_towards_the_mesh(
        (heights, corners) in ground(), far in prop_oneof![Just(0.0), Just(7e5_f32)],
        tolerance in prop_oneof![0.05..0.3_f64, Just(0.125), 1.0..30.0_f64]
    ) {
        let heights: Vec<_> = heights.iter().map(|z| z + far).collect();
        let rounding = HeightQuantization::about(0.0);
        let field = field(&heights, Some(rounding));
        let [scan, ..] = available()[..] else { unreachable!() };
        let judge = InsertionCriteria::of_samples(&field, scan.1, tolerance);
        for (at, parts) in samples().filter_map(|at| Some((at, shares(corners, at)?))) {
            let sample = field.sample(at);
            let plane: f64 = (0..3).map(|i| parts[i] * field.sample(corners[i])).sum();
            // Which way it goes is not told where it lies on the mesh.
            if (plane - sample).abs() > 1e-6 {
                let is_on_rim = [at.col(), at.row()].iter().any(|&i| i == 0 || i == SIDE - 1);
                let lower = rounding.apply(sample + 0.15 * tolerance * (plane - sample).signum());
                let is_kept = is_on_rim || (lower - sample).abs() > 0.5 * tolerance;
                put_in(&judge, corners, at);
                prop_assert_eq!(field.vertex(at), if is_kept { sample } else { lower });
                field.move_vertex(at, sample);
            }
        }
    }

    /// What is not due stays, unless a neighbour has moved; and the mesh stays within the tolerance.
    #[test]
    fn a_sweep_moves_what_is_due_and_neighbours_of_what_has_moved(
        (heights, _) in ground(), looser in prop_oneof![Just(1.0), Just(1.2)], pick in 0..40_usize
    ) {
        let field = field(&heights, None);
        let [scan, ..] = available()[..] else { unreachable!() };
        let judge = InsertionCriteria::of_samples(&field, scan.1, looser * 30.0);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
        fit(&judge, &mut mesh, &mut WorkLists::default(), false);
        let before: Vec<f64> = samples().map(|at| field.vertex(at)).collect();
        let moved = |at: TilePosition| field.vertex(at) != before[field.index(at)];
        let mut scratch = AdjustScratch::default();
        scratch.reset(&field, &[]);
        prop_assert!(!scratch.sweep(&judge, &mesh, 30.0));
        let chosen = mesh.tris[pick % mesh.tris.len()].corners;
        scratch.mark_due(&field, &mesh, |tri| tri.corners == chosen);
        let found = scratch.sweep(&judge, &mesh, 30.0);
        prop_assert!(found || !samples().any(moved));
        let largest = mesh.tris.iter().map(|tri| error(&field, tri.corners)).fold(0.0, f64::max);
        prop_assert!(largest <= looser * 30.0 + 1e-9);
        for at in samples().filter(|&at| moved(at)) {
            prop_assert!((field.vertex(at) - field.sample(at)).abs() <= 30.0);
            let of_it = || mesh.tris.iter().filter(|tri| tri.corners.contains(&at));
            let has_moved = |p: &TilePosition| *p != at && scratch.moved.contains(field.index(*p));
            let is_beside = |tri: &LatticeTriangle| tri.corners.iter().any(has_moved);
            prop_assert!(chosen.contains(&at) || of_it().any(is_beside), "{at:?}");
        }
        for tri in &mesh.tris {
            let has_moved = tri.corners.into_iter().any(moved);
            prop_assert!(scratch.has_moved(&field, tri) || !has_moved);
        }
    }

    /// The best move of all that make two errors meet, or one vanish, is found up to the gain that
    /// counts.
    #[test]
    fn no_move_is_better_than_the_best(
        errors in prop::collection::vec((-100..100_i32, 1..=16_i32), 1..40)
    ) {
        let scratch = StarErrors::of(errors.iter().map(|&(error, share)| (error as f32, share as f32 / 16.0)));
        let all = || errors.iter().map(|&(error, share)| (error as f32, share as f32 / 16.0));
        let largest =
            |step: f32| all().map(|(z, share)| (z + step * share).abs()).fold(0.0, f32::max);
        let meetings = all().flat_map(|(z, share)| {
            all().map(move |(other, part)| -(z + other) / (share + part))
        });
        let least = meetings.map(largest).fold(largest(0.0), f32::min);
        let found = |steps| scratch.best_move(steps).map_or(largest(0.0), |best| largest(best.step));
        prop_assert!(found(64) >= least * (1.0 - 1e-5));
        prop_assert!(found(64) <= least * (1.0 + 2.0 * GAIN) + 1e-4, "{} for {least}", found(64));
        // Fewer steps may end before, but each is one ahead.
        let usual = found(STEPS);
        prop_assert!(usual >= least * (1.0 - 1e-5) && usual <= largest(0.0));
        prop_assert!(found(2) <= found(1) && usual <= found(2));
    }
}

/// Of a square of four triangles around one vertex: samples half way to it go half as far as it does,
/// one towards the mesh and the others away from it.
#[test]
fn a_move_is_kept_up_to_the_last_bit_of_the_tolerance() {
    const BIT: f64 = 1.0 / (1 << 30) as f64;
    let [middle, beside] = [2, 1].map(|row| TilePosition::new(2, row));
    for far in [0.0_f32, -9.0, 4096.0] {
        let mut heights = vec![far; (SIDE * SIDE) as usize];
        let index = |at: TilePosition| (at.row() * SIDE + at.col()) as usize;
        (heights[index(middle)], heights[index(beside)]) = (far + 1.5, far + 2.0);
        let field = field(&heights, None);
        let judge = InsertionCriteria::of_samples(&field, available()[0].1, 1.0);
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(4, 4);
        let mut scratch = AdjustScratch::default();
        assert!(mesh.insert(0, middle, &mut Vec::new()));
        let half_edge = (0..16).find(|&at| mesh.origin(at) == middle).unwrap();
        assert!(mesh.star(half_edge, MAX_DEGREE, &mut scratch.star));
        scratch.errors.list(&field, &mesh, &scratch.star, true);
        let before = scratch.errors.envelope(0.0).largest();
        let keeps = |step: f64, is_final| {
            field.move_vertex(middle, field.sample(middle) + step);
            let step = VertexMove { step: step as f32, before };
            let found = scratch.keeps(&judge, &mesh, step, is_final);
            field.move_vertex(middle, field.sample(middle));
            found
        };
        // Both are then off by 1, which is 0.25 less than before.
        assert!(keeps(0.5, true), "{far}");
        for step in [0.5 - BIT, 0.5 + BIT, 0.4, 0.6] {
            assert!(!keeps(step, true), "{far} {step}");
            assert!(keeps(step, false), "{far} {step}");
        }
        // Nothing is gained.
        for step in [0.0, 1.0, -0.1] {
            assert!(!keeps(step, true) && !keeps(step, false), "{far} {step}");
        }
    }
}
