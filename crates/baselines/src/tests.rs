//! Every method on small random grids: conforming, covers the surface and nothing else, counter-clockwise, and
//! every sample within the tolerance, by integers.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    BaselineGoal, BaselineMethod, BaselineTask, BaselineTin, HeightGrid, METHODS, PackedSample,
    TriangulationRule,
};
use proptest::prelude::*;
use terrane_base::geom::predicates::orient;

/// A small grid of whole heights.
#[derive(Clone, Debug)]
pub(crate) struct Heights {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) values: Vec<f64>,
}

impl Heights {
    pub(crate) fn grid(&self) -> HeightGrid<'_> {
        HeightGrid::new(self.width, self.height, &self.values, None).unwrap()
    }
}

/// Grids of 2 to 14 samples a side, steep, gentle or flat, half of them with voids.
pub(crate) fn grids() -> impl Strategy<Value = Heights> {
    let sizes = (2_u32..14, 2_u32..14, prop_oneof![Just(30_i32), Just(3), Just(0)], 0_u32..2);
    sizes.prop_flat_map(|(width, height, relief, voids)| {
        let void = (0_u32..12).prop_map(move |n| n == 0 && voids == 1);
        let sample = (-relief..=relief, void);
        let value = |(z, is_void)| if is_void { f64::NAN } else { f64::from(z) };
        prop::collection::vec(sample.prop_map(value), (width * height) as usize)
            .prop_map(move |values| Heights { width, height, values })
    })
}

/// In quarters, so that integers can decide.
pub(crate) fn tolerances() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(0.25), Just(1.0), Just(4.75), Just(13.0), Just(1000.0)]
}

/// The unit edges of the surface's outline, with the surface on their left, as positions.
fn outline(grid: &HeightGrid<'_>) -> BTreeSet<[[i32; 2]; 2]> {
    let mut edges = BTreeSet::new();
    for at in grid.samples().filter(|at| grid.holds_cell(at.col(), at.row())) {
        let [col, row] = at.lattice();
        let corners = [[col, row], [col + 1, row], [col + 1, row + 1], [col, row + 1]];
        for i in 0..4 {
            let (from, to) = (corners[i], corners[(i + 1) % 4]);
            if !edges.remove(&[to, from]) {
                edges.insert([from, to]);
            }
        }
    }
    edges
}

/// The unit steps of an edge along the lattice; none of a slanting one.
fn steps([from, to]: [[i32; 2]; 2]) -> Vec<[[i32; 2]; 2]> {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    if dx != 0 && dy != 0 {
        return Vec::new();
    }
    let at = |i: i32| [from[0] + i * dx.signum(), from[1] + i * dy.signum()];
    (0..dx.abs().max(dy.abs())).map(|i| [at(i), at(i + 1)]).collect()
}

/// Panics unless the triangles are counter-clockwise and cover the surface once. Edges that are not shared
/// are the outline; so the surface is wound around once, and no vertex lies within an edge.
pub(crate) fn check_cover(grid: &HeightGrid<'_>, tin: &BaselineTin) {
    let mut open: BTreeMap<[[i32; 2]; 2], u32> = BTreeMap::new();
    for triangle in &tin.triangles {
        let [a, b, c] = triangle.map(|i| tin.vertices[i as usize].lattice());
        assert!(orient(a, b, c) > 0, "{a:?} {b:?} {c:?}");
        for [from, to] in [[a, b], [b, c], [c, a]] {
            match open.get(&[to, from]) {
                Some(_) => drop(open.remove(&[to, from])),
                None => assert_eq!(open.insert([from, to], 1), None, "an edge is there twice"),
            }
        }
    }
    let mut left = outline(grid);
    for edge in open.into_keys() {
        let steps = steps(edge);
        assert!(!steps.is_empty(), "{edge:?} is slanting and has one triangle");
        steps.iter().for_each(|step| assert!(left.remove(step), "{edge:?} is not on the outline"));
    }
    assert!(left.is_empty(), "the mesh ends before {left:?}");
}

/// The largest error, as a fraction, by integers.
pub(crate) fn worst(grid: &HeightGrid<'_>, tin: &BaselineTin) -> (i64, i64) {
    let mut worst = (0, 1);
    for triangle in &tin.triangles {
        let corners = triangle.map(|i| tin.vertices[i as usize]);
        let [a, b, c] = corners.map(PackedSample::lattice);
        let z = corners.map(|corner| grid.sample(corner) as i64);
        for at in grid.samples() {
            let q = at.lattice();
            let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
            if weights.iter().all(|&weight| weight >= 0) {
                let height = grid.sample(at) as i64;
                let offset: i64 = weights.iter().zip(z).map(|(w, z)| w * (z - height)).sum();
                let error = (offset.abs(), orient(a, b, c));
                if error.0 * worst.1 > worst.0 * error.1 {
                    worst = error;
                }
            }
        }
    }
    worst
}

/// The meshes of a method, one for each triangulation that it accepts.
fn made(method: &BaselineMethod, grid: HeightGrid<'_>, goal: BaselineGoal) -> Vec<BaselineTin> {
    let count = if method.takes_triangulation { 3 } else { 1 };
    let all = TriangulationRule::ALL[..count].iter();
    let run = |&triangulation| {
        (method.run)(&BaselineTask { triangulation, ..BaselineTask::new(grid, goal) })
    };
    all.map(|triangulation| run(triangulation).unwrap()).collect()
}

proptest! {
    #[test]
    fn every_method_covers_the_surface_within_the_tolerance(
        heights in grids(), tolerance in tolerances()
    ) {
        let grid = heights.grid();
        prop_assume!(crate::mesh::check_surface(&grid).is_ok());
        for method in METHODS {
            for tin in made(method, grid, BaselineGoal::MaxError(tolerance)) {
                check_cover(&grid, &tin);
                let (error, of) = worst(&grid, &tin);
                assert!((4 * error) as f64 <= 4.0 * tolerance * of as f64, "{}", method.name);
                assert!(tin.max_error <= tolerance);
                assert!((tin.max_error - error as f64 / of as f64).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_budget_is_kept(heights in grids(), vertices in 4_u64..60, triangles in 2_u64..90) {
        let grid = heights.grid();
        prop_assume!(crate::mesh::check_surface(&grid).is_ok());
        for method in METHODS.iter().filter(|method| method.takes_budget) {
            for goal in [BaselineGoal::MaxVertices(vertices), BaselineGoal::MaxTriangles(triangles)] {
                let Ok(tin) = (method.run)(&BaselineTask::new(grid, goal)) else { continue };
                check_cover(&grid, &tin);
                let (error, of) = worst(&grid, &tin);
                assert!((tin.max_error - error as f64 / of as f64).abs() < 1e-12);
                match goal {
                    BaselineGoal::MaxVertices(most) => assert!(tin.vertices.len() as u64 <= most),
                    _ => assert!(tin.triangles.len() as u64 <= triangles),
                }
            }
        }
    }
}

#[test]
fn a_grid_without_a_surface_is_refused_by_all() {
    let heights = [1.0, f64::NAN, f64::NAN, 2.0, 1.0, 1.0];
    for (width, height) in [(2, 3), (3, 2), (6, 1), (1, 6)] {
        let grid = HeightGrid::new(width, height, &heights, None).unwrap();
        for method in METHODS {
            let error =
                (method.run)(&BaselineTask::new(grid, BaselineGoal::MaxError(1.0))).unwrap_err();
            assert!(error.to_string().contains("four valid samples"), "{}: {error}", method.name);
        }
    }
}

#[test]
fn a_pulse_that_fails_ends_the_work() {
    let heights: Vec<f64> = (0..400).map(|i| f64::from(i * i % 37)).collect();
    let grid = HeightGrid::new(20, 20, &heights, None).unwrap();
    for method in METHODS {
        let stop = || Err(terrane_base::Error::usage("enough"));
        let task =
            BaselineTask { pulse: &stop, ..BaselineTask::new(grid, BaselineGoal::MaxError(1.0)) };
        assert!((method.run)(&task).is_err(), "{}", method.name);
    }
}

#[test]
fn names_are_unique_and_texts_are_there() {
    let mut names: Vec<_> = METHODS.iter().map(|method| method.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), METHODS.len());
    for method in METHODS {
        let texts = [method.about, method.source, method.time, method.memory];
        assert!(texts.iter().all(|text| !text.is_empty()), "{}", method.name);
        assert!(method.sample_bytes >= 60 && !method.promise.text().is_empty());
    }
}

#[test]
fn grids_that_make_no_sense_are_refused() {
    let refused =
        |width, height, heights: &[f64]| HeightGrid::new(width, height, heights, None).is_err();
    assert!(refused(2, 2, &[0.0; 3]) && refused(16_385, 1, &vec![0.0; 16_385]));
    assert!(refused(2, 2, &[0.0, f64::INFINITY, 0.0, 0.0]));
    assert!(!refused(2, 2, &[0.0, f64::NAN, 0.0, 0.0]));
}
