//! Pieces, bands and strips against all pairs of everything.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;

use super::super::exact::{by_ends, in_box, meet, side, upward};
use super::*;

type Ends = [[f64; 2]; 2];

fn xy(parts: &[Part]) -> Vec<Vec<[f64; 2]>> {
    parts.iter().map(|part| part.iter().map(|p| p.map(f64::from)).collect()).collect()
}

fn segments(part: &[[f64; 2]]) -> impl Iterator<Item = Ends> + Clone {
    part.windows(2).map(|pair| [pair[0], pair[1]]).filter(|s| s[0] != s[1])
}

/// The segments of all parts, each place once.
fn places(parts: &[Vec<[f64; 2]>]) -> Vec<Ends> {
    let mut all: Vec<Ends> = parts.iter().flat_map(|p| segments(p)).map(upward).collect();
    all.sort_by(by_ends);
    all.dedup();
    all
}

/// Pairs of all segments that meet, before and after, and those after that are new.
fn crossings(before: &[Vec<[f64; 2]>], after: &[Vec<[f64; 2]>]) -> [u64; 3] {
    let (old, new) = (places(before), places(after));
    let pairs = |of: &[Ends]| -> Vec<[Ends; 2]> {
        let all = of.iter().enumerate();
        all.flat_map(|(i, s)| of[..i].iter().filter(|t| meet(*s, **t)).map(|t| [*s, *t])).collect()
    };
    let is_new = |pair: &&[Ends; 2]| !pair.iter().all(|s| old.contains(s));
    let made = pairs(&new);
    let fresh = made.iter().filter(is_new).count();
    [pairs(&old).len() as u64, made.len() as u64, fresh as u64]
}

/// Whether a ray upwards crosses a part an odd number of times, and whether it begins on it.
fn ray(part: &[[f64; 2]], p: [f64; 2]) -> (bool, bool) {
    let on = segments(part).any(|s| in_box(p, s) && side(s, p) == 0);
    let crossed =
        segments(part).map(upward).filter(|s| s[0][0] <= p[0] && p[0] < s[1][0] && side(*s, p) < 0);
    (crossed.count() % 2 == 1, on)
}

fn moved(before: &[Vec<[f64; 2]>], after: &[Vec<[f64; 2]>], points: &[[f64; 2]]) -> u64 {
    let all = after.iter().flatten().chain(points);
    let all: BTreeSet<[u64; 2]> = all.map(|p| p.map(|v| (v + 0.0).to_bits())).collect();
    let has_moved = |p: [f64; 2], old: &[[f64; 2]], new: &[[f64; 2]]| {
        let ((was, on), (is, touches)) = (ray(old, p), ray(new, p));
        !on && (touches || was != is)
    };
    let parts = || before.iter().zip(after).filter(|(_, new)| !new.is_empty());
    let of = |p: &[u64; 2]| {
        parts().filter(|(old, new)| has_moved(p.map(f64::from_bits), old, new)).count() as u64
    };
    all.iter().map(of).sum()
}

/// Shared segments that were replaced differently, and new ones that replace different stretches; for
/// parts that come to no vertex twice.
fn torn(before: &[Vec<[f64; 2]>], after: &[Vec<[f64; 2]>]) -> u64 {
    let bits = |s: Ends| upward(s).map(|p| p.map(f64::to_bits));
    let mut replaced: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
    let mut replacing: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
    for (old, new) in before.iter().zip(after) {
        for segment in new.windows(2).map(|pair| [pair[0], pair[1]]) {
            let at = |p| old.iter().position(|q| *q == p).unwrap();
            // A ring's last vertex is its first again.
            let (from, to) = (at(segment[0]), at(segment[1]));
            let to = if to <= from { old.len() - 1 } else { to };
            let stretch: BTreeSet<_> = segments(&old[from..=to]).map(bits).collect();
            stretch.iter().for_each(|s| {
                replaced.entry(*s).or_default().insert(bits(segment));
            });
            if segment[0] != segment[1] {
                replacing.entry(bits(segment)).or_default().insert(stretch);
            }
        }
    }
    let several = replaced.values().filter(|v| v.len() > 1).count();
    (several + replacing.values().filter(|v| v.len() > 1).count()) as u64
}

/// Parts that come to no vertex twice, on a small grid so that they share and meet a lot, and some of
/// their vertices.
fn world() -> impl Strategy<Value = (Vec<Part>, Vec<Part>)> {
    let part = (proptest::collection::vec([0..9, 0..9], 3..9), any::<bool>(), any::<u16>(), 0..12);
    proptest::collection::vec(part, 1..8).prop_map(|parts| {
        parts
            .into_iter()
            .map(|(points, is_ring, kept, gone)| {
                let mut seen = BTreeSet::new();
                let mut part: Part = points.into_iter().filter(|p| seen.insert(*p)).collect();
                let mut after: Part = (0..)
                    .zip(&part)
                    .filter(|(i, _)| {
                        *i == 0 || (!is_ring && *i + 1 == part.len()) || kept >> i & 1 == 1
                    })
                    .map(|(_, p)| *p)
                    .collect();
                if is_ring {
                    part.push(part[0]);
                    after.push(after[0]);
                }
                if gone == 0 {
                    after.clear();
                }
                (part, after)
            })
            .unzip()
    })
}

fn question_of(
    before: &[Part],
    after: &[Part],
    points: &[[f64; 2]],
    band: usize,
) -> LineCheckReport {
    let closed: Vec<bool> = before.iter().map(|p| p.len() > 1 && p[0] == p[p.len() - 1]).collect();
    let (before, after) = (Flat::new(before, &closed), Flat::new(after, &closed));
    let (original, simplified) = (before.lines(), after.lines());
    let distance = ProofDistance::Plane;
    check_by(&LineQuestion { original, simplified, points, distance, tolerance: None }, band)
        .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn figures_are_those_of_all_pairs((before, after) in world()) {
        let points: Vec<[f64; 2]> = (0..20).map(|i| [f64::from(i % 5) * 2.25, f64::from(i / 5) * 2.5]).collect();
        let found = question_of(&before, &after, &points, 1 << 17);
        prop_assert_eq!(found.foreign.count, 0);
        let (old, new) = (xy(&before), xy(&after));
        let told = [found.original_crossings, found.crossings, found.new_crossings.count];
        prop_assert_eq!(told, crossings(&old, &new));
        prop_assert_eq!(found.moved.count, moved(&old, &new, &points));
        prop_assert_eq!(found.torn.count, torn(&old, &new));
        // A vertex sampled in 64 ends a band of that many: more parts make more bands.
        let many = |parts: &[Part]| -> Vec<Part> {
            let moved = |part: &Part, i: i32| part.iter().map(|p| [p[0] + i % 7 * 3, p[1] + i / 7 * 20]).collect();
            (0..14).flat_map(|i| parts.iter().map(move |part| moved(part, i))).collect()
        };
        let (before, after) = (many(&before), many(&after));
        prop_assert_eq!(question_of(&before, &after, &points, 64), question_of(&before, &after, &points, 1 << 17));
    }

    #[test]
    fn what_is_held_narrows_to_bands_that_tell_the_same((before, after) in world()) {
        let whole = question_of(&before, &after, &[], 1 << 17);
        let comparison = PartComparison { distance: ProofDistance::Plane, tolerance: None, drops: DroppedParts::Any };
        let mut report = LineCheckReport::default();
        let mut from = f64::NEG_INFINITY;
        for pass in 0.. {
            let mut pieces = LineProofPieces::new(XRange { from, to: f64::INFINITY });
            let mut own = LineCheckReport::default();
            for (part, (old, new)) in (0u32..).zip(before.iter().zip(&after)) {
                let three = |part: &Part| part.iter().map(|p| [f64::from(p[0]), f64::from(p[1]), 0.0]).collect::<Vec<_>>();
                let closed = old.len() > 1 && old[0] == old[old.len() - 1];
                let (old, new) = (three(old), three(new));
                let [old, new] = [&old, &new].map(|points| PartVertices::of(points));
                comparison.part(part, old, new, closed, &mut own, &mut pieces);
                if pieces.bytes() > 300 {
                    pieces.halve();
                }
            }
            if pass == 0 {
                report = own;
            }
            report.add_band(&judge(&pieces, &[], pieces.band()));
            from = pieces.band().to;
            if from == f64::INFINITY {
                break;
            }
        }
        prop_assert_eq!(report, whole);
    }
}
