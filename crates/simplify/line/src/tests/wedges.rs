//! Wedges against angles and slopes.

use super::*;
use crate::wedge::{
    EllipseWedge, PlaneWedge, SlopeWedge, SpaceWedge, Wedge, WedgeStep, first_inside,
};
use std::f64::consts::{PI, TAU};

/// Remaining angles, in units of the coordinates: right and left; none for all directions.
#[derive(Default)]
struct Angles {
    left: Option<[f64; 2]>,
}

/// The equivalent angle nearest to another.
fn nearest(angle: f64, to: f64) -> f64 {
    angle - ((angle - to) / TAU).round() * TAU
}

impl Angles {
    /// Effect of a vertex at `v`, scaled by `k`, and the sides it cuts: `None` within rounding of another
    /// effect.
    fn step(&mut self, v: Xy, k: Xy, tolerance: f64) -> Option<(WedgeStep, u32)> {
        let distance = v[0].hypot(v[1]);
        if (distance - tolerance).abs() < 1e-9 {
            return None;
        }
        let in_coordinates = |angle: f64| (angle.sin() / k[1]).atan2(angle.cos() / k[0]);
        let angle = v[1].atan2(v[0]);
        let own = (distance > tolerance).then(|| {
            let half = (tolerance / distance).asin();
            let right = in_coordinates(angle - half);
            [right, right + (in_coordinates(angle + half) - right).rem_euclid(TAU)]
        });
        let Some([right, left]) = self.left else {
            self.left = own;
            return Some((WedgeStep::Ends, if own.is_some() { 3 } else { 0 }));
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let middle = (left + right) / 2.0;
        let direction = nearest(in_coordinates(angle), middle);
        // A vertex at the anchor has no direction.
        let at_side = near(direction, left) || near(direction, right) || distance < 1e-9;
        let ends = right <= direction && direction <= left;
        let Some(own) = own else {
            return (!at_side)
                .then_some((if ends { WedgeStep::Ends } else { WedgeStep::Passes }, 0));
        };
        let turn = nearest((own[0] + own[1]) / 2.0, middle) - (own[0] + own[1]) / 2.0;
        let own = own.map(|angle| angle + turn);
        let now = [right.max(own[0]), left.min(own[1])];
        let doubtful = at_side
            || near(own[0], right)
            || near(own[1], left)
            || near(now[0], now[1])
            || (own[0] + own[1] - left - right).abs() > TAU - 0.1;
        if doubtful {
            return None;
        }
        if now[0] > now[1] {
            return Some((WedgeStep::Stops, 0));
        }
        self.left = Some(now);
        let cuts = u32::from(own[1] < left) | u32::from(own[0] > right) << 1;
        Some((if ends { WedgeStep::Ends } else { WedgeStep::Passes }, cuts))
    }
}

/// Walks that mostly keep one direction, and some that do not.
fn way() -> impl Strategy<Value = Vec<Xy>> {
    (any::<u64>(), 2..40_usize, 0.0..TAU, prop_oneof![Just(0.0), Just(1.0), Just(3.0)]).prop_map(
        |(seed, count, turn, speed)| {
            let mut dice = Dice(seed);
            let mut at = [0.3, 0.7];
            let mut step = || {
                at = [
                    at[0] + speed * turn.cos() + 2.0 * dice.swing(),
                    at[1] + speed * turn.sin() + 2.0 * dice.swing(),
                ];
                at
            };
            (0..count).map(|_| step()).collect()
        },
    )
}

/// A vertex is inside where a segment may end; a segment that ends closer than another vertex leaves that
/// vertex beyond its end.
struct LooksLikeSteps;

impl Check for LooksLikeSteps {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let mut wedge = M::Wedge::new(&points[0], tolerance);
        let mut min_span2 = 0.0_f64;
        for (i, p) in points.iter().enumerate().skip(1) {
            let (before, ahead) = (wedge, &points[i..]);
            let may_end = |p: &V| before.outside(p) <= 0.0 && before.span2(p) >= min_span2;
            let found = first_inside(&before, min_span2, ahead);
            assert_eq!(found, ahead.iter().position(may_end), "from vertex {i} on");
            let step = wedge.step(p);
            if step == WedgeStep::Stops {
                break;
            }
            // Behind a wedge of one direction, so near that it passes, nothing is beside it.
            if before.outside(p) > 0.0 || wedge.span2(p) > tolerance * tolerance {
                assert_eq!(before.outside(p) <= 0.0, step == WedgeStep::Ends, "vertex {i}");
            }
            let least = wedge.min_span2(p);
            for end in ahead.iter().filter(|end| wedge.span2(end) < least) {
                assert!(metric.distance2(p, &points[0], end) > tolerance * tolerance);
            }
            min_span2 = min_span2.max(least);
        }
    }
}

/// With a radius of 5 at 13, segments end at 8 or farther, except for rounding.
#[test]
fn segments_end_no_nearer_than_what_they_pass() {
    let near = |square: f64| (square - 64.0).abs() < 1e-10 && square < 64.0;
    let wedge = PlaneWedge::new(&[1.0, 1.0], 5.0);
    assert!(near(wedge.min_span2(&[6.0, 13.0])) && wedge.min_span2(&[4.0, 4.0]) == 0.0);
    let wedge = SpaceWedge::new(&[1.0, 1.0, 1.0], 5.0);
    assert!(near(wedge.min_span2(&[4.0, 5.0, 13.0])));
    // Metres differ from vertex to vertex, and in a profile nothing is beyond an end.
    let place = |lon: f64| LocatedVertex::new([lon, 60.0]);
    assert_eq!(EllipseWedge::new(&place(0.0), 5.0).min_span2(&place(1.0)), 0.0);
    assert_eq!(SlopeWedge::new(&[0.0; 2], 5.0).min_span2(&[99.0, 0.0]), 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn looks_are_like_steps(line in way(), tolerance in 0.05..4.0) {
        LooksLikeSteps.everywhere(&line, tolerance);
    }

    #[test]
    fn looks_are_like_steps_on_short_lines(line in short_line(), tolerance in tolerance()) {
        if !line.is_empty() {
            LooksLikeSteps.everywhere(&line, tolerance);
        }
    }

    #[test]
    fn a_wedge_has_the_angles_that_pass_all(line in way(), tolerance in 0.05..4.0) {
        let mut wedge = PlaneWedge::new(&line[0], tolerance);
        let mut angles = Angles::default();
        for p in &line[1..] {
            let v = [p[0] - line[0][0], p[1] - line[0][1]];
            prop_assert_eq!(wedge.span2(p), v[0] * v[0] + v[1] * v[1]);
            let Some((step, cuts)) = angles.step(v, [1.0; 2], tolerance) else { break };
            prop_assert_eq!(wedge.step(p), step);
            if step == WedgeStep::Stops {
                break;
            }
            prop_assert_eq!(wedge.cuts(), cuts);
        }
    }

    /// Each vertex with a separate scale, or none along x, as at a pole.
    #[test]
    fn a_wedge_on_the_ellipsoid_has_them_too(line in way(), tolerance in 0.05..4.0, seed: u64) {
        let mut dice = Dice(seed);
        let mut scale = || [0.5 + dice.below(100) as f64 * 0.01, 0.5 + dice.below(100) as f64 * 0.01];
        let line: Vec<LocatedVertex> = line.iter().map(|at| LocatedVertex { at: *at, scale: scale() }).collect();
        let mut wedge = EllipseWedge::new(&line[0], tolerance);
        let mut angles = Angles::default();
        for p in &line[1..] {
            let mut pole = *p;
            pole.scale[0] = 0.0;
            prop_assert_eq!(wedge.step(&pole), WedgeStep::Ends);
            let v = [0, 1].map(|i| (p.at[i] - line[0].at[i]) * p.scale[i]);
            prop_assert_eq!(wedge.span2(p), v[0] * v[0] + v[1] * v[1]);
            let Some((step, cuts)) = angles.step(v, p.scale, tolerance) else { break };
            prop_assert_eq!(wedge.step(p), step);
            if step == WedgeStep::Stops {
                break;
            }
            prop_assert_eq!(wedge.cuts(), cuts);
        }
    }

    #[test]
    fn a_wedge_in_space_is_three(line in way(), tolerance in 0.05..4.0) {
        let line: Vec<[f64; 3]> = line.iter().map(|p| [p[0], p[1], 2.0 * p[0] - 0.5 * p[1] % 3.0]).collect();
        let image = |p: &[f64; 3], k: usize| [p[k], p[(k + 1) % 3]];
        let mut wedge = SpaceWedge::new(&line[0], tolerance);
        let mut images = [0, 1, 2].map(|k| PlaneWedge::new(&image(&line[0], k), tolerance));
        for p in &line[1..] {
            let steps = [0, 1, 2].map(|k| images[k].step(&image(p, k)));
            let want = match steps {
                _ if steps.contains(&WedgeStep::Stops) => WedgeStep::Stops,
                [WedgeStep::Ends, WedgeStep::Ends, WedgeStep::Ends] => WedgeStep::Ends,
                _ => WedgeStep::Passes,
            };
            prop_assert_eq!(wedge.step(p), want);
            let squares = [0, 1, 2].map(|i| (p[i] - line[0][i]).powi(2));
            prop_assert!((wedge.span2(p) - squares.iter().sum::<f64>()).abs() < 1e-9);
            if want == WedgeStep::Stops {
                break;
            }
            let cuts = (0..3).map(|k| images[k].cuts() << (2 * k)).sum::<u32>();
            prop_assert_eq!(wedge.cuts(), cuts);
        }
    }

    #[test]
    fn a_wedge_of_slopes_has_those_that_pass_all(line in way(), tolerance in 0.05..4.0, falls: bool) {
        let way = if falls { -1.0 } else { 1.0 };
        let line: Vec<Xy> = profile(&line).iter().map(|p| [p[0] * way, p[1]]).collect();
        let mut wedge = SlopeWedge::new(&line[0], tolerance);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for p in &line[1..] {
            let (x, y) = (p[0] - line[0][0], p[1] - line[0][1]);
            let [mut least, mut most] = [(y - tolerance) / x, (y + tolerance) / x];
            if least > most {
                (least, most) = (most, least);
            }
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            let (bottom, top) = (low.max(least), high.min(most));
            if [near(y / x, low), near(y / x, high), near(bottom, top)].contains(&true) {
                break;
            }
            let want = match low <= y / x && y / x <= high {
                true => WedgeStep::Ends,
                false if bottom > top => WedgeStep::Stops,
                false => WedgeStep::Passes,
            };
            prop_assert_eq!(wedge.step(p), want);
            prop_assert_eq!(wedge.span2(p), 0.0);
            if want == WedgeStep::Stops || near(least, low) || near(most, high) {
                break;
            }
            prop_assert_eq!(wedge.cuts(), u32::from(least > low) | u32::from(most < high) << 1);
            (low, high) = (bottom, top);
        }
    }
}

#[test]
fn vertices_behind_the_anchor_leave_nothing_or_all() {
    let mut wedge = PlaneWedge::new(&[0.0, 0.0], 1.0);
    assert_eq!(wedge.step(&[10.0, 0.0]), WedgeStep::Ends);
    assert_eq!(wedge.step(&[-0.5, 0.0]), WedgeStep::Passes, "its disc holds the anchor");
    assert_eq!(wedge.step(&[-10.0, 0.0]), WedgeStep::Stops);
    // Wider than a quarter turn: the discs touch the anchor, nearly.
    let mut wide = PlaneWedge::new(&[0.0, 0.0], 1.0);
    assert_eq!(wide.step(&[1.01, 0.0]), WedgeStep::Ends);
    assert_eq!(wide.step(&[-0.1, 1.1]), WedgeStep::Passes);
    assert_eq!((wide.cuts(), wide.step(&[0.5, 3.0])), (2, WedgeStep::Ends));
    assert_eq!(wide.step(&[3.0 * (PI / 3.0).cos(), -3.0 * (PI / 3.0).sin()]), WedgeStep::Stops);
}

#[test]
fn without_a_tolerance_one_direction_is_left() {
    let mut wedge = PlaneWedge::new(&[1.0, 1.0], 0.0);
    let steps =
        [[1.0, 1.0], [2.0, 2.0], [1.0, 1.0], [5.0, 5.0]].map(|p| (wedge.step(&p), wedge.cuts()));
    assert_eq!(steps, [0, 1, 0, 0].map(|cuts| (WedgeStep::Ends, cuts)));
    assert_eq!(wedge.step(&[0.0, 0.0]), WedgeStep::Stops);
    assert_eq!(wedge.step(&[3.0, 4.0]), WedgeStep::Stops);
}

/// Where rounding exceeds the tolerance, the first vertex outside ends the wedge.
#[test]
fn tolerances_below_rounding_end_at_the_first_vertex_outside() {
    let mut wedge = PlaneWedge::new(&[0.0, 0.0], 1e-16);
    assert_eq!(wedge.step(&[1.0, 1.0]), WedgeStep::Ends);
    assert_eq!(wedge.step(&[2.0, 2.0 + 6e-13]), WedgeStep::Stops);
    let mut slopes = SlopeWedge::new(&[0.0, 0.0], 1e-16);
    assert_eq!(slopes.step(&[1.0, 1.0]), WedgeStep::Ends);
    assert_eq!(slopes.step(&[2.0, 2.0 + 6e-13]), WedgeStep::Stops);
}

/// Whatever the rounding of slopes, collinear vertices end segments.
#[test]
fn slopes_of_one_line_are_one() {
    for (x, y) in [(3.0, 1.0), (7.0, -3.0), (0.1, 0.7), (11.0, 1e6)] {
        let mut wedge = SlopeWedge::new(&[0.0, 0.0], 0.0);
        for k in 1..300 {
            assert_eq!(wedge.step(&[x * f64::from(k), y * f64::from(k)]), WedgeStep::Ends, "{k}");
        }
        assert_eq!(wedge.step(&[x * 300.0, y * 301.0]), WedgeStep::Stops);
    }
}
