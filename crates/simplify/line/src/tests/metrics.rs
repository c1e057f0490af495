//! Formulas of metrics, and bounds of regions.

use super::*;
use crate::metric::is_monotone;

/// Bounds are not below the bounded value; for one vertex they are exact.
struct BoundsHold;

impl Check for BoundsHold {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], _: f64) {
        let [a, b, rest @ ..] = points else { panic!("no segment, and nothing beside it") };
        assert!(!rest.is_empty());
        let ends = [a, b].map(M::region);
        for segment in [metric.segment(a, b), metric.segment(b, a), metric.segment(a, a)] {
            let mut all = M::join(&ends[0], &ends[1]);
            let mut most = M::reach(&segment, a).max(M::reach(&segment, b));
            for p in rest {
                let reach = M::reach(&segment, p);
                let own = M::reach_most(&segment, &M::region(p));
                let slack = reach * 1e-8 + 1e-18;
                assert!(reach <= own && own <= reach + slack, "{reach} is not {own}");
                (all, most) = (M::join(&all, &M::region(p)), most.max(reach));
                assert!(most <= M::reach_most(&segment, &all));
                let within = M::within(&segment, M::squared(&segment, reach));
                assert!((within - reach).abs() <= reach * 1e-13);
                assert!(M::squared(&segment, within) <= M::squared(&segment, reach));
            }
        }
    }
}

/// Distances of vertices with a scale, by components.
fn scaled_distance2(p: &LocatedVertex, a: &LocatedVertex, b: &LocatedVertex) -> f64 {
    let seen = |q: &LocatedVertex| [0, 1].map(|i| (q.at[i] - p.at[i]) * p.scale[i]);
    let (from, to) = (seen(a), seen(b));
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let part = -(from[0] * along[0] + from[1] * along[1]) / length;
    let part = if length > 0.0 { part.clamp(0.0, 1.0) } else { 0.0 };
    [0, 1].map(|i| from[i] + part * along[i]).iter().map(|v| v * v).sum()
}

/// The ends of a segment, and at least one vertex beside it.
fn beside_a_segment() -> impl Strategy<Value = Vec<Xy>> {
    short_line().prop_filter("nothing is beside a segment", |line| line.len() > 2)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn bounds_hold(line in beside_a_segment()) {
        BoundsHold.everywhere(&line, 0.0);
    }

    /// Some at a pole, where an eastward segment has no length.
    #[test]
    fn bounds_hold_for_any_scale(line in beside_a_segment(), seed: u64) {
        let mut dice = Dice(seed);
        let mut scale = || [dice.below(3) as f64 * 0.7, 0.5 + dice.below(3) as f64];
        let line: Vec<LocatedVertex> = line.iter().map(|at| LocatedVertex { at: *at, scale: scale() }).collect();
        BoundsHold.check(&GeographicMetric, &line, 0.0);
        for p in &line[2..] {
            let [a, b] = [&line[0], &line[1]];
            let (own, want) = (GeographicMetric.distance2(p, a, b), scaled_distance2(p, a, b));
            prop_assert!((own - want).abs() < 1e-9 * (1.0 + want), "{own} is not {want}");
        }
    }

    /// Areas and angles in space and on the ellipsoid are those of triangles in a plane.
    #[test]
    fn areas_and_angles_are_those_in_the_plane(v in prop::array::uniform6(-5_i32..5), turn in 0_usize..3) {
        let [a, b, c] = [0, 2, 4].map(|i| [f64::from(v[i]), f64::from(v[i + 1])]);
        let (area, cosine) = (PlaneMetric.area(&a, &b, &c), PlaneMetric.cosine(&a, &b, &c));
        let near = |p: f64, q: f64| (p - q).abs() <= 1e-9 * (1.0 + q.abs());
        // On a plane through an axis, slanted: x goes along (3, 4) / 5 of the two others.
        let place = |p: Xy| {
            let mut p = [p[0] * 0.6 + 7.0, p[0] * 0.8 - 2.0, p[1] + 1.0];
            p.rotate_left(turn);
            p
        };
        let [p, q, r] = [a, b, c].map(place);
        prop_assert!(near(SpaceMetric.area(&p, &q, &r), area));
        prop_assert!(near(SpaceMetric.cosine(&p, &q, &r), cosine));
        prop_assert!(near(VerticalMetric.area(&a, &b, &c), area));
        prop_assert!(near(VerticalMetric.cosine(&a, &b, &c), cosine));
        let located = |p: Xy, scale: Xy| LocatedVertex { at: [p[0] / scale[0], p[1] / scale[1]], scale };
        // The scale of the middle one is taken.
        let (p, r) = (located(a, [4.0, 0.5]), located(c, [4.0, 0.5]));
        let [p, r] = [p, r].map(|vertex| LocatedVertex { scale: [9.0, 9.0], ..vertex });
        let q = located(b, [4.0, 0.5]);
        prop_assert!(near(GeographicMetric.area(&p, &q, &r), area));
        prop_assert!(near(GeographicMetric.cosine(&p, &q, &r), cosine));
    }
}

#[test]
fn profiles_grow_or_fall() {
    assert!(is_monotone(&[[0.0, 0.0], [1.0, 5.0], [3.0, 0.0]]));
    assert!(!is_monotone(&[[0.0, 0.0], [0.0, 5.0]]));
    assert!(!is_monotone(&[[0.0, 0.0], [1.0, 5.0], [0.5, 0.0]]));
    assert_eq!(VerticalMetric.distance2(&[0.0, 3.0], &[0.0, 1.0], &[0.0, 9.0]), 4.0);
}

#[test]
fn coordinates_are_those_given() {
    assert_eq!(PlaneMetric::coordinates(&[1.0, 2.0]), [1.0, 2.0, 0.0]);
    assert_eq!(VerticalMetric::coordinates(&[1.0, 2.0]), [1.0, 2.0, 0.0]);
    assert_eq!(SpaceMetric::coordinates(&[1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]);
    assert_eq!(GeographicMetric::coordinates(&LocatedVertex::new([1.0, 2.0])), [1.0, 2.0, 0.0]);
}

/// The first of the farthest omitted vertices; kept vertices do not count.
#[test]
fn the_largest_distance_is_that_of_a_dropped_vertex() {
    let line = [[0.0, 0.0], [1.0, 0.0], [2.0, 2.0], [3.0, -2.0], [4.0, 0.0], [4.0, 0.0]];
    let largest = |kept: &[u32]| largest_distance2(&PlaneMetric, &line, kept);
    assert_eq!(largest(&[0, 1, 2, 3, 4, 5]), None);
    assert_eq!([largest(&[0]), largest(&[])], [None; 2]);
    assert_eq!(largest(&[0, 4, 5]), Some((2, 4.0)));
    assert_eq!(largest(&[0, 1, 2, 3, 5]), Some((4, 0.0)));
    assert_eq!(largest(&[0, 2, 4, 5]).map(|(at, _)| at), Some(3));
}

/// Extremes of a hull across and along, and vertices beyond the ends.
#[test]
fn a_segment_knows_its_sides() {
    let segment = PlaneMetric.segment(&[1.0, 2.0], &[4.0, 6.0]);
    assert_eq!(segment.direction(), [3.0, 4.0]);
    let at = |along: f64, across: f64| {
        [1.0 + 0.6 * along - 0.8 * across, 2.0 + 0.8 * along + 0.6 * across]
    };
    assert!(segment.is_beyond(&at(-0.5, 3.0), 0) && !segment.is_beyond(&at(-0.5, 3.0), 1));
    assert!(segment.is_beyond(&at(5.5, 3.0), 1) && !segment.is_beyond(&at(5.5, 3.0), 0));
    assert!(![0, 1].iter().any(|side| segment.is_beyond(&at(2.5, 9.0), *side)));
    let near = |p: f64, q: f64| assert!((p - q).abs() < 1e-9, "{p} is not {q}");
    // Reaches are squares of distances, times 25.
    near(segment.reach_from_end(2.0), 50.0);
    near(segment.max_across(&[at(0.0, -2.0), at(0.0, 1.0)], 0.0), 100.0);
    near(segment.max_across(&[at(0.0, -2.0), at(0.0, 1.0)], 5.0), 225.0);
    near(segment.max_along(&[at(-1.0, 0.0), at(8.0, 0.0)], 0.0), 225.0);
    near(segment.max_along(&[at(-1.0, 0.0), at(8.0, 0.0)], 5.0), 400.0);
    near(segment.max_along(&[at(1.0, 0.0), at(4.0, 0.0)], 0.0), 0.0);
    near(segment.max_around(100.0, 0.0), 100.0);
    near(segment.max_around(100.0, 3.0), 256.0);
    assert!(segment.max_around(100.0, 0.0) > 100.0);
    let around =
        PlaneMetric::join(&PlaneMetric::region(&[0.0, 1.0]), &PlaneMetric::region(&[2.0, 12.0]));
    assert_eq!(segment.span(&around), 11.0);
    assert_eq!(segment.span(&PlaneMetric::region(&[2.0, 3.0])), 4.0);
    // Along of the corners: -7 at the least, 43 at the most, of 25.
    assert_eq!(segment.most_over(&around), 18.0 * 18.0);
    assert_eq!(segment.most_over(&PlaneMetric::region(&[2.0, 3.0])), 0.0);
    assert_eq!(segment.rounding(&around), 7.0 * (1.0 + 10.0) * 8.0 * f64::EPSILON);
    let before =
        PlaneMetric::join(&PlaneMetric::region(&[-9.0, -3.0]), &PlaneMetric::region(&[0.0, 1.0]));
    assert_eq!(segment.rounding(&before), 7.0 * (10.0 + 5.0) * 8.0 * f64::EPSILON);
    let back = PlaneMetric.segment(&[4.0, 6.0], &[1.0, 2.0]);
    assert_eq!(
        back.rounding(&PlaneMetric::region(&[6.0, 9.0])),
        7.0 * (2.0 + 3.0) * 8.0 * f64::EPSILON
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Distances by the nearest point, not by the formula of the metric.
    #[test]
    fn distances_are_those_to_the_nearest_place(v in prop::array::uniform9(-5_i32..5)) {
        let at = |i: usize| [0, 1, 2].map(|k| f64::from(v[3 * i + k]));
        let [p, a, b] = [at(0), at(1), at(2)];
        let nearest = |axes: usize| {
            let dot = |u: [f64; 3], w: [f64; 3]| (0..axes).map(|i| u[i] * w[i]).sum::<f64>();
            let minus = |u: [f64; 3], w: [f64; 3]| [0, 1, 2].map(|i| u[i] - w[i]);
            let (q, d) = (minus(p, a), minus(b, a));
            let length = dot(d, d);
            let part = if length > 0.0 { (dot(q, d) / length).clamp(0.0, 1.0) } else { 0.0 };
            let off = minus(q, d.map(|v| v * part));
            dot(off, off)
        };
        let flat = |p: [f64; 3]| [p[0], p[1]];
        let near = |p: f64, q: f64| (p - q).abs() <= 1e-9 * (1.0 + q);
        prop_assert!(near(SpaceMetric.distance2(&p, &a, &b), nearest(3)));
        prop_assert!(near(PlaneMetric.distance2(&flat(p), &flat(a), &flat(b)), nearest(2)));
        if a[0] != b[0] {
            let height = a[1] + (b[1] - a[1]) * (p[0] - a[0]) / (b[0] - a[0]);
            let square = (p[1] - height) * (p[1] - height);
            prop_assert!(near(VerticalMetric.distance2(&flat(p), &flat(a), &flat(b)), square));
        }
    }
}
