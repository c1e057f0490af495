//! Closed rings.

use super::*;
use crate::cone::cone;
use crate::imai_iri::imai_iri;
use crate::rdp::rdp;
use crate::ring::{RingFate, simplify, visvalingam};
use crate::visvalingam::AreaWeight;

/// The line as a closed ring.
fn closed(mut line: Vec<Xy>) -> Vec<Xy> {
    line.extend(line.first().copied());
    line
}

/// Vertices of a ring kept by a method.
fn kept_of(name: &str, ring: &[Xy], tolerance: f64) -> (RingFate, Vec<u32>) {
    let method = match name {
        "rdp" => rdp,
        "cone" => cone,
        _ => imai_iri,
    };
    let mut kept = Vec::new();
    let run = |line: &[Xy], scratch: &mut SimplifyScratch, kept: &mut Vec<u32>| {
        method(&PlaneMetric, line, tolerance, scratch, kept);
    };
    let can_move = name != "rdp";
    let mut scratch = SimplifyScratch::default();
    let fate = simplify(&PlaneMetric, ring, tolerance, can_move, run, &mut scratch, &mut kept);
    (fate, kept)
}

/// All vertices, including those around the closing one, are within the tolerance.
fn assert_ring_holds(ring: &[Xy], tolerance: f64, kept: &[u32]) {
    let count = ring.len() - 1;
    assert!(kept.is_sorted_by(|a, b| a < b) && kept.iter().all(|i| (*i as usize) < count));
    let first = *kept.first().expect("a ring keeps a vertex") as usize;
    let line: Vec<Xy> = (0..=count).map(|i| ring[(first + i) % count]).collect();
    let mut turned: Vec<u32> = kept.iter().map(|i| i - first as u32).collect();
    turned.push(count as u32);
    assert_holds(&PlaneMetric, &line, tolerance, &turned);
}

/// A star-shaped ring of distinct vertices.
fn star(seed: u64, count: usize) -> Vec<Xy> {
    let mut dice = Dice(seed);
    let turn = |i: usize| i as f64 * std::f64::consts::TAU / count as f64;
    let at = |(radius, turn): (f64, f64)| [radius * turn.cos(), radius * turn.sin()];
    (0..count).map(|i| at((10.0 + dice.swing(), turn(i)))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn rings_hold(line in short_line(), tolerance in tolerance()) {
        let ring = closed(line);
        prop_assume!(ring.len() > 3);
        for name in ["rdp", "cone", "imai-iri"] {
            let (fate, kept) = kept_of(name, &ring, tolerance);
            assert_ring_holds(&ring, tolerance, &kept);
            prop_assert!(fate == RingFate::Collapsed || kept.len() >= 3);
        }
    }

    #[test]
    fn rdp_does_not_care_where_a_ring_is_cut(seed: u64, turn in 0..90_usize, tolerance in 0.0..2.0) {
        let ring = star(seed, 90);
        let mut turned = ring.clone();
        turned.rotate_left(turn);
        let place = |i: &u32| (*i as usize + turn) % 90;
        let (_, kept) = kept_of("rdp", &closed(ring), tolerance);
        let (_, again) = kept_of("rdp", &closed(turned), tolerance);
        let mut again: Vec<u32> = again.iter().map(|i| place(i) as u32).collect();
        again.sort_unstable();
        prop_assert_eq!(kept, again);
    }

    #[test]
    fn rings_have_at_most_one_vertex_more_than_from_the_best_start(
        seed: u64, tolerance in 0.2..1.5
    ) {
        let ring = star(seed, 90);
        let through = |start: usize| {
            let mut turned = ring.clone();
            turned.rotate_left(start);
            run(imai_iri, &PlaneMetric, &closed(turned), tolerance).len() - 1
        };
        let best = (0..90).map(through).min();
        let (_, kept) = kept_of("imai-iri", &closed(ring), tolerance);
        prop_assert!(best.is_some_and(|best| kept.len() <= best.max(3) + 1));
    }
}

#[test]
fn a_vertex_on_the_side_of_a_square_is_dropped_wherever_the_ring_is_cut() {
    let square = [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0]];
    for turn in 0..6 {
        let mut ring = square.to_vec();
        ring.rotate_left(turn);
        for name in ["rdp", "cone", "imai-iri"] {
            let (fate, kept) = kept_of(name, &closed(ring.clone()), 0.0);
            assert_eq!((fate, kept.len()), (RingFate::Kept, 4), "{name} from {turn}");
        }
    }
}

#[test]
fn a_ring_smaller_than_the_tolerance_collapses_to_a_triangle() {
    let ring = closed(star(8, 30));
    for name in ["rdp", "cone", "imai-iri"] {
        let (fate, kept) = kept_of(name, &ring, 100.0);
        assert_eq!((fate, kept.len()), (RingFate::Collapsed, 3), "{name}");
    }
    let (fate, kept) = kept_of("cone", &[[1.0, 1.0]; 6], 1.0);
    assert_eq!((fate, kept.len()), (RingFate::Collapsed, 1));
}

#[test]
fn triangles_on_rings() {
    let ring = closed(star(9, 30));
    let fate = |area: f64| {
        let mut kept = Vec::new();
        let fate = visvalingam(&PlaneMetric, &ring, area, AreaWeight::Plain, &mut kept);
        (fate, kept.len())
    };
    assert_eq!(fate(1e9), (RingFate::Collapsed, 3));
    assert_eq!(fate(0.0), (RingFate::Kept, 30));
    assert_eq!(fate(1e-3).0, RingFate::Kept);
}

#[test]
fn a_triangle_is_kept_and_less_is_none() {
    let ring = closed(vec![[0.0, 0.0], [4.0, 1.0], [1.0, 3.0]]);
    for name in ["rdp", "cone", "imai-iri"] {
        assert_eq!(kept_of(name, &ring, 0.5), (RingFate::Kept, vec![0, 1, 2]), "{name}");
        assert_eq!(kept_of(name, &ring[1..], 0.5), (RingFate::Collapsed, vec![0, 1]), "{name}");
        assert_eq!(kept_of(name, &ring[..1], 0.5), (RingFate::Collapsed, vec![]), "{name}");
    }
    let dissolved = |ring: &[Xy], area: f64| {
        let mut kept = vec![9];
        (visvalingam(&PlaneMetric, ring, area, AreaWeight::Plain, &mut kept), kept)
    };
    // Its area is 5.5.
    assert_eq!(dissolved(&ring, 5.4), (RingFate::Kept, vec![9, 0, 1, 2]));
    assert_eq!(dissolved(&ring, 5.5), (RingFate::Collapsed, vec![9, 0, 1, 2]));
    assert_eq!(dissolved(&ring[1..], 0.0), (RingFate::Collapsed, vec![9, 0, 1]));
    assert_eq!(dissolved(&ring[2..], 0.0), (RingFate::Collapsed, vec![9, 0]));
    assert_eq!(dissolved(&[], 0.0), (RingFate::Collapsed, vec![9]));
}

/// The start, the vertex farthest from it, the vertex farthest from both, and vertices beyond the tolerance of
/// these three.
#[test]
fn a_collapsed_ring_is_given_by_its_widest_corners() {
    let long = vec![[0.0, 0.0], [5.0, -0.5], [10.0, 0.0], [7.0, 2.0], [3.0, 1.0]];
    for turn in 0..5 {
        let mut ring = long.clone();
        ring.rotate_left(turn);
        let back = |i: u32| (i + turn as u32) % 5;
        let (fate, kept) = kept_of("rdp", &closed(ring), 9.0);
        let mut kept: Vec<u32> = kept.into_iter().map(back).collect();
        kept.sort_unstable();
        assert_eq!((fate, kept), (RingFate::Collapsed, vec![0, 2, 3]));
    }
    // The other side is wider.
    let (fate, kept) = kept_of(
        "rdp",
        &closed(vec![[0.0, 0.0], [5.0, -2.5], [10.0, 0.0], [7.0, 2.0], [3.0, 1.0]]),
        9.0,
    );
    assert_eq!((fate, kept), (RingFate::Collapsed, vec![0, 1, 2]));
}

/// Far from the start a ring equals the line from there.
#[test]
fn rings_are_done_again_around_their_start_alone() {
    for name in ["cone", "imai-iri"] {
        let ring = star(12, 600);
        let start = (0..600).min_by(|a, b| ring[*a].partial_cmp(&ring[*b]).unwrap()).unwrap();
        let (_, kept) = kept_of(name, &closed(ring.clone()), 0.3);
        let mut own: Vec<u32> = kept.iter().map(|i| (i + 600 - start as u32) % 600).collect();
        own.sort_unstable();
        let mut line = ring;
        line.rotate_left(start);
        let line = closed(line);
        let chosen = if name == "cone" {
            run(cone, &PlaneMetric, &line, 0.3)
        } else {
            run(imai_iri, &PlaneMetric, &line, 0.3)
        };
        let far = &chosen[64..chosen.len() - 64];
        assert!(far.len() > 64, "{name}: {}", chosen.len());
        let first = own.iter().position(|i| *i == far[0]).expect("far from the start");
        assert_eq!(own[first..first + far.len()], *far, "{name}");
    }
}

/// The first of the vertices at the lowest position is the start.
#[test]
fn rings_start_with_the_first_of_the_lowest() {
    let ring = vec![[4.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 3.0]];
    for name in ["rdp", "cone", "imai-iri"] {
        assert_eq!(
            kept_of(name, &closed(ring.clone()), 0.5),
            (RingFate::Kept, vec![0, 1, 4]),
            "{name}"
        );
    }
}

/// Nothing lies beside one path to the farthest vertex, and little beside the other.
#[test]
fn a_flat_collapsed_ring_has_its_one_corner() {
    for near in [[5.0, 0.5], [5.0, -0.5]] {
        for turn in 0..2 {
            let mut ring = vec![[0.0, 0.0], [10.0, 0.0], near];
            ring.swap(1, 1 + turn);
            assert_eq!(kept_of("rdp", &closed(ring), 9.0), (RingFate::Collapsed, vec![0, 1, 2]));
        }
    }
}

/// The start of a triangle lies within the tolerance of the opposite side, and is kept.
#[test]
fn no_corner_of_a_triangle_is_moved() {
    let ring = closed(vec![[0.0, 0.0], [0.5, 10.0], [0.5, -10.0]]);
    for name in ["cone", "imai-iri"] {
        assert_eq!(kept_of(name, &ring, 1.0), (RingFate::Kept, vec![0, 1, 2]), "{name}");
    }
}
