//! Hierarchies against direct runs, and their bytes.

use super::*;
use crate::Hierarchy;
use crate::rdp::rdp;
use terrane_base::error::ErrorKind;

struct SameAsDirect;

impl Check for SameAsDirect {
    fn check<V: Copy, M: Metric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
        let mut kept = Vec::new();
        let hierarchy = Hierarchy::new(metric, points);
        hierarchy.filter(tolerance, &mut kept);
        assert_eq!(hierarchy.kept(tolerance), kept.len());
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
        let hierarchy = Hierarchy::new(&Plane, &line);
        prop_assert_eq!(Hierarchy::from_bytes(&hierarchy.to_bytes()).ok(), Some(hierarchy));
    }

    #[test]
    fn counts_are_kept_and_nested(line in long_line(), count in 0..1600_usize) {
        let hierarchy = Hierarchy::new(&Plane, &line);
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
        let mut bytes = Hierarchy::new(&Plane, &line).to_bytes();
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
        let hierarchy = Hierarchy::new(&Plane, &line);
        let own: Vec<f64> = hierarchy.distances().step_by(6).collect();
        let spread = (0..500).map(|i| f64::from(i) * 0.05);
        for tolerance in own.into_iter().take(500).chain(spread) {
            let mut kept = Vec::new();
            hierarchy.filter(tolerance, &mut kept);
            assert_eq!(kept, run(rdp, &Plane, &line, tolerance), "at {tolerance}");
        }
    }
}

#[test]
fn bytes_cut_short_are_turned_away() {
    let bytes = Hierarchy::new(&Plane, &walk(1, 50, false)).to_bytes();
    assert!((0..bytes.len()).all(|end| Hierarchy::from_bytes(&bytes[..end]).is_err()));
    assert!(Hierarchy::from_bytes(&[bytes, vec![0]].concat()).is_err());
}
