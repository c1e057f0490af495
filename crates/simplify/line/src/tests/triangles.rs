//! Visvalingam-Whyatt against an exhaustive search.

use super::*;
use crate::visvalingam::{AreaWeight, EffectiveAreas, visvalingam};

/// Effective areas by exhaustive search at each step.
fn plain_areas(line: &[Xy], is_ring: bool, weight: AreaWeight) -> Vec<f64> {
    let mut areas = vec![f64::INFINITY; line.len()];
    let mut left: Vec<usize> = (0..line.len()).collect();
    let mut most = 0.0_f64;
    while left.len() > if is_ring { 3 } else { 2 } {
        let n = left.len();
        let area = |k: usize| {
            let [a, b, c] = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]].map(|i| &line[i]);
            let cosine = PlaneMetric.cosine(a, b, c);
            PlaneMetric.area(a, b, c)
                * if weight == AreaWeight::Angle { 1.0 - 0.7 * cosine } else { 1.0 }
        };
        let inner = if is_ring { 0..n } else { 1..n - 1 };
        let least = inner.min_by(|a, b| area(*a).total_cmp(&area(*b))).expect("not empty");
        most = most.max(area(least));
        areas[left.remove(least)] = most;
    }
    areas
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn areas_are_those_of_a_plain_search(line in short_line(), angle: bool) {
        let weight = if angle { AreaWeight::Angle } else { AreaWeight::Plain };
        let areas = EffectiveAreas::of_line(&PlaneMetric, &line, weight);
        prop_assert_eq!(areas.areas(), plain_areas(&line, false, weight));
        let ring = EffectiveAreas::of_ring(&PlaneMetric, &line, weight);
        prop_assert_eq!(ring.areas(), plain_areas(&line, true, weight));
    }

    #[test]
    fn counts_and_thresholds_agree(line in short_line(), count in 0..30_usize) {
        let areas = EffectiveAreas::of_line(&PlaneMetric, &line, AreaWeight::Plain);
        let mut kept = Vec::new();
        areas.keep_count(count, &mut kept);
        prop_assert_eq!(kept.len(), count.max(2).min(line.len()));
        let least = kept.iter().map(|i| areas.areas()[*i as usize]).fold(f64::INFINITY, f64::min);
        prop_assert_eq!(
            areas.areas().iter().zip(0..).filter(|(area, i)| **area > least && !kept.contains(i)).count(),
            0
        );
    }
}

#[test]
fn longer_walks_too() {
    for is_lattice in [true, false] {
        let line = walk(3, 400, is_lattice);
        let areas = EffectiveAreas::of_line(&PlaneMetric, &line, AreaWeight::Plain);
        assert_eq!(areas.areas(), plain_areas(&line, false, AreaWeight::Plain));
        let kept = run(visvalingam, &PlaneMetric, &line, 1.5);
        assert!(kept.iter().all(|i| areas.areas()[*i as usize] > 1.5));
        assert_eq!(kept.len(), areas.areas().iter().filter(|area| **area > 1.5).count());
    }
}

/// Enough entries for buckets, each with stale ones: triangles of all sizes, and many of equal size.
#[test]
fn lines_of_many_buckets_too() {
    for is_lattice in [true, false] {
        let mut line = walk(4, 3000, is_lattice);
        line.iter_mut().zip(0..).for_each(|(p, i)| p[1] *= f64::from(1 << (i / 100)) / 1024.0);
        for weight in [AreaWeight::Plain, AreaWeight::Angle] {
            let areas = EffectiveAreas::of_line(&PlaneMetric, &line, weight);
            assert_eq!(areas.areas(), plain_areas(&line, false, weight));
            let ring = EffectiveAreas::of_ring(&PlaneMetric, &line, weight);
            assert_eq!(ring.areas(), plain_areas(&line, true, weight));
        }
    }
}

#[test]
fn a_right_angle_has_its_own_area_and_a_spike_less() {
    assert_eq!(PlaneMetric.cosine(&[1.0, 0.0], &[0.0, 0.0], &[0.0, 5.0]), 0.0);
    let spike = [[0.0, 0.0], [3.0, 1.0], [0.0, 2.0]];
    let weighted = EffectiveAreas::of_line(&PlaneMetric, &spike, AreaWeight::Angle);
    // The cosine of the angle at (3, 1) is 8 / 10.
    assert!((weighted.areas()[1] - 3.0 * (1.0 - 0.7 * 0.8)).abs() < 1e-12);
}
