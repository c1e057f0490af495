//! The checker sees what is wrong, and nothing else.

use std::slice::from_ref;

use super::*;

mod gone;
mod rings;
mod twin;

type Part = Vec<[i32; 2]>;

struct Flat {
    points: Vec<[f64; 3]>,
    starts: Vec<usize>,
    closed: Vec<bool>,
}

impl Flat {
    /// Parts, rings among them as `closed` says.
    fn new(parts: &[Part], closed: &[bool]) -> Self {
        let mut flat = Self { points: vec![], starts: vec![0], closed: closed.to_vec() };
        for part in parts {
            flat.points.extend(part.iter().map(|p| [f64::from(p[0]), f64::from(p[1]), 0.0]));
            flat.starts.push(flat.points.len());
        }
        flat
    }

    fn lines(&self) -> ProofLines<'_> {
        ProofLines { points: &self.points, starts: &self.starts, closed: &self.closed }
    }
}

fn report(before: &[Part], after: &[Part], points: &[[f64; 2]], tolerance: f64) -> LineCheckReport {
    let closed: Vec<bool> = before.iter().map(|p| p.len() > 1 && p[0] == p[p.len() - 1]).collect();
    let (before, after) = (Flat::new(before, &closed), Flat::new(after, &closed));
    let question = LineQuestion {
        original: before.lines(),
        simplified: after.lines(),
        points,
        distance: ProofDistance::Plane,
        tolerance: Some(tolerance),
    };
    check(&question).unwrap()
}

fn square(x: i32, y: i32, size: i32) -> Part {
    vec![[x, y], [x + size, y], [x + size, y + size], [x, y + size], [x, y]]
}

#[test]
fn what_is_the_same_is_sound() {
    let parts = vec![square(0, 0, 10), square(20, 0, 10), vec![[0, 50], [10, 60]], vec![]];
    let report = report(&parts, &parts, &[[5.0, 5.0]], 0.0);
    assert!(report.is_sound(), "{report:?}");
    assert_eq!((report.parts, report.vertices), (3, [12, 12]));
    assert_eq!(report.farthest, None);
}

#[test]
fn distances_and_where_they_are() {
    let line = vec![[0, 0], [10, 3], [20, 5], [30, 0]];
    let after = vec![vec![[0, 0], [30, 0]]];
    let found = report(from_ref(&line), &after, &[], 4.0);
    let farthest = found.farthest.unwrap();
    assert_eq!((farthest.distance, farthest.part, farthest.at), (5.0, 0, [20.0, 5.0]));
    assert_eq!(found.beyond, LineDefect { count: 1, first: Some((0, [20.0, 5.0])) });
    assert!(report(&[line], &after, &[], 5.0).is_sound());
}

#[test]
fn rings_may_begin_elsewhere_and_lines_may_not() {
    let ring = vec![[0, 0], [5, 0], [10, 0], [10, 10], [0, 10], [0, 0]];
    let turned = vec![[10, 10], [0, 10], [0, 0], [10, 0], [10, 10]];
    assert!(report(from_ref(&ring), from_ref(&turned), &[], 0.0).is_sound());
    let back: Part = turned.iter().rev().copied().collect();
    assert!(report(&[ring], &[back], &[], 0.0).is_sound(), "formats turn rings");
    assert_eq!(report(from_ref(&turned), &[vec![[0, 0]]], &[], 0.0).foreign.count, 1);
    let line = vec![[0, 0], [5, 0], [10, 0]];
    assert_eq!(report(from_ref(&line), &[vec![[0, 0], [5, 0]]], &[], 0.0).foreign.count, 1);
    assert_eq!(report(&[line], &[vec![[0, 0], [6, 0], [10, 0]]], &[], 0.0).foreign.count, 1);
}

#[test]
fn repeated_positions_are_matched_as_is_best() {
    // The line passes [10, 0] twice, and [9, 5] is nearer to the segment before than to the one after.
    let line = vec![[0, 0], [10, 0], [9, 5], [10, 0], [20, 0]];
    let found = report(&[line], &[vec![[0, 0], [10, 0], [20, 0]]], &[], 5.05);
    assert_eq!(found.foreign.count + found.beyond.count, 0, "{found:?}");
    let line = vec![[0, 0], [10, 0], [11, 5], [10, 0], [20, 0]];
    let found = report(&[line], &[vec![[0, 0], [10, 0], [20, 0]]], &[], 5.05);
    assert_eq!(found.foreign.count + found.beyond.count, 0, "{found:?}");
}

#[test]
fn crossings_old_and_new() {
    let bump = vec![[0, 0], [10, 20], [20, 0]];
    let under = vec![[10, 10], [10, -10]];
    let flat = vec![[0, 0], [20, 0]];
    let before = [bump.clone(), vec![[10, -10], [9, -5], [10, 10]]];
    let found = report(&before, &[bump.clone(), under.clone()], &[], 1e9);
    assert_eq!((found.original_crossings, found.crossings, found.new_crossings.count), (0, 0, 0));
    let found =
        report(&[bump, vec![[10, 10], [10, -10]]], &[flat.clone(), under.clone()], &[], 1e9);
    assert_eq!((found.original_crossings, found.crossings, found.new_crossings.count), (0, 1, 1));
    let found = report(&[flat.clone(), under.clone()], &[flat, under], &[], 0.0);
    assert_eq!((found.original_crossings, found.crossings, found.new_crossings.count), (1, 1, 0));
}

#[test]
fn touches_and_overlaps_are_crossings() {
    let meets = |s: [[f64; 2]; 2], t: [[f64; 2]; 2]| exact::meet(s, t);
    assert!(meets([[0.0, 0.0], [4.0, 0.0]], [[2.0, 0.0], [2.0, 3.0]]), "an end inside");
    assert!(meets([[0.0, 0.0], [4.0, 0.0]], [[0.0, 0.0], [9.0, 0.0]]), "over each other");
    assert!(!meets([[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [9.0, 0.0]]), "straight on");
    assert!(!meets([[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [4.0, 3.0]]), "a corner");
    assert!(
        !meets([[0.0, 0.0], [0.3, 0.3]], [[0.1, 0.1f64.next_up()], [0.2, 0.5]]),
        "an ulp apart"
    );
    assert!(meets([[0.0, 0.0], [0.3, 0.3]], [[0.1, 0.1], [0.2, 0.5]]));
}

#[test]
fn crossings_are_those_of_all_pairs() {
    let mut state = 7u64;
    let mut below = |count: u64| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % count) as i32
    };
    for round in 0..40 {
        let size = 10 + 40 * round;
        let parts: Vec<Part> = (0..400)
            .map(|_| {
                let at = [below(size), below(size)];
                vec![at, [at[0] + below(9) - 4, at[1] + below(30) - 15]]
            })
            .filter(|s: &Part| s[0] != s[1])
            .collect();
        let found = report(&parts, &parts, &[], 0.0);
        let mut all: Vec<[[f64; 2]; 2]> = parts
            .iter()
            .map(|s| {
                let [a, b] = [s[0].min(s[1]), s[0].max(s[1])];
                [a.map(f64::from), b.map(f64::from)]
            })
            .collect();
        all.sort_by(|p, q| p.partial_cmp(q).unwrap());
        all.dedup();
        let pairs = all.iter().enumerate();
        let want: usize =
            pairs.map(|(i, s)| all[..i].iter().filter(|t| exact::meet(*s, **t)).count()).sum();
        assert_eq!(found.crossings, want as u64, "round {round}");
        assert_eq!(found.new_crossings.count, 0);
    }
}

#[test]
fn rings_collapsed_turned_and_dropped() {
    let ring = vec![[0, 0], [10, 0], [5, 1], [5, 9], [0, 0]];
    let found = report(from_ref(&ring), &[vec![[0, 0], [5, 1], [0, 0]]], &[], 1e9);
    assert_eq!((found.collapsed.count, found.turned.count), (1, 0));
    let arrow = vec![[0, 0], [10, 10], [20, 0], [10, 11], [0, 0]];
    let found = report(from_ref(&arrow), &[vec![[0, 0], [10, 10], [20, 0], [0, 0]]], &[], 1e9);
    assert_eq!((found.collapsed.count, found.turned.count), (0, 1));
    let found = report(&[ring, arrow.clone()], &[vec![], arrow], &[], 0.0);
    assert_eq!(found.dropped, 1);
    assert!(found.is_sound());
}

#[test]
fn islands_and_points_that_change_sides() {
    let coast = vec![[0, 0], [50, 30], [100, 0], [100, -99], [0, -99], [0, 0]];
    let flat = vec![[0, 0], [100, 0], [100, -99], [0, -99], [0, 0]];
    let lake = square(48, 10, 4);
    let found = report(&[coast.clone(), lake.clone()], &[flat.clone(), lake.clone()], &[], 1e9);
    assert_eq!(found.new_crossings.count, 0);
    assert_eq!(found.moved.first.map(|m| m.0), Some(0));
    assert_eq!(found.moved.count, 4, "each vertex");
    let found = report(from_ref(&coast), from_ref(&flat), &[[50.0, 5.0], [50.0, 35.0]], 1e9);
    assert_eq!(found.moved, LineDefect { count: 1, first: Some((0, [50.0, 5.0])) });
    let found = report(&[coast], &[flat], &[[50.0, 0.0]], 1e9);
    assert_eq!(found.moved.count, 1, "it has come to lie on the coast");
}

#[test]
fn what_lay_on_a_part_had_no_side_of_it() {
    let bag = vec![[0, 0], [50, -30], [100, 0], [100, 99], [0, 99], [0, 0]];
    let flat = vec![[0, 0], [100, 0], [100, 99], [0, 99], [0, 0]];
    let points = [[25.0, -15.0], [50.0, -30.0]];
    assert_eq!(report(&[bag], &[flat], &points, 1e9).moved.count, 0);
}

#[test]
fn shared_borders_that_part() {
    let left = vec![[0, 0], [10, 0], [11, 5], [10, 10], [0, 10], [0, 0]];
    let right = vec![[10, 0], [20, 0], [20, 10], [10, 10], [11, 5], [10, 0]];
    let thin = vec![[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]];
    let found = report(&[left.clone(), right.clone()], &[thin.clone(), right.clone()], &[], 1e9);
    assert_eq!(found.torn.count, 2, "the two segments of the old border");
    let other = vec![[10, 0], [20, 0], [20, 10], [10, 10], [10, 0]];
    assert_eq!(report(&[left, right], &[thin, other], &[], 1e9).torn.count, 0);
}

#[test]
fn metres_at_the_equator_and_far_north() {
    let off = |latitude: f64| {
        ProofDistance::Geographic.of(
            [1.0, latitude, 0.0],
            [0.0, latitude, 0.0],
            [0.0, latitude + 1.0, 0.0],
        )
    };
    assert!((off(0.0) - 111_319.490_793).abs() < 1e-5);
    // N cos(60 degrees) for WGS 84.
    assert!((off(60.0) - 55_800.0).abs() < 5.0);
    let up = |p: f64| {
        ProofDistance::Geographic.of([0.0, p, 0.0], [0.0, p + 1.0, 0.0], [1.0, p + 1.0, 0.0])
    };
    assert!((up(0.0) - 110_574.3).abs() < 1.0);
}

#[test]
fn distance_in_space_is_to_the_segment() {
    let off = ProofDistance::Space.of([5.0, 0.0, 3.0], [0.0, 0.0, 0.0], [10.0, 0.0, 0.0]);
    assert_eq!(off, 3.0);
    let beyond = ProofDistance::Space.of([13.0, 0.0, 4.0], [0.0, 0.0, 0.0], [10.0, 0.0, 0.0]);
    assert_eq!(beyond, 5.0);
}

#[test]
fn bad_questions_are_turned_away() {
    let (one, two) =
        (Flat::new(&[square(0, 0, 1)], &[true]), Flat::new(&[square(0, 0, 1)], &[false]));
    let ask = |original: &Flat, simplified: &Flat| {
        let question = LineQuestion {
            original: original.lines(),
            simplified: simplified.lines(),
            points: &[],
            distance: ProofDistance::Plane,
            tolerance: None,
        };
        check(&question).map(|_| ())
    };
    assert!(ask(&one, &one).is_ok());
    assert!(ask(&one, &two).is_err());
    let mut bad = Flat::new(&[square(0, 0, 1)], &[true]);
    bad.points[2][1] = f64::NAN;
    assert!(ask(&bad, &one).unwrap_err().to_string().contains("vertex 2"));
    bad.points[2][1] = 0.0;
    bad.points[4][1] = 9.0;
    assert!(ask(&one, &bad).unwrap_err().to_string().contains("part 0"));
}
