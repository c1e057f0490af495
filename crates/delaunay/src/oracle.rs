//! Slow, obvious twins and awkward point sets, for tests.

use super::predicates::{Site, in_circle, orient};
use terrane_base::geom::Point;

/// All Delaunay triangles, by trying every triple against every site: n^4.
pub(super) fn triangles(points: &[Point]) -> Vec<[Point; 3]> {
    let mut points = points.to_vec();
    points.sort();
    points.dedup_by_key(|p| [p.x, p.y]);
    let site = |p: &Point| -> Site { [p.x, p.y] };
    let mut found = vec![];
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate().skip(i + 1) {
            for c in &points[j + 1..] {
                let corners = match orient(site(a), site(b), site(c)) {
                    0 => continue,
                    area if area > 0 => [*a, *b, *c],
                    _ => [*a, *c, *b],
                };
                let [p, q, r] = corners.map(|p| site(&p));
                let mut others = points.iter().filter(|d| !corners.contains(d));
                if !others.any(|d| in_circle(p, q, r, site(d))) {
                    found.push(corners);
                }
            }
        }
    }
    found.sort();
    found
}

/// A small generator, so that sets are the same on every machine.
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn below(&mut self, most: i32) -> i32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) % most as u64) as i32
    }

    fn point(&mut self, most: i32) -> Point {
        Point::new(self.below(most), self.below(most), self.below(1000))
    }
}

/// Point sets that find mistakes, of about `n` points each, by name.
pub(super) fn awkward(n: i32) -> Vec<(&'static str, Vec<Point>)> {
    let mut dice = Dice(n as u64);
    let side = (f64::from(n)).sqrt() as i32;
    let mut set = |make: &mut dyn FnMut(i32, &mut Dice) -> Point| -> Vec<Point> {
        (0..n).map(|i| make(i, &mut dice)).collect()
    };
    let circle = |i: i32, radius: f64| {
        let angle = f64::from(i) * 2.399963;
        Point::new((radius * angle.cos()) as i32, (radius * angle.sin()) as i32, i)
    };
    vec![
        ("uniform", set(&mut |_, d| d.point(100_000))),
        ("lattice", set(&mut |i, _| Point::new(i % side * 10, i / side * 10, i))),
        ("dense with duplicates", set(&mut |_, d| d.point(side))),
        ("line along x", set(&mut |i, _| Point::new(i * 7, 5, i))),
        ("line along y", set(&mut |i, _| Point::new(5, i * 7, i))),
        ("slanted line", set(&mut |i, _| Point::new(i * 3, i * 2, i))),
        ("line and one", set(&mut |i, _| Point::new(i * 3, if i == 3 { 40 } else { 0 }, i))),
        ("circle", set(&mut |i, _| circle(i, 50_000.0))),
        ("exact circle", set(&mut |i, _| on_circle(i as usize))),
        (
            "clusters",
            set(&mut |_, d| {
                let (x, y) = (d.below(4) * 200_000, d.below(4) * 100_000);
                Point::new(x + d.below(300), y + d.below(300), 1)
            }),
        ),
        (
            "voids",
            set(&mut |_, d| loop {
                let p = d.point(20_000);
                if p.x / 4_000 % 2 == 0 || p.y / 5_000 % 2 == 0 {
                    return p;
                }
            }),
        ),
        (
            "all of the reach",
            set(&mut |_, d| {
                let far = |v: i32| v - terrane_base::geom::REACH;
                let p = d.point(terrane_base::geom::REACH);
                Point::new(far(p.x) + p.y, p.y, 0)
            }),
        ),
        (
            "rotated strip",
            set(&mut |_, d| {
                let (u, v) = (d.below(50_000), d.below(900));
                Point::new(u * 4 - v * 3, u * 3 + v * 4, 2)
            }),
        ),
        ("parabola", set(&mut |i, _| Point::new(i - n / 2, (i - n / 2) * (i - n / 2), i))),
        (
            "cross",
            set(&mut |i, _| match i % 2 {
                0 => Point::new(i * 5 - n, 0, 0),
                _ => Point::new(0, i * 3 - n, 0),
            }),
        ),
    ]
}

/// One of the 108 lattice points at distance 1105 of the origin.
fn on_circle(i: usize) -> Point {
    let radius = 1105i32;
    let all = (-radius..=radius).flat_map(|x| {
        let rest = radius * radius - x * x;
        let y = f64::from(rest).sqrt() as i32;
        [y, -y].into_iter().filter(move |y| y * y == rest).map(move |y| Point::new(x, y, x))
    });
    all.cycle().nth(i * 5 % 108).unwrap()
}
