//! Scattered points: bins, whole triangulations beside those of spade, blocks, and queries.
//!
//! `POINTS=10000000 cargo bench --bench delaunay [FILTER]`; a million points unless told. Times are for
//! points, or for positions where they are asked for one by one (`elem/s`).

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use spade::Triangulation as _;
use terrane_base::geom::Point;
use terrane_delaunay::{
    ConvexHull, FixedPosition, LoadedPoints, Location, Natural, PointBins, SiteWindow,
    TriangleFinder, Triangulation, interpolate, stars,
};
use terrane_lidar::delaunay::triangulate;

/// Mean spacing of points in airborne data, in steps of a centimetre: 5.76 a square metre.
const SPACING: f64 = 41.7;

/// Steps of a cell.
const CELL: i32 = 100;

fn count() -> usize {
    std::env::var("POINTS").ok().and_then(|text| text.parse().ok()).unwrap_or(1_000_000)
}

/// A generator with a fixed seed (SplitMix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, most: i32) -> i32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) % most as u64) as i32
    }
}

/// Points anywhere, in any order.
fn uniform(n: usize) -> Vec<Point> {
    let mut dice = Dice(1);
    (0..n).map(|_| Point::new(dice.below(1 << 29), dice.below(1 << 29), dice.below(1000))).collect()
}

/// Points scan line by scan line, as they come from an aeroplane.
fn airborne(n: usize) -> Vec<Point> {
    let mut dice = Dice(2);
    let line = (n as f64).sqrt() as usize;
    let side = (line as f64 * SPACING) as i32;
    let y = |i: usize| ((i / line) as f64 * SPACING) as i32;
    (0..n).map(|i| Point::new(dice.below(side), y(i) + dice.below(60), dice.below(1000))).collect()
}

fn triangulations(c: &mut Criterion) {
    for (name, points) in [("uniform", uniform(count())), ("airborne", airborne(count()))] {
        let mut group = c.benchmark_group(format!("delaunay/{name}"));
        group.sample_size(10).throughput(Throughput::Elements(points.len() as u64));
        group.bench_function("one thread", |b| b.iter(|| Triangulation::new(&points)));
        group.bench_function("all threads", |b| b.iter(|| triangulate(&points)));
        group.bench_function("spade bulk_load", |b| {
            b.iter(|| {
                let sites = points.iter().map(|p| spade::Point2::new(p.x.into(), p.y.into()));
                let sites: Vec<spade::Point2<f64>> = sites.collect();
                spade::DelaunayTriangulation::<_>::bulk_load(sites).map(|t| t.num_inner_faces())
            });
        });
        group.finish();
    }
}

fn parts(c: &mut Criterion) {
    let points = airborne(count());
    let bins = PointBins::new(&points);
    let hull = ConvexHull::of(points.clone());
    let space = LoadedPoints::whole(&bins);
    let window = bins.window();
    let mut group = c.benchmark_group("parts");
    group.sample_size(10).throughput(Throughput::Elements(points.len() as u64));
    group.bench_function("bins", |b| b.iter(|| PointBins::new(&points)));
    group.bench_function("hull", |b| b.iter(|| ConvexHull::of(points.clone())));
    group.bench_function("blocks", |b| {
        b.iter(|| {
            let mut triangles = 0;
            for block in blocks(&window) {
                let owned =
                    stars(&space, &hull, &block, &[]).expect("few points").expect("all known");
                triangles += owned.len();
            }
            triangles
        });
    });
    group.finish();
}

/// Blocks of about 40,000 points.
fn blocks(window: &SiteWindow) -> impl Iterator<Item = SiteWindow> {
    let side = (SPACING * 200.0) as i32;
    let ([left, low], [right, high]) = (window.low, window.high);
    let rows = move |x: i32| (low..=high).step_by(side as usize).map(move |y| [x, y]);
    let corners = (left..=right).step_by(side as usize).flat_map(rows);
    corners.map(move |low| SiteWindow { low, high: low.map(|v| v + side - 1) })
}

fn queries(c: &mut Criterion) {
    let points = airborne(count());
    let bins = PointBins::new(&points);
    let hull = ConvexHull::of(points.clone());
    let space = LoadedPoints::whole(&bins);
    let side = bins.window().high[0] / CELL;
    let centre =
        |i: i32| FixedPosition::of([i % side * CELL + CELL / 2, i / side * CELL + CELL / 2]);
    let mut group = c.benchmark_group("cells");
    group.sample_size(10).throughput(Throughput::Elements((side * side) as u64));
    group.bench_function("linear", |b| {
        b.iter(|| {
            let mut finder = TriangleFinder::new(&space, &hull);
            let mut sum = 0.0;
            for q in (0..side * side).map(centre) {
                if let Ok(Location::Triangle(corners)) = finder.find(q) {
                    sum += interpolate(&corners, q);
                }
            }
            black_box(sum)
        });
    });
    group.bench_function("natural", |b| {
        b.iter(|| {
            let mut natural = Natural::new(&space, &hull, &bins.window()).expect("few points");
            let heights = (0..side * side).map(|i| natural.height(centre(i)));
            black_box(heights.flatten().flatten().flatten().sum::<f64>())
        });
    });
    group.finish();
}

criterion_group!(benches, triangulations, parts, queries);
criterion_main!(benches);
