//! Scans and trees of regions against plain searches.

use super::*;
use crate::regions::{FarthestVertex, VertexRegions, first_above, last_above, scan};

struct SameAsPlain;

impl Check for SameAsPlain {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], _: f64) {
        let count = points.len();
        if count < 4 {
            return;
        }
        let tree = VertexRegions::new::<V, M>(points);
        for (from, to) in [(0, count - 1), (1, count), (count / 3, count - count / 4)] {
            let segment = metric.segment(&points[from], &points[count / 2]);
            let reach = |i: usize| M::reach(&segment, &points[i]);
            let most = (from..to).map(reach).fold(0.0, f64::max);
            for limit in [0.0, reach(from), reach((from + to) / 2), reach(to - 1), most] {
                let first = first_above::<V, M>(&segment, points, from, to, limit);
                assert_eq!(first, (from..to).find(|i| reach(*i) > limit));
                let last = last_above::<V, M>(&segment, points, from, to, limit);
                assert_eq!(last, (from..to).rev().find(|i| reach(*i) > limit));
                let known = FarthestVertex { index: count, reach: limit };
                let plain = (from..to).fold(known, |best, i| match reach(i) > best.reach {
                    true => FarthestVertex { index: i, reach: reach(i) },
                    false => best,
                });
                let (mut scanned, mut found) = (known, known);
                scan::<V, M>(&segment, points, from, to, &mut scanned);
                tree.farthest::<V, M>(&segment, points, from, to, &mut found);
                assert_eq!((scanned.index, scanned.reach), (plain.index, plain.reach));
                assert_eq!((found.index, found.reach), (plain.index, plain.reach));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn scans_find_what_plain_searches_find(short in short_line(), long in long_line()) {
        SameAsPlain.everywhere(&short, 0.0);
        SameAsPlain.everywhere(&long, 0.0);
    }
}

/// One spike in a flat line: few regions have to be tested to find it.
#[test]
fn trees_pass_over_what_is_near() {
    let mut line: Vec<Xy> = (0..40_000).map(|i| [f64::from(i), f64::from(i % 7)]).collect();
    line[23_456][1] = 100.0;
    let tree = VertexRegions::new::<Xy, PlaneMetric>(&line);
    let segment = PlaneMetric.segment(&line[0], &line[39_999]);
    let looks = |from: usize, to: usize| {
        let mut farthest = FarthestVertex { index: from, reach: 0.0 };
        let looks = tree.farthest::<Xy, PlaneMetric>(&segment, &line, from, to, &mut farthest);
        assert_eq!(farthest.index, 23_456);
        // None: all vertices were looked at.
        assert!(looks > 0);
        looks
    };
    assert!(looks(1, 39_999) < 60, "{}", looks(1, 39_999));
    assert!(looks(23_001, 23_999) < 30, "{}", looks(23_001, 23_999));
    // Short ranges skip the first search for a distant vertex.
    assert!(looks(23_201, 23_501) < 20, "{}", looks(23_201, 23_501));
}
