//! Tests of the methods against slow reference implementations.

mod cones;
mod hierarchies;
mod hulls;
mod looks;
mod methods;
mod metrics;
mod rings;
mod scans;
mod triangles;
mod wedges;

use proptest::prelude::*;

use super::metric::{DistanceMetric, largest_distance2};
use super::{
    GeographicMetric, LocatedVertex, PlaneMetric, SimplifyScratch, SpaceMetric, VerticalMetric, Xy,
};

/// A generator with a fixed seed (SplitMix64): whole numbers below `most`.
struct Dice(u64);

impl Dice {
    fn below(&mut self, most: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (v ^ (v >> 31)) % most
    }

    /// Between -1 and 1.
    fn swing(&mut self) -> f64 {
        self.below(1 << 40) as f64 / (1_u64 << 39) as f64 - 1.0
    }
}

/// A walk in the plane, on a lattice or not.
fn walk(seed: u64, count: usize, is_lattice: bool) -> Vec<Xy> {
    let mut dice = Dice(seed);
    let mut at = [0.0; 2];
    let step = |dice: &mut Dice| match is_lattice {
        true => dice.below(3) as f64 - 1.0,
        false => dice.swing(),
    };
    (0..count)
        .map(|_| {
            at = [at[0] + step(&mut dice), at[1] + step(&mut dice)];
            at
        })
        .collect()
}

/// Short lines: on a small lattice, with many duplicate, collinear and equidistant vertices; on one line, back
/// and forth; anywhere.
fn short_line() -> impl Strategy<Value = Vec<Xy>> {
    let lattice = |x: i32, y: i32| {
        prop::collection::vec((0..x, 0..y), 0..28).prop_map(|line| {
            line.into_iter().map(|(x, y)| [f64::from(x), f64::from(y)]).collect::<Vec<Xy>>()
        })
    };
    prop_oneof![
        lattice(5, 5),
        lattice(40, 3),
        lattice(9, 1),
        (any::<u64>(), 0..28_usize).prop_map(|(seed, count)| walk(seed, count, true)),
        (any::<u64>(), 0..28_usize).prop_map(|(seed, count)| walk(seed, count, false)),
    ]
}

/// Lines long enough for a tree of regions.
fn long_line() -> impl Strategy<Value = Vec<Xy>> {
    (any::<u64>(), 100..1500_usize, any::<bool>())
        .prop_map(|(seed, count, is_lattice)| walk(seed, count, is_lattice))
}

/// Tolerances with ties on a lattice, and others.
fn tolerance() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(0.5), Just(1.0), Just(2.0), Just(0.5_f64.sqrt()), 0.0..4.0]
}

/// The line as a profile: x grows by at least one.
fn profile(line: &[Xy]) -> Vec<Xy> {
    let mut x = 0.0;
    line.iter()
        .map(|p| {
            x += 1.0 + p[0].abs().floor();
            [x, p[1]]
        })
        .collect()
}

/// The line in space.
fn in_space(line: &[Xy]) -> Vec<[f64; 3]> {
    line.iter().map(|p| [p[0], p[1], (p[0] * 3.0 + p[1]) % 4.0]).collect()
}

/// The line on the ellipsoid, in steps of about 100 m, starting at 60 degrees north.
fn on_ellipsoid(line: &[Xy]) -> Vec<LocatedVertex> {
    line.iter().map(|p| LocatedVertex::new([p[0] * 1e-3, 60.0 + p[1] * 1e-3])).collect()
}

/// Runs a check on a line in each metric.
trait Check {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64);

    fn everywhere(&self, line: &[Xy], tolerance: f64) {
        self.check(&PlaneMetric, line, tolerance);
        self.check(&SpaceMetric, &in_space(line), tolerance);
        self.check(&VerticalMetric, &profile(line), tolerance);
        self.check(&GeographicMetric, &on_ellipsoid(line), tolerance * 100.0);
    }
}

/// Vertices kept by a method.
fn run<V: Copy, M: DistanceMetric<V>>(
    method: impl Fn(&M, &[V], f64, &mut SimplifyScratch, &mut Vec<u32>),
    metric: &M,
    points: &[V],
    tolerance: f64,
) -> Vec<u32> {
    let mut kept = vec![7];
    method(metric, points, tolerance, &mut SimplifyScratch::default(), &mut kept);
    assert_eq!(kept.remove(0), 7);
    kept
}

/// Ends kept, in order, and everything within the tolerance by the formula.
fn assert_holds<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    kept: &[u32],
) {
    assert!(kept.is_sorted_by(|a, b| a < b));
    assert_eq!(kept.first().copied(), (!points.is_empty()).then_some(0));
    assert_eq!(
        kept.last().map(|last| *last as usize + 1),
        points.len().checked_sub(0).filter(|n| *n > 0)
    );
    if let Some((i, square)) = largest_distance2(metric, points, kept) {
        assert!(square <= tolerance * tolerance, "vertex {i}: {square} beyond {tolerance} squared");
        assert!(square.sqrt() <= tolerance);
    }
}
