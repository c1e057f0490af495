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

/// A ring on two to nine positions, with any number of repeats and ways back, what is kept of it, and a
/// start.
fn tangles() -> impl Strategy<Value = (Part, Vec<bool>, usize)> {
    (0..3, 0..3).prop_flat_map(|(across, down)| {
        let ring = proptest::collection::vec([0..=across + 1, 0..=down], 3..60);
        let back = proptest::collection::vec(any::<bool>(), 60);
        let kept = proptest::collection::vec(proptest::bool::weighted(0.7), 120);
        (ring, back, kept, 0..120usize).prop_map(|(ring, back, kept, start)| {
            // There and back at some of the vertices.
            let spurs = ring.iter().enumerate().flat_map(|(at, p)| match back[at] && at > 0 {
                true => vec![*p, ring[at - 1], *p],
                false => vec![*p],
            });
            let mut ring: Part = spurs.collect();
            ring.truncate(120);
            (ring, kept, start)
        })
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
            let old = PartVertices { points: &old, extras: &extras[0], outer: &[] };
            let new = PartVertices { points: &new, extras: &extras[1], outer: &[] };
            let comparison = PartComparison { distance: ProofDistance::Plane, tolerance: None, drops: DroppedParts::None };
            let (mut found, mut pieces) = (LineCheckReport::default(), LineProofPieces::new(XRange::ALL));
            comparison.part(0, old, new, true, &mut found, &mut pieces);
            (found.foreign.count, found.changed.count)
        };
        prop_assert_eq!(told(&extras), (0, 0));
        extras[1][at % count][0] += 0.5;
        prop_assert!(told(&extras).1 > 0, "a height that no vertex there has");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn a_ring_is_itself_from_any_start_and_either_way_round((ring, _, start) in tangles()) {
        let others = [vec![[0, 0], [2, 1], [5, 6]], square(-3, -3, 2), closed(&ring)];
        let mut turned = ring.clone();
        turned.rotate_left(start % ring.len());
        let backward: Part = turned.iter().rev().copied().collect();
        for after in [&ring, &turned, &backward] {
            let [before, after] = [&ring, after].map(|own| {
                let mut all = others.to_vec();
                all.insert(1, closed(own));
                all
            });
            let found = report(&before, &after, &[[0.5, 0.5]], 0.0);
            prop_assert!(found.is_sound(), "{:?}", found);
            prop_assert_eq!(found.crossings, found.original_crossings);
        }
    }

    #[test]
    fn what_keeps_the_tolerance_passes_either_way_round((ring, kept, start) in tangles()) {
        let is_kept = |at: usize| kept[at] || at == 0;
        let left: Vec<usize> = (0..ring.len()).filter(|&at| is_kept(at)).collect();
        let after: Part = left.iter().map(|&at| ring[at]).collect();
        // How far what was left out is off the segments in its place.
        let at = |i: usize| {
            let p = ring[i % ring.len()];
            [f64::from(p[0]), f64::from(p[1]), 0.0]
        };
        let ends = left.iter().zip(left.iter().skip(1).copied().chain([ring.len()]));
        let off = |(&from, to): (&usize, usize)| {
            (from..to).map(move |i| ProofDistance::Plane.of(at(i), at(from), at(to))).fold(0.0, f64::max)
        };
        let most = ends.map(off).fold(0.0, f64::max);
        let mut turned = after.clone();
        turned.rotate_left(start % after.len());
        let backward: Part = turned.iter().rev().copied().collect();
        for after in [&after, &turned, &backward] {
            let found = report(&[closed(&ring)], &[closed(after)], &[], most);
            prop_assert_eq!((found.foreign.count, found.beyond.count), (0, 0), "{} {:?}", most, found);
        }
    }
}
