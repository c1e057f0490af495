//! Tests of the spike-free triangulation: its slow twin, the plain triangulation, and scenes.

use super::*;
use crate::interpolate;
use crate::oracle::{self, Dice};
use crate::predicates::{in_circle, orient};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// The slow twin: all triangles are looked at for everything, and those that are frozen are marked.
struct Slow {
    points: Vec<Point>,
    triangles: Vec<([usize; 3], bool)>,
}

fn site(p: Point) -> Site {
    [p.x, p.y]
}

impl Slow {
    fn new(frame: &[Point], points: &[Point], freeze: &FreezeRule) -> Self {
        let mut points: Vec<Point> = points.to_vec();
        points.sort_by_key(|p| (Reverse(p.z), p.x, p.y));
        let mut taken = BTreeSet::new();
        points.retain(|p| taken.insert([p.x, p.y]));
        let mut made = Self { points: frame.to_vec(), triangles: Vec::new() };
        made.triangles = vec![([0, 1, 3], false), ([0, 3, 2], false)];
        made.flip();
        points.iter().for_each(|p| made.add(*p, freeze));
        made
    }

    fn add(&mut self, p: Point, freeze: &FreezeRule) {
        for (corners, is_frozen) in &mut self.triangles {
            let [a, b, c] = corners.map(|i| self.points[i]);
            let long = |p: Point, q: Point| {
                let [x, y] = [0, 1].map(|i| f64::from(site(p)[i] - site(q)[i]) * freeze.step[i]);
                (x * x + y * y).sqrt() > freeze.edge + 1e-9
            };
            let is_small = !long(a, b) && !long(b, c) && !long(c, a);
            let above = f64::from(a.z.min(b.z).min(c.z) - p.z) * freeze.step[2];
            *is_frozen |=
                corners.iter().all(|i| *i >= FRAME as usize) && is_small && above > freeze.buffer;
        }
        let side = |a: usize, b: usize| orient(site(self.points[a]), site(self.points[b]), site(p));
        let holds = |[a, b, c]: [usize; 3]| side(a, b) >= 0 && side(b, c) >= 0 && side(c, a) >= 0;
        let (around, others): (Vec<_>, Vec<_>) =
            self.triangles.iter().copied().partition(|(corners, _)| holds(*corners));
        if around.iter().any(|(_, is_frozen)| *is_frozen) {
            return;
        }
        let sides = |[a, b, c]: [usize; 3]| [(a, b), (b, c), (c, a)];
        let new = self.points.len();
        let rim = around.iter().flat_map(|(corners, _)| sides(*corners));
        let rim = rim.filter(|(a, b)| side(*a, *b) != 0).map(|(a, b)| ([a, b, new], false));
        self.triangles = rim.chain(others).collect();
        self.points.push(p);
        self.flip();
    }

    /// Flips sides of triangles that are not frozen until all are Delaunay.
    fn flip(&mut self) {
        while let Some((i, j, turned)) = self.wrong() {
            (self.triangles[i].0, self.triangles[j].0) = (turned[0], turned[1]);
        }
    }

    fn wrong(&self) -> Option<(usize, usize, [[usize; 3]; 2])> {
        let at = |i: usize| site(self.points[i]);
        let free = || self.triangles.iter().enumerate().filter(|(_, (_, is_frozen))| !is_frozen);
        for (i, (one, _)) in free() {
            for (j, (other, _)) in free().filter(|(j, _)| *j > i) {
                for (k, l) in (0..9).map(|n| (n / 3, n % 3)) {
                    let [a, b, c] = [one[k], one[(k + 1) % 3], one[(k + 2) % 3]];
                    let [e, f, d] = [other[l], other[(l + 1) % 3], other[(l + 2) % 3]];
                    if (a, b) == (f, e) && in_circle(at(a), at(b), at(c), at(d)) {
                        return Some((i, j, [[a, d, c], [d, b, c]]));
                    }
                }
            }
        }
        None
    }

    fn triangles(&self) -> Vec<[Point; 3]> {
        turned(self.triangles.iter().map(|(corners, _)| corners.map(|i| self.points[i])))
    }
}

/// In one order.
fn turned(triangles: impl Iterator<Item = [Point; 3]>) -> Vec<[Point; 3]> {
    let mut all: Vec<_> = triangles.map(from_lowest).collect();
    all.sort();
    all
}

fn made(points: &[Point], freeze: FreezeRule) -> SpikeFree {
    let window = SiteWindow::of(points.iter().map(|p| site(*p))).unwrap();
    let made = SpikeFree::new(points.to_vec(), &window, freeze).unwrap();
    let lowest = points.iter().map(|p| p.z).min().unwrap();
    let frozen = |ids: [u32; 3]| {
        corners(&made.points, ids).is_some_and(|corners| freeze.holds(&corners, lowest))
    };
    made.triangulation.validate_beside(frozen).unwrap();
    made
}

/// The frame around points, and the points.
fn vertices(made: &SpikeFree, points: &[Point]) -> Vec<Point> {
    let window = SiteWindow::of(points.iter().map(|p| site(*p))).unwrap();
    let side = (0..2).map(|i| window.high[i] - window.low[i] + 1).max().unwrap();
    [&frame(side)[..], &made.points].concat()
}

fn triangles(made: &SpikeFree, points: &[Point]) -> Vec<[Point; 3]> {
    let vertices = vertices(made, points);
    turned(made.triangulation.triangles().map(|ids| ids.map(|id| vertices[id as usize])))
}

fn check_twin(name: &str, points: &[Point], freeze: FreezeRule) -> usize {
    let fast = made(points, freeze);
    let place = |p: &Point| Point::new(p.x - fast.low[0], p.y - fast.low[1], p.z);
    let local: Vec<Point> = points.iter().map(place).collect();
    let slow = Slow::new(&vertices(&fast, points)[..FRAME as usize], &local, &freeze);
    assert_eq!(triangles(&fast, points), slow.triangles(), "{name} {freeze:?}");
    slow.triangles.iter().filter(|(_, is_frozen)| *is_frozen).count()
}

#[test]
fn awkward_sets_are_those_of_the_twin() {
    let mut frozen = 0;
    for n in [3, 9, 25, 36] {
        for (name, points) in oracle::awkward(n) {
            let mut dice = Dice(n as u64);
            let quarter = |p: Point| Point::new(p.x / 4, p.y / 4, dice.below(40));
            let points: Vec<Point> = points.into_iter().map(quarter).collect();
            for edge in [0.0, 6.0, 60.0, 9000.0] {
                for buffer in [0.0, 7.0] {
                    frozen +=
                        check_twin(name, &points, FreezeRule { edge, buffer, step: [1.0; 3] });
                }
            }
        }
    }
    assert!(frozen > 300, "{frozen}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn crowded_points_are_those_of_the_twin(
        points in prop::collection::vec((0..14, 0..11, 0..30), 4..70),
        edge in 1.0..7.0f64, buffer in 0.0..6.0f64, seed in 0..1000u64,
    ) {
        let mut points: Vec<Point> =
            points.into_iter().map(|(x, y, z)| Point::new(x - 5, y + 3, z)).collect();
        let freeze = FreezeRule { edge, buffer, step: [1.0, 1.25, 0.5] };
        check_twin("crowded", &points, freeze);
        let before = triangles(&made(&points, freeze), &points);
        let mut dice = Dice(seed);
        (1..points.len()).rev().for_each(|i| points.swap(i, dice.below(i as i32 + 1) as usize));
        prop_assert_eq!(triangles(&made(&points, freeze), &points), before);
    }
}

#[test]
fn without_freezing_it_is_the_plain_triangulation() {
    for n in [16, 400, 5_000] {
        for (name, points) in oracle::awkward(n) {
            let points: Vec<Point> =
                points.into_iter().map(|p| Point::new(p.x / 4, p.y / 4, p.z)).collect();
            let made = made(&points, FreezeRule { edge: 0.0, buffer: 0.0, step: [1.0; 3] });
            let vertices = vertices(&made, &points);
            let plain = Triangulation::new(&vertices).unwrap();
            let plain = plain.triangles().map(|ids| ids.map(|id| vertices[id as usize]));
            assert_eq!(triangles(&made, &points), turned(plain), "{name} {n}");
        }
    }
}

/// The height at a place, in steps.
fn height(made: &SpikeFree, x: f64, y: f64) -> f64 {
    let at = FixedPosition::from_steps(x, y);
    let (corners, _) = made.find(at, &mut 0, false).unwrap();
    interpolate(&corners, at)
}

/// Steps are centimetres.
const METRES: [f64; 3] = [0.01; 3];

/// A field of 60 m with points about 1 m apart, which are as high as they are told to be.
fn field(mut height: impl FnMut(f64, f64, &mut Dice) -> f64) -> Vec<Point> {
    let mut dice = Dice(3);
    let place = |k: i32| {
        let [x, y] = [k % 60, k / 60].map(|v| v * 100 + 20 + dice.below(60));
        let z = height(f64::from(x) / 100.0, f64::from(y) / 100.0, &mut dice);
        Point::new(x, y, (z * 100.0).round() as i32)
    };
    (0..3600).map(place).collect()
}

#[test]
fn a_crown_has_no_spikes_and_the_ground_beside_it_is_kept() {
    let in_crown = |x: f64, y: f64| (x - 30.0).hypot(y - 30.0) < 15.0;
    // One return of five is from below the crown.
    let points = field(|x, y, dice| match in_crown(x, y) {
        true if dice.below(5) == 0 => f64::from(dice.below(8)),
        true => 20.0 - (x - 30.0).hypot(y - 30.0) / 5.0,
        false => 0.0,
    });
    let with = |edge| made(&points, FreezeRule { edge, buffer: 0.5, step: METRES });
    let (free, plain) = (with(3.0), with(0.0));
    let (mut spikes, mut outside) = ([0, 0], 0);
    for (col, row) in (0..50 * 50).map(|k| (500 + k % 50 * 100, 500 + k / 50 * 100)) {
        let at = [f64::from(col), f64::from(row)];
        let away = (at[0] / 100.0 - 30.0).hypot(at[1] / 100.0 - 30.0);
        let [top, pitted] = [&free, &plain].map(|made| height(made, at[0], at[1]));
        if away < 12.5 {
            spikes[0] += u32::from(top < 1500.0);
            spikes[1] += u32::from(pitted < 1500.0);
        } else if away > 17.0 {
            assert_eq!(top, 0.0, "{at:?}");
            outside += 1;
        }
    }
    assert!(spikes[0] == 0 && spikes[1] > 100 && outside > 1000, "{spikes:?} {outside}");
}

#[test]
fn noise_below_the_buffer_is_kept_and_walls_stand() {
    let is_roof = |x: f64, y: f64| (20.0..40.0).contains(&x) && (20.0..40.0).contains(&y);
    let points = field(|x, y, dice| {
        let noise = f64::from(dice.below(49)) / 100.0;
        if is_roof(x, y) { 10.0 + noise } else { noise }
    });
    let with = |edge| made(&points, FreezeRule { edge, buffer: 0.5, step: METRES });
    let (free, plain) = (with(3.0), with(0.0));
    assert_eq!(
        free.points.len() + FRAME as usize,
        free.triangulation.positions(),
        "no point is left out"
    );
    let mut beside = 0;
    for (col, row) in (0..50 * 50).map(|k| (500 + k % 50 * 100, 500 + k / 50 * 100)) {
        let at = [f64::from(col) / 100.0, f64::from(row) / 100.0];
        let [top, other] = [&free, &plain].map(|made| height(made, col.into(), row.into()));
        let from_wall = at.map(|v| (v - 30.0).abs() - 10.0);
        let away = from_wall[0].max(from_wall[1]);
        if away.abs() > 2.5 {
            assert_eq!(top, other, "{at:?}");
            assert!((-1.0..=60.0).contains(&(top - if away < 0.0 { 1000.0 } else { 0.0 })));
        }
        beside += u32::from(away.abs() <= 2.5);
    }
    assert!(beside > 200, "{beside}");
}

#[test]
fn of_points_at_one_position_the_highest_counts() {
    let corner = [[0, 0], [40, 0], [0, 40], [40, 40]].map(|[x, y]| Point::new(x, y, 10));
    let mut points = corner.to_vec();
    points.extend([7, 900, -3].map(|z| Point::new(20, 20, z)));
    let made = made(&points, FreezeRule { edge: 0.0, buffer: 0.0, step: [1.0; 3] });
    assert_eq!(height(&made, 20.0, 20.0), 900.0);
    assert!(made.find(FixedPosition::from_steps(-9.0, 20.0), &mut 0, false).is_none());
}

#[test]
fn a_window_that_is_too_wide_is_refused_and_no_points_have_no_surface() {
    let freeze = FreezeRule { edge: 1.0, buffer: 0.5, step: [1.0; 3] };
    let of = |side: i32| {
        SpikeFree::new(Vec::new(), &SiteWindow { low: [0, 0], high: [side - 1, 5] }, freeze)
    };
    assert!(of((1 << 28) - 1).unwrap().find(FixedPosition::of([3, 3]), &mut 0, false).is_none());
    assert!(of(1 << 28).is_err());
}
