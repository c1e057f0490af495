//! Hulls against plain scans.

use super::methods::plain_rdp;
use super::*;
use crate::path_hull::Hulls;
use crate::rdp::rdp;
use crate::regions::{FarthestVertex, scan};

/// Zigzags between two slanted lines, parallel or not: bounding boxes do not help.
fn zigzag(count: u32, slant: Xy, growth: f64) -> Vec<Xy> {
    let vertex = |i: u32| {
        let width = 1.0 + growth * f64::from(i);
        let (x, y) = (f64::from(i), if i.is_multiple_of(2) { width } else { -width });
        [slant[0] * x - slant[1] * y, slant[1] * x + slant[0] * y]
    };
    (0..count).map(vertex).collect()
}

/// A spiral towards the centre, so that the farthest vertices lie beyond an end.
fn whirl(count: u32, turn: f64) -> Vec<Xy> {
    let vertex = |i: u32| {
        let (sine, cosine) = (f64::from(i) * turn).sin_cos();
        let radius = f64::from(count - i);
        [radius * cosine, radius * sine]
    };
    (0..count).map(vertex).collect()
}

/// A spiral at almost constant distance from the last vertex.
fn crown(count: u32, fall: f64) -> Vec<Xy> {
    let vertex = |i: u32| {
        let (sine, cosine) = (f64::from(i) * 2.4).sin_cos();
        let radius = if i + 1 == count { 0.0 } else { 1.0 - fall * f64::from(i) };
        [radius * cosine, radius * sine]
    };
    (0..count).map(vertex).collect()
}

/// Lines of a few hundred vertices: walks, zigzags, spirals, few repeated positions, and the same far from the
/// origin, where differences are rounded.
fn line() -> impl Strategy<Value = Vec<Xy>> {
    let slants = prop_oneof![Just([4.0, 3.0]), Just([0.6, 0.8]), Just([1.0, 0.0])];
    let growth = prop_oneof![Just(0.0), Just(1.0), Just(-0.001)];
    let positions = (1..5_i32, any::<u64>()).prop_map(|(side, seed)| {
        let mut dice = Dice(seed);
        let most = side as u64;
        (0..700).map(|_| [dice.below(most) as f64 * 0.3, dice.below(most) as f64 * 0.7]).collect()
    });
    let lines = prop_oneof![
        (any::<u64>(), 200..900_usize, any::<bool>()).prop_map(|(seed, n, l)| walk(seed, n, l)),
        (200..900_u32, slants, growth).prop_map(|(n, slant, growth)| zigzag(n, slant, growth)),
        (200..900_u32, prop_oneof![Just(std::f64::consts::FRAC_PI_2), Just(2.4), Just(0.01)])
            .prop_map(|(n, turn)| whirl(n, turn)),
        (200..900_u32, prop_oneof![Just(0.0), Just(1e-7), Just(1e-16)])
            .prop_map(|(n, fall)| crown(n, fall)),
        positions,
    ];
    let away = prop_oneof![Just(0.0), Just(1e9 + 0.1)];
    (lines, away).prop_map(|(line, away)| line.iter().map(|p| [p[0] + away, p[1]]).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn what_hulls_find_is_what_scans_find(line in line(), ends: [prop::sample::Index; 2]) {
        let hulls = Hulls::new(&line);
        let ends = ends.map(|end| end.index(line.len()));
        let (start, end) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        for (from, to) in [(start, end), (0, end), (start, line.len() - 1), (0, line.len() - 1)] {
            let segment = PlaneMetric.segment(&line[from], &line[to]);
            for within in [0.0, 1.0, 1e6] {
                let mut found = FarthestVertex { index: from, reach: within };
                let mut plain = found;
                let within = (from + 1).min(to)..to;
                scan::<Xy, PlaneMetric>(&segment, &line, within.start, to, &mut plain);
                hulls.farthest(&segment, &line, within, &mut Vec::new(), &mut found);
                prop_assert_eq!((found.index, found.reach), (plain.index, plain.reach));
            }
        }
    }
}

/// Sections with few positions each, or one position per vertex, far from those of the next, so that one
/// section gives no information about another.
#[test]
fn runs_of_few_positions_know_their_own() {
    for seed in 0..40 {
        let mut dice = Dice(seed);
        let mut line: Vec<Xy> = Vec::new();
        for _ in 0..14 {
            let middle = [dice.swing() * 100.0, dice.swing() * 100.0];
            let most = if dice.below(4) == 0 { 1 << 30 } else { 2 };
            let corner =
                |dice: &mut Dice, i: usize| middle[i] + dice.below(most) as f64 * 8.0 / most as f64;
            line.extend((0..128).map(|_| [corner(&mut dice, 0), corner(&mut dice, 1)]));
        }
        let hulls = Hulls::new(&line);
        for _ in 0..40 {
            let ends = [(); 2].map(|()| dice.below(line.len() as u64) as usize);
            let (from, to) = (ends[0].min(ends[1]), ends[0].max(ends[1]).max(1));
            let segment = PlaneMetric.segment(&line[from], &line[to]);
            let mut found = FarthestVertex { index: from, reach: 0.0 };
            let mut plain = found;
            scan::<Xy, PlaneMetric>(&segment, &line, (from + 1).min(to), to, &mut plain);
            let within = (from + 1).min(to)..to;
            hulls.farthest(&segment, &line, within, &mut Vec::new(), &mut found);
            assert_eq!((found.index, found.reach), (plain.index, plain.reach), "seed {seed}");
        }
    }
}

#[test]
fn lines_on_which_boxes_are_quadratic() {
    let lines = [
        zigzag(100_000, [4.0, 3.0], 0.0),
        zigzag(100_000, [0.6, 0.8], 1e-5),
        whirl(100_000, std::f64::consts::FRAC_PI_2),
        whirl(100_000, 2.4),
    ];
    for line in &lines {
        assert_holds(&PlaneMetric, line, 0.5, &run(rdp, &PlaneMetric, line, 0.5));
    }
}

#[test]
fn hulls_take_over_from_boxes_without_a_trace() {
    for line in [zigzag(5000, [4.0, 3.0], 0.0), zigzag(5000, [0.6, 0.8], 1e-3), whirl(5000, 2.4)] {
        for tolerance in [0.0, 0.5, 2.5] {
            let kept = run(rdp, &PlaneMetric, &line, tolerance);
            assert_eq!(kept, plain_rdp(&PlaneMetric, &line, tolerance));
            let mut filtered = Vec::new();
            crate::Hierarchy::new(&PlaneMetric, &line).filter(tolerance, &mut filtered);
            assert_eq!(filtered, kept);
        }
    }
}

/// Hulls are for the plane: other metrics have bounding boxes only.
#[test]
fn other_metrics_stay_with_boxes() {
    struct SameAsPlain;
    impl Check for SameAsPlain {
        fn check<V: Copy, M: DistanceMetric<V>>(&self, metric: &M, points: &[V], tolerance: f64) {
            assert_eq!(run(rdp, metric, points, tolerance), plain_rdp(metric, points, tolerance));
        }
    }
    SameAsPlain.everywhere(&zigzag(3000, [4.0, 3.0], 0.0), 0.5);
    SameAsPlain.everywhere(&zigzag(3000, [0.6, 0.8], 1e-3), 0.5);
}
