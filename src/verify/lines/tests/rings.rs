//! Rings that come to their vertices repeatedly, given either way round and from any start.

use proptest::prelude::*;

use super::*;

/// A ring on a lattice so small that its vertices repeat, some of its vertices, and a start.
fn rings() -> impl Strategy<Value = (Part, Part, usize)> {
    let ring = (proptest::collection::vec([0..4, 0..4], 3..14), any::<u16>(), 0..14usize);
    ring.prop_map(|(ring, kept, start)| {
        let mut after: Part =
            (0..).zip(&ring).filter(|(i, _)| kept >> i & 1 == 1).map(|(_, p)| *p).collect();
        if after.len() < 3 {
            after.clone_from(&ring);
        }
        (ring, after, start)
    })
}

fn closed(ring: &[[i32; 2]]) -> Part {
    ring.iter().chain(ring.first()).copied().collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn the_way_round_and_the_start_leave_no_trace((ring, after, start) in rings()) {
        let told = |after: &[[i32; 2]]| {
            let found = report(&[closed(&ring)], &[closed(after)], &[], 1e9);
            (found.foreign.count, found.turned.count, found.collapsed.count)
        };
        let mut rotated = after.clone();
        rotated.rotate_left(start % after.len());
        let backward: Part = rotated.iter().rev().copied().collect();
        let as_made = told(&after);
        prop_assert_eq!(as_made.0, 0, "made from other vertices");
        prop_assert_eq!(told(&rotated), as_made);
        prop_assert_eq!(told(&backward), as_made);
        // Nothing left out is nothing turned over.
        let whole: Part = ring.iter().rev().copied().collect();
        prop_assert_eq!(told(&whole), (0, 0, 0));
    }

    #[test]
    fn heights_go_with_their_vertices((ring, after, start) in rings(), at in 0..14usize) {
        let heights = |ring: &[[i32; 2]]| -> Vec<[f64; 2]> {
            ring.iter().map(|p| [f64::from(p[0] * 4 + p[1]), f64::NAN]).collect()
        };
        let points = |ring: &[[i32; 2]]| -> Vec<[f64; 3]> {
            ring.iter().map(|p| [f64::from(p[0]), f64::from(p[1]), 0.0]).collect()
        };
        let mut rotated = after;
        let count = rotated.len();
        rotated.rotate_left(start % count);
        rotated.reverse();
        let (before, after) = (closed(&ring), closed(&rotated));
        let mut extras = [heights(&before), heights(&after)];
        let told = |extras: &[Vec<[f64; 2]>; 2]| {
            let [old, new] = [points(&before), points(&after)];
            let old = Vertices { points: &old, extras: &extras[0], outer: &[] };
            let new = Vertices { points: &new, extras: &extras[1], outer: &[] };
            let comparison = Comparison { distance: Distance::Plane, tolerance: None, drops: Drops::None };
            let (mut found, mut pieces) = (Report::default(), Pieces::new(Band::ALL));
            comparison.part(0, old, new, true, &mut found, &mut pieces);
            (found.foreign.count, found.changed.count)
        };
        prop_assert_eq!(told(&extras), (0, 0));
        extras[1][at % count][0] += 0.5;
        prop_assert!(told(&extras).1 > 0, "a height that no vertex there has");
    }
}
