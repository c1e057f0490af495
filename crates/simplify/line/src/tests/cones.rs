//! The cone against the greedy rule.

use super::*;
use crate::cone::cone;

/// From each anchor the last valid segment end, or one an eighth before it whose next segment goes further, by
/// exhaustive search.
fn greedy<V: Copy, M: DistanceMetric<V>>(metric: &M, points: &[V], tolerance: f64) -> Vec<u32> {
    let holds = |from: usize, to: usize| {
        let square = |i: usize| metric.distance2(&points[i], &points[from], &points[to]);
        (from + 1..to).all(|i| square(i) <= tolerance * tolerance)
    };
    let end = points.len().saturating_sub(1);
    let last = |from: usize, most: usize| (from + 1..=most).rev().find(|to| holds(from, *to));
    let furthest = |from: usize| last(from, end).unwrap_or(end);
    let mut kept: Vec<_> = (0..points.len()).take(1).collect();
    while let Some(&anchor) = kept.last().filter(|last| **last < end) {
        let far = furthest(anchor);
        let near = last(anchor, far - (far - anchor).div_ceil(8));
        let is_better = |near: usize| furthest(far) < end && furthest(near) > furthest(far);
        kept.push(near.filter(|&near| is_better(near)).unwrap_or(far));
    }
    kept.into_iter().map(|at| at as u32).collect()
}

struct SameAsGreedy;

impl Check for SameAsGreedy {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        assert_eq!(run(cone, metric, points, tolerance), greedy(metric, points, tolerance));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Short lines, so that all segment ends are tested.
    #[test]
    fn short_segments_go_as_far_as_any(line in short_line(), tolerance in tolerance()) {
        let line = &line[..line.len().min(10)];
        // Below that, rounding affects wedges and distances differently.
        SameAsGreedy.everywhere(line, tolerance.max(1e-3));
        if line.iter().flatten().all(|v| v.fract() == 0.0) {
            SameAsGreedy.check(&PlaneMetric, line, 0.0);
            SameAsGreedy.check(&SpaceMetric, &in_space(line), 0.0);
            SameAsGreedy.check(&VerticalMetric, &profile(line), 0.0);
        }
    }
}

/// Up and down, this many vertices each way, within 0.25 of the path.
fn roof(count: u32) -> Vec<Xy> {
    let vertex = |i: u32| {
        let off = f64::from(i % 3) * 0.1;
        let (x, height) = (f64::from(i), if i <= count { i } else { 2 * count - i });
        [x + off, f64::from(height) + off]
    };
    (0..=2 * count).map(vertex).collect()
}

#[test]
fn long_straight_segments_are_found_whole() {
    for count in [300, 3000, 30_000] {
        let kept = run(cone, &PlaneMetric, &roof(count), 0.5);
        assert!(kept.len() <= 4, "{count}: {kept:?}");
    }
}

/// The farthest vertex is close enough to all ends, but another one is not: of many ends only the first is
/// valid, however many are tested before it.
#[test]
fn of_many_ends_only_the_first_holds() {
    for count in 1..60 {
        let mut line = vec![[0.0, 0.0], [10.0, 0.95], [10.2, -0.6]];
        line.extend((0..count).map(|i| [9.6 - 1e-3 * f64::from(i), 0.0]));
        let kept = run(cone, &PlaneMetric, &line, 1.0);
        assert_eq!(kept[..2], [0, 1], "{count}");
        assert_holds(&PlaneMetric, &line, 1.0, &kept);
    }
}

/// No direction is ever rejected here, and hardly any segment is valid: an unlimited look-ahead would take
/// minutes.
#[test]
fn running_back_and_forth_takes_no_long_looks() {
    let count = 300_000;
    let x = |i: u32| f64::from(count - i) * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let line: Vec<Xy> = (0..count).map(|i| [x(i), 0.0]).collect();
    assert!(run(cone, &PlaneMetric, &line, 1.0).len() > line.len() - 10);
}

/// Vertices that turn back before the farthest are not ends, and none of them is tested: otherwise no tests
/// would be left for the farthest.
#[test]
fn ends_that_leave_the_farthest_behind_are_not_tried() {
    for back in [5, 20, 60] {
        let there = (0..=10).map(|i| [f64::from(i), 0.0]);
        let line: Vec<Xy> =
            there.chain((0..back).map(|i| [8.0 - 1e-3 * f64::from(i), 0.0])).collect();
        assert_eq!(run(cone, &PlaneMetric, &line, 1.0), [0, 10, 10 + back as u32], "{back}");
    }
}

/// After a way there and back, so many vertices along the level: segments from the third vertex may end
/// at the fourth and at those named, counted from the third, and the last of these is followed by a peak.
fn level(ends: &[u32]) -> Vec<Xy> {
    let last = ends.last().expect("one end at least") + 1;
    let height = |i: u32| match i {
        0 => 0.0,
        1 => 0.999,
        i if i == last => 500.0,
        i if ends.contains(&i) => 0.0,
        // Outside the remaining directions, and close enough to them.
        _ => -0.9,
    };
    let way = [[0.0, 0.0], [500.0, 0.0]].into_iter();
    way.chain((0..=last).map(|i| [f64::from(i), height(i)])).collect()
}

/// 64 vertices, and four times the length of a segment that holds: the first that ends after 32, and then
/// one that is half as long again as that before it.
#[test]
fn a_segment_is_looked_for_a_few_lengths_ahead() {
    for (ends, found) in [
        (&[64][..], 64),
        (&[65], 1),
        (&[31, 65], 31),
        (&[32, 128], 128),
        (&[32, 129], 32),
        (&[32, 47, 129], 47),
        (&[32, 48, 192], 192),
        (&[32, 48, 193], 48),
        (&[32, 48, 71, 193], 71),
        (&[32, 48, 72, 193], 193),
    ] {
        let line = level(ends);
        let kept = run(cone, &PlaneMetric, &line, 1.0);
        assert_eq!(kept[..4], [0, 1, 2, 2 + found], "{ends:?}");
        assert_holds(&PlaneMetric, &line, 1.0, &kept);
    }
}
