//! Rings that may be gone, against all pairs of their vertices.

use proptest::prelude::*;

use super::super::gone::lies_along_a_segment;
use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn rings_go_where_a_pair_of_vertices_has_all_others_near(
        ring in proptest::collection::vec([0..8, 0..8], 1..12),
        hole in proptest::collection::vec([0..8, 0..8], 0..4),
        tolerance in 0..5,
    ) {
        let points = |of: &[[i32; 2]]| -> Vec<[f64; 3]> {
            of.iter().map(|p| [f64::from(p[0]), f64::from(p[1]), 0.0]).collect()
        };
        let (ring, hole, tolerance) = (points(&ring), points(&hole), f64::from(tolerance) * 0.5);
        let near = |a: [f64; 3], b: [f64; 3]| {
            ring.iter().chain(&hole).all(|p| ProofDistance::Plane.of(*p, a, b) <= tolerance)
        };
        let want = ring.iter().any(|a| ring.iter().any(|b| near(*a, *b)));
        let told = lies_along_a_segment(ProofDistance::Plane, &ring, &hole, tolerance);
        prop_assert_eq!(told, Some(want));
    }
}

#[test]
fn large_rings_are_told_at_once() {
    let ring = |radii: [f64; 2]| -> Vec<[f64; 3]> {
        let at = |i: u32| {
            let angle = f64::from(i) / 200_000.0 * std::f64::consts::TAU;
            [radii[0] * angle.cos(), radii[1] * angle.sin(), 0.0]
        };
        (0..200_000).map(at).collect()
    };
    let told =
        |radii, tolerance| lies_along_a_segment(ProofDistance::Plane, &ring(radii), &[], tolerance);
    assert_eq!(told([100.0, 100.0], 30.0), Some(false));
    assert_eq!(told([100.0, 1.0], 1.001), Some(true));
}
