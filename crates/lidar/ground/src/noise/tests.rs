//! Methods beside slow twins that look at all points for each.

use proptest::prelude::*;

use super::*;
use crate::neighbors::{Bounds, bounds};

/// Parts of a cloud around one of them.
struct Others {
    space: MetricSpace,
    own: Bounds,
    /// The furthest first.
    left: Vec<Vec<Point>>,
    current: Vec<Point>,
}

impl Others {
    fn of(space: MetricSpace, parts: &[Vec<Point>], own: usize) -> Self {
        let of = |part: &[Point]| bounds(part.iter().copied()).unwrap();
        let around = of(&parts[own]);
        let others = parts.iter().enumerate().filter(|(i, _)| *i != own).map(|(_, part)| part);
        let mut left: Vec<_> = others.cloned().collect();
        left.sort_by(|a, b| space.gap(around, of(b)).total_cmp(&space.gap(around, of(a))));
        Self { space, own: around, left, current: Vec::new() }
    }
}

impl NeighborParts for Others {
    fn next(&mut self, within: f64) -> Option<Bounds> {
        let next = bounds(self.left.last()?.iter().copied())?;
        if self.space.gap(self.own, next) >= within {
            return None;
        }
        self.current = self.left.pop()?;
        Some(next)
    }

    fn load(&mut self, points: &mut Vec<Point>) -> Result<()> {
        points.extend_from_slice(&self.current);
        Ok(())
    }
}

/// Points with their numbers, in boxes of so many steps.
fn parts(points: &[Point], side: i32) -> Vec<Vec<(usize, Point)>> {
    let mut all: Vec<_> = points.iter().copied().enumerate().collect();
    let key = |p: &Point| [p.x, p.y, p.z].map(|steps| steps.div_euclid(side));
    all.sort_by_key(|(i, p)| (key(p), *i));
    all.chunk_by(|(_, a), (_, b)| key(a) == key(b)).map(<[_]>::to_vec).collect()
}

/// The scores of all, part by part.
fn scores(asked: &Request, space: MetricSpace, points: &[Point], side: i32) -> Vec<u64> {
    let parts = parts(points, side);
    let places: Vec<Vec<Point>> =
        parts.iter().map(|part| part.iter().map(|(_, point)| *point).collect()).collect();
    let mut all = vec![u64::MAX; points.len()];
    for (own, part) in parts.iter().enumerate() {
        let mut others = Others::of(space, &places, own);
        let found = asked.scores(&space, &places[own], &mut others).unwrap();
        for ((i, _), score) in part.iter().zip(found) {
            all[*i] = score;
        }
    }
    all
}

/// Which points are noise, by the scores of all.
fn noise(asked: &Request, scores: &[u64]) -> Vec<bool> {
    let mut sums = ScoreSums::default();
    scores.iter().for_each(|score| sums.add(*score));
    let limit = asked.limit(&sums);
    scores.iter().map(|score| limit.is_noise(*score)).collect()
}

/// Points that have few others in the cubes around theirs, all counted for each.
fn alone(space: &MetricSpace, points: &[Point], side: f64, most: usize) -> Vec<bool> {
    let cube = |p: &Point| {
        let steps = [p.x, p.y, p.z];
        [0, 1, 2].map(|i| {
            let side = (side / space.step[i]).round();
            ((f64::from(steps[i]) + space.zero[i] as f64) / side).floor()
        })
    };
    let is_beside = |a: &Point, b: &Point| {
        let [a, b] = [cube(a), cube(b)];
        (0..3).all(|i| (a[i] - b[i]).abs() <= 1.0)
    };
    let near = |p: &Point| points.iter().filter(|other| is_beside(p, other)).count();
    points.iter().map(|p| near(p) <= most).collect()
}

/// The mean distances of all points to `k` others, each by sorting all, in metres.
fn means(space: &MetricSpace, points: &[Point], k: usize) -> Vec<f64> {
    let far = |a: &Point, b: &Point| {
        let along = |a: i32, b: i32, step: f64| (f64::from(a) - f64::from(b)) * step;
        let [x, y, z] = space.step;
        along(a.x, b.x, x).hypot(along(a.y, b.y, y)).hypot(along(a.z, b.z, z))
    };
    let mean = |i: usize| {
        let others = (0..points.len()).filter(|j| *j != i);
        let mut all: Vec<f64> = others.map(|j| far(&points[i], &points[j])).collect();
        all.sort_by(f64::total_cmp);
        all.truncate(k);
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    (0..points.len()).map(mean).collect()
}

/// Points in a layer, with some far from it and some there twice.
fn cloud(seed: u64, count: usize, extent: i32, height: i32) -> Vec<Point> {
    let mut state = seed;
    let mut random = move |below: i32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (state >> 33) as i32 % below.max(1)
    };
    let mut points: Vec<Point> = Vec::new();
    for i in 0..count {
        let twice = (i % 9 == 8).then(|| points[random(i as i32) as usize]);
        let far = if i % 31 == 30 { 60_000 } else { 1 };
        let [x, y] = [0; 2].map(|_| random(extent) * far - extent / 2);
        points.push(twice.unwrap_or(Point { x, y, z: random(height) * far }));
    }
    points
}

fn space(step: [f64; 3], zero: [i64; 3]) -> MetricSpace {
    MetricSpace { step, zero }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn noise_is_that_of_slow_twins(
        seed in 0_u64..1_000_000, count in 0_usize..400, extent in 1_i32..3000, height in 1_i32..900,
        side in prop::sample::select(vec![7_i32, 200, 1100, 1 << 30]),
        k in 1_usize..12, cube in prop::sample::select(vec![0.01, 0.5, 3.0, 47.0]),
        most in 1_usize..9, zero in -5000_i64..5000, high in 1_u32..4,
    ) {
        let points = cloud(seed, count, extent, height);
        let space = space([0.01, 0.01, 0.01 / f64::from(high)], [zero, 2 * zero, -zero]);
        let asked = Request::parse(&format!("voxel:step={cube},isolated={most}")).unwrap();
        let found = noise(&asked, &scores(&asked, space, &points, side));
        prop_assert_eq!(found, alone(&space, &points, cube, most));
        let asked = Request::parse(&format!("statistical:k={k}")).unwrap();
        let found = scores(&asked, space, &points, side);
        for (score, mean) in found.iter().zip(means(&space, &points, k)) {
            let own = *score as f64 * space.unit();
            prop_assert!((own - mean).abs() <= 0.51 * space.unit() + 1e-9 * mean, "{own} {mean}");
        }
        // However it is divided.
        prop_assert_eq!(&found, &scores(&asked, space, &points, 501));
    }
}

#[test]
fn few_points_are_no_outliers_and_are_alone() {
    let space = space([0.01; 3], [0; 3]);
    let statistical = Request::parse("statistical:k=8,m=0").unwrap();
    for count in 0..3 {
        let points = cloud(7, count, 100_000, 10);
        let found = scores(&statistical, space, &points, 50);
        assert!(noise(&statistical, &found).iter().all(|is| !is), "{found:?}");
        let found = noise(&Request::DEFAULT, &scores(&Request::DEFAULT, space, &points, 50));
        assert!(found.iter().all(|is| *is));
    }
    let same = vec![Point::new(3, 4, 5); 300];
    assert_eq!(scores(&statistical, space, &same, 50), vec![0; 300]);
    assert!(
        noise(&Request::DEFAULT, &scores(&Request::DEFAULT, space, &same, 50)).iter().all(|is| !is)
    );
}

#[test]
fn a_lattice_has_no_outliers_and_a_bird_above_it_is_one() {
    let space = space([0.5, 0.5, 0.01], [0; 3]);
    let mut points: Vec<Point> = (0..900).map(|i| Point::new(i % 30, i / 30, 0)).collect();
    let asked = Request::parse("statistical:k=2,m=3,class=18").unwrap();
    let found = scores(&asked, space, &points, 8);
    assert!(noise(&asked, &found).iter().all(|is| !is));
    points.push(Point::new(15, 15, 900_000));
    let found = scores(&asked, space, &points, 8);
    assert_eq!(noise(&asked, &found).iter().filter(|is| **is).count(), 1);
    let mean = found[900] as f64 * space.unit();
    assert!((mean - (9000.0 + 9000.0_f64.hypot(0.5)) / 2.0).abs() < 1e-3, "{mean}");
    assert_eq!((asked.class(), Request::DEFAULT.class()), (18, 7));
}

#[test]
fn parameters_are_read_and_refused_by_name() {
    for method in METHODS {
        let plain = Request::plain(method);
        assert_eq!(Request::parse(method.name).unwrap(), plain);
        assert_eq!(Request::parse(&plain.to_string()).unwrap(), plain, "{plain}");
    }
    let told = |text: &str| Request::parse(text).unwrap_err().to_string();
    assert!(told("moss").contains("known methods are voxel, statistical"), "{}", told("moss"));
    assert!(told("voxel:class=8").contains("class=7 (7 or 18)"), "{}", told("voxel:class=8"));
    assert!(told("statistical:k=0").contains("k=8 (a whole number from 1 to 100)"));
    let coarse = MetricSpace { step: [5.0, 0.01, 0.01], zero: [0; 3] };
    assert!(
        Request::DEFAULT
            .reach(&coarse)
            .unwrap_err()
            .to_string()
            .contains("smaller than the coordinate resolution")
    );
    assert!(Request::DEFAULT.is_local() && !Request::parse("statistical").unwrap().is_local());
}
