//! Hierarchies against direct runs, and their encoding.

use super::*;
use crate::Hierarchy;
use crate::rdp::rdp;
use terrane_base::error::ErrorKind;

struct SameAsDirect;

impl Check for SameAsDirect {
    fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let mut kept = Vec::new();
        let hierarchy = Hierarchy::new(metric, points);
        hierarchy.filter(tolerance, &mut kept);
        assert_eq!(hierarchy.vertices_at(tolerance), kept.len());
        assert_eq!(kept, run(rdp, metric, points, tolerance));
    }
}

proptest! {
    #[test]
    fn a_hierarchy_is_a_direct_run(line in short_line(), tolerance in tolerance()) {
        SameAsDirect.everywhere(&line, tolerance);
    }

    #[test]
    fn a_hierarchy_survives_storage(line in short_line()) {
        let hierarchy = Hierarchy::new(&PlaneMetric, &line);
        prop_assert_eq!(Hierarchy::from_bytes(&hierarchy.to_bytes()).ok(), Some(hierarchy));
    }

    #[test]
    fn counts_are_kept_and_nested(line in long_line(), count in 0..1600_usize) {
        let hierarchy = Hierarchy::new(&PlaneMetric, &line);
        let (mut kept, mut more) = (Vec::new(), Vec::new());
        hierarchy.keep_count(count, &mut kept);
        hierarchy.keep_count(count + 1, &mut more);
        prop_assert_eq!(kept.len(), count.clamp(2, hierarchy.distances().len() + 2));
        prop_assert!(kept.iter().all(|i| more.binary_search(i).is_ok()));
        let mut filtered = Vec::new();
        hierarchy.filter(hierarchy.tolerance_for(count), &mut filtered);
        prop_assert!(filtered.len() <= count.max(2));
        prop_assert!(filtered.iter().all(|i| kept.binary_search(i).is_ok()));
    }

    #[test]
    fn no_flipped_bit_goes_unnoticed(line in short_line(), place: prop::sample::Index, bit in 0..8) {
        let mut bytes = Hierarchy::new(&PlaneMetric, &line).to_bytes();
        let at = place.index(bytes.len());
        bytes[at] ^= 1_u8 << bit;
        let result = Hierarchy::from_bytes(&bytes);
        prop_assert!(result.is_err_and(|error| error.kind() == ErrorKind::BadInput));
    }
}

#[test]
fn a_thousand_tolerances() {
    for is_lattice in [true, false] {
        let line = walk(5, 3000, is_lattice);
        let hierarchy = Hierarchy::new(&PlaneMetric, &line);
        let own: Vec<f64> = hierarchy.distances().step_by(6).collect();
        let spread = (0..500).map(|i| f64::from(i) * 0.05);
        for tolerance in own.into_iter().take(500).chain(spread) {
            let mut kept = Vec::new();
            hierarchy.filter(tolerance, &mut kept);
            assert_eq!(kept, run(rdp, &PlaneMetric, &line, tolerance), "at {tolerance}");
        }
    }
}

#[test]
fn bytes_cut_short_are_turned_away() {
    let bytes = Hierarchy::new(&PlaneMetric, &walk(1, 50, false)).to_bytes();
    assert!((0..bytes.len()).all(|end| Hierarchy::from_bytes(&bytes[..end]).is_err()));
    assert!(Hierarchy::from_bytes(&[bytes, vec![0]].concat()).is_err());
}

#[test]
fn lines_of_few_vertices_keep_their_ends_once() {
    for count in 0..4_u32 {
        let line: Vec<Xy> = (0..count).map(|i| [f64::from(i), f64::from(i % 2)]).collect();
        let hierarchy = Hierarchy::new(&PlaneMetric, &line);
        assert_eq!(hierarchy.count(), count as usize);
        let (mut filtered, mut counted) = (Vec::new(), Vec::new());
        hierarchy.filter(0.0, &mut filtered);
        hierarchy.keep_count(9, &mut counted);
        let all: Vec<u32> = (0..count).collect();
        assert_eq!((filtered, hierarchy.vertices_at(0.0)), (all.clone(), count as usize));
        assert_eq!(counted, all);
        assert_eq!(hierarchy.squares().len(), count.saturating_sub(2) as usize);
        assert_eq!(hierarchy.tolerance_for(count as usize), 0.0);
    }
}

/// Distances descend, a tolerance is the smallest possible, and ties go by index.
#[test]
fn counts_take_the_farthest_first() {
    let teeth: Vec<Xy> = (0..9).map(|i| [f64::from(i), f64::from(i % 2) * 3.0]).collect();
    let teeth: Vec<Xy> = teeth.iter().map(|p| [p[0] * 100.0, p[1]]).collect();
    let hierarchy = Hierarchy::new(&PlaneMetric, &teeth);
    let distances: Vec<f64> = hierarchy.distances().collect();
    assert!(distances.is_sorted_by(|a, b| a >= b) && distances.iter().all(|d| *d > 0.0));
    for count in 2..=distances.len() + 3 {
        let tolerance = hierarchy.tolerance_for(count);
        assert!(hierarchy.vertices_at(tolerance) <= count);
        assert!(
            tolerance == 0.0 || hierarchy.vertices_at(tolerance.next_down().next_down()) > count
        );
        let mut kept = Vec::new();
        hierarchy.keep_count(count, &mut kept);
        let order = |i: &u32| hierarchy.squares()[*i as usize - 1];
        let mut inner: Vec<u32> = (1..8).filter(|i| order(i) > 0.0).collect();
        inner.sort_by(|a, b| order(b).total_cmp(&order(a)).then(a.cmp(b)));
        inner.truncate(count - 2);
        inner.extend([0, 8]);
        inner.sort_unstable();
        assert_eq!(kept, inner);
    }
}

/// The stored format, which other programs must be able to read.
#[test]
fn bytes_are_a_header_and_squares() {
    let hierarchy = Hierarchy::new(&PlaneMetric, &[[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]]);
    let bytes = hierarchy.to_bytes();
    let words: Vec<u64> =
        bytes.chunks(8).map(|word| u64::from_le_bytes(word.try_into().unwrap())).collect();
    let mut sum = 0xCBF2_9CE4_8422_2325_u64;
    for word in [words[0], words[1], words[3]] {
        sum = (sum ^ word).wrapping_mul(0x0000_0100_0000_01B3);
        sum = (sum >> 32) ^ sum;
    }
    assert_eq!(bytes[..8], *b"TRNLINH2");
    assert_eq!(words[1..], [3, sum, 4.0_f64.to_bits()]);
}
