//! Methods that bound a distance.

use super::*;
use crate::cone::cone;
use crate::imai_iri::imai_iri;
use crate::metric::is_monotone;
use crate::rdp::rdp;
use crate::registry::{METHODS, method};

/// Textbook Ramer-Douglas-Peucker, one distance at a time.
pub(super) fn plain_rdp<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
) -> Vec<u32> {
    let mut kept: Vec<u32> = (0..points.len() as u32).take(1).collect();
    kept.extend((points.len() > 1).then(|| points.len() as u32 - 1));
    let mut parts = vec![(0, points.len().saturating_sub(1))];
    while let Some((start, end)) = parts.pop() {
        let mut worst = (start, tolerance * tolerance);
        for i in start + 1..end.max(start + 1) {
            let square = metric.distance2(&points[i], &points[start], &points[end]);
            if square > worst.1 {
                worst = (i, square);
            }
        }
        if worst.0 > start {
            kept.push(worst.0 as u32);
            parts.extend([(start, worst.0), (worst.0, end)]);
        }
    }
    kept.sort_unstable();
    kept
}

/// The minimum number of vertices by exhaustive search; each from the last vertex that needs one fewer.
fn fewest<V: Copy, M: DistanceMetric<V>>(metric: &M, points: &[V], tolerance: f64) -> Vec<u32> {
    let holds = |from: usize, to: usize| {
        let within = |i: usize| {
            metric.distance2(&points[i], &points[from], &points[to]) <= tolerance * tolerance
        };
        (from + 1..to).all(within)
    };
    let mut best: Vec<(usize, usize)> = Vec::new();
    for to in 0..points.len() {
        let before = (0..to).rev().filter(|from| holds(*from, to));
        best.push(
            before.map(|from| (best[from].0 + 1, from)).min_by_key(|b| b.0).unwrap_or((1, 0)),
        );
    }
    let mut kept: Vec<u32> = Vec::new();
    let mut at = points.len();
    while at > 0 {
        kept.insert(0, at as u32 - 1);
        at = if at == 1 { 0 } else { best[at - 1].1 + 1 };
    }
    kept
}

struct SameAsPlain;

impl Check for SameAsPlain {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let kept = run(rdp, metric, points, tolerance);
        assert_eq!(kept, plain_rdp(metric, points, tolerance));
        assert_holds(metric, points, tolerance, &kept);
    }
}

struct FewestVertices;

impl Check for FewestVertices {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let kept = run(imai_iri, metric, points, tolerance);
        assert_holds(metric, points, tolerance, &kept);
        assert_eq!(kept, fewest(metric, points, tolerance));
    }
}

struct ConeHolds;

impl Check for ConeHolds {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let kept = run(cone, metric, points, tolerance);
        assert_holds(metric, points, tolerance, &kept);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn rdp_is_plain_rdp_on_short_lines(line in short_line(), tolerance in tolerance()) {
        SameAsPlain.everywhere(&line, tolerance);
    }

    #[test]
    fn imai_iri_keeps_the_fewest(line in short_line(), tolerance in tolerance()) {
        FewestVertices.everywhere(&line, tolerance);
    }

    #[test]
    fn cone_holds_on_short_lines(line in short_line(), tolerance in tolerance()) {
        ConeHolds.everywhere(&line, tolerance);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn rdp_is_plain_rdp_on_long_lines(line in long_line(), tolerance in tolerance()) {
        SameAsPlain.everywhere(&line, tolerance);
    }

    #[test]
    fn cone_holds_on_long_lines(line in long_line(), tolerance in tolerance()) {
        ConeHolds.everywhere(&line, tolerance);
    }

    #[test]
    fn imai_iri_is_no_worse_than_the_others(line in long_line(), tolerance in tolerance()) {
        let kept = run(imai_iri, &PlaneMetric, &line, tolerance);
        assert_holds(&PlaneMetric, &line, tolerance, &kept);
        prop_assert!(kept.len() <= run(rdp, &PlaneMetric, &line, tolerance).len());
        prop_assert!(kept.len() <= run(cone, &PlaneMetric, &line, tolerance).len());
    }

    #[test]
    fn imai_iri_keeps_the_fewest_of_longer_lines(seed: u64, is_lattice: bool, tolerance in tolerance()) {
        FewestVertices.everywhere(&walk(seed, 150, is_lattice), tolerance);
    }

    /// A tolerance so large that segments are tested against regions of vertices.
    #[test]
    fn imai_iri_keeps_the_fewest_for_long_segments(
        seed: u64,
        is_lattice: bool,
        tolerance in prop_oneof![Just(6.0), 4.0..20.0],
    ) {
        FewestVertices.everywhere(&walk(seed, 500, is_lattice), tolerance);
    }
}

#[test]
fn lines_too_short_to_lose_anything_stay() {
    for method in METHODS {
        for count in 0..3 {
            let line = vec![[1.0, 2.0]; count];
            let kept = run(method.plane, &PlaneMetric, &line, 9.0);
            assert_eq!(kept, (0..count as u32).collect::<Vec<_>>(), "{}", method.name);
        }
    }
}

#[test]
fn zero_tolerance_drops_what_lies_on_segments() {
    let line = [[0.0, 0.0], [1.0, 3.0], [1.0, 3.0], [2.0, 6.0], [3.0, 3.0], [4.0, 0.0], [2.0, 6.0]];
    for name in ["cone", "rdp", "imai-iri"] {
        let method = method(name).expect("registered");
        assert_eq!(run(method.plane, &PlaneMetric, &line, 0.0), [0, 3, 5, 6], "{name}");
    }
}

#[test]
fn names_are_unique() {
    let mut names: Vec<_> = METHODS.iter().map(|method| method.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), METHODS.len());
    assert!(method("peucker").is_none());
}

#[test]
fn spaces_and_profiles_measure_their_own_distances() {
    assert_eq!(SpaceMetric.distance2(&[0.0, 0.0, 3.0], &[-1.0, 0.0, 0.0], &[1.0, 0.0, 0.0]), 9.0);
    assert_eq!(SpaceMetric.distance2(&[5.0, 0.0, 3.0], &[-1.0, 0.0, 0.0], &[1.0, 0.0, 0.0]), 25.0);
    assert_eq!(VerticalMetric.distance2(&[1.0, 3.0], &[0.0, 0.0], &[2.0, 2.0]), 4.0);
    assert_eq!(PlaneMetric.distance2(&[3.0, 4.0], &[0.0, 0.0], &[0.0, 0.0]), 25.0);
    assert!(is_monotone(&[[2.0, 0.0], [1.0, 5.0], [0.0, 0.0]]));
    assert!(!is_monotone(&[[2.0, 0.0], [1.0, 5.0], [1.0, 0.0]]));
}

#[test]
fn degrees_are_metres() {
    let place = |lon: f64, lat: f64| LocatedVertex::new([lon, lat]);
    // Lengths of a degree on WGS 84 from tables: at the equator, and at 60 degrees north.
    let [east, north] = place(0.0, 0.0).scale;
    assert!((east - 111_319.49).abs() < 0.01 && (north - 110_574.28).abs() < 0.02);
    let [east, north] = place(0.0, 60.0).scale;
    assert!((east - 55_800.0).abs() < 1.0 && (north - 111_412.24).abs() < 1.0);
    let square =
        GeographicMetric.distance2(&place(0.0, 60.001), &place(-1.0, 60.0), &place(1.0, 60.0));
    assert!((square.sqrt() - 111.41).abs() < 0.01);
    let pole = GeographicMetric.distance2(&place(7.0, 90.0), &place(0.0, 89.0), &place(90.0, 89.0));
    assert!((pole.sqrt() - 111_693.9).abs() < 1.0);
}

#[test]
fn lines_on_which_plain_splits_are_quadratic() {
    let count = 200_000;
    let sign = |i: u32| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let lines: [Vec<Xy>; 3] = [
        (0..count).map(|i| [f64::from(i), sign(i)]).collect(),
        (0..count).map(|i| [f64::from(i), f64::from(i) * sign(i)]).collect(),
        (0..count)
            .map(|i| (f64::from(i) * 0.01, 1e4 - f64::from(i) * 0.01))
            .map(|(turn, radius)| [radius * turn.cos(), radius * turn.sin()])
            .collect(),
    ];
    for line in &lines {
        for name in ["cone", "rdp", "imai-iri"] {
            let kept = run(method(name).expect("registered").plane, &PlaneMetric, line, 0.5);
            assert_holds(&PlaneMetric, line, 0.5, &kept);
        }
    }
}

#[test]
fn straight_lines_with_rounding_noise_end() {
    let at = |i: u32| f64::from(i) / 100_000.0;
    let line: Vec<Xy> = (0..100_000).map(|i| [0.1 + at(i) * 0.7, 0.3 + at(i) * 0.9]).collect();
    // And with a corner, so that what is straight does not begin with the line.
    let back = line[..30_000].iter().rev().map(|p| [2.0 * line[30_000][0] - p[0], p[1]]);
    let corner: Vec<Xy> = line[..=30_000].iter().copied().chain(back).collect();
    for (name, tolerance) in
        [("cone", 0.0), ("cone", 1e-16), ("imai-iri", 0.0), ("imai-iri", 1e-16)]
    {
        for line in [&line, &corner] {
            let kept = run(method(name).expect("registered").plane, &PlaneMetric, line, tolerance);
            assert_holds(&PlaneMetric, line, tolerance, &kept);
        }
    }
}
