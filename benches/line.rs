//! Simplification of lines: every method on a coast, beside a plain scalar loop and the `geo` crate, and
//! on lines that are the worst for plain splits.
//!
//! `cargo bench --bench line [FILTER]` takes a fractal line of a million vertices from a seed;
//! `TERRANE_COAST=FILE` a line from a file instead (little-endian f64, x and y of each vertex), with
//! tolerances for degrees, which TERRANE_COAST_OFFSETS=FILE (starts, little-endian u64) divides into several
//! for hierarchies. Times are for vertices of the input (`elem/s`). With TERRANE_LINE_RACE one method
//! runs once, see `line/race.rs`.

#[path = "line/race.rs"]
mod race;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group};
use geo::{Simplify as _, SimplifyVw as _};
use terrane_line::visvalingam::{AreaWeight, EffectiveAreas};
use terrane_line::{
    GeographicMetric, Hierarchy, LocatedVertex, METHODS, PlaneMetric, SimplifyScratch,
    VerticalMetric, Xy,
};

/// Doublings of the synthetic coast.
const DOUBLINGS: u32 = 20;

/// Tolerances, for coordinates in degrees.
const TOLERANCES: [f64; 3] = [0.001, 0.01, 0.1];

/// A number between -1 and 1 for each place (SplitMix64).
fn noise(place: u64) -> f64 {
    let mut v = place.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (v ^ (v >> 31)) as f64 / (1_u64 << 63) as f64 - 1.0
}

/// A fractal line 100 degrees long: midpoints displaced across their segments, less by each doubling.
fn fractal() -> Vec<Xy> {
    let mut line: Vec<Xy> = vec![[0.0, 0.0], [100.0, 0.0]];
    for level in 0..DOUBLINGS {
        let middle = |(i, pair): (usize, &[Xy])| {
            let (a, b) = (pair[0], pair[1]);
            let aside = 0.35 * noise(u64::from(level) << 40 | i as u64);
            let along = [b[0] - a[0], b[1] - a[1]];
            let x = (a[0] + b[0]) * 0.5 - along[1] * aside;
            [a, [x, (a[1] + b[1]) * 0.5 + along[0] * aside]]
        };
        let last = line[line.len() - 1];
        line = line.windows(2).enumerate().flat_map(middle).chain([last]).collect();
    }
    line
}

fn coast() -> Vec<Xy> {
    let Some(path) = std::env::var_os("TERRANE_COAST") else { return fractal() };
    let bytes = std::fs::read(path).expect("a file of vertices");
    let number = |at: &[u8]| f64::from_le_bytes(at.try_into().expect("eight bytes"));
    bytes.chunks_exact(16).map(|at| [number(&at[..8]), number(&at[8..])]).collect()
}

/// Ramer-Douglas-Peucker as a plain scalar loop.
fn plain(line: &[Xy], tolerance: f64) -> Vec<u32> {
    let mut keeps = vec![false; line.len()];
    let last = line.len() - 1;
    (keeps[0], keeps[last]) = (true, true);
    let mut parts = vec![(0, last)];
    while let Some((start, end)) = parts.pop() {
        let (a, b) = (line[start], line[end]);
        let d = [b[0] - a[0], b[1] - a[1]];
        let square = d[0] * d[0] + d[1] * d[1];
        let unit = if square > 0.0 { 1.0 / square } else { 0.0 };
        let mut worst = (start, tolerance * tolerance);
        for (i, p) in line.iter().enumerate().take(end).skip(start + 1) {
            let q = [p[0] - a[0], p[1] - a[1]];
            let t = ((q[0] * d[0] + q[1] * d[1]) * unit).clamp(0.0, 1.0);
            let e = [q[0] - t * d[0], q[1] - t * d[1]];
            let distance = e[0] * e[0] + e[1] * e[1];
            if distance > worst.1 {
                worst = (i, distance);
            }
        }
        if worst.0 > start {
            keeps[worst.0] = true;
            parts.extend([(start, worst.0), (worst.0, end)]);
        }
    }
    (0..line.len() as u32).filter(|i| keeps[*i as usize]).collect()
}

fn methods(c: &mut Criterion) {
    let line = coast();
    let peer = geo::LineString::from(line.clone());
    let located: Vec<LocatedVertex> = line.iter().map(|at| LocatedVertex::new(*at)).collect();
    let mut scratch = SimplifyScratch::default();
    let mut group = c.benchmark_group("coast");
    group.sample_size(10).throughput(Throughput::Elements(line.len() as u64));
    for tolerance in TOLERANCES {
        group.bench_function(BenchmarkId::new("plain loop", tolerance), |b| {
            b.iter(|| plain(&line, tolerance));
        });
        for method in METHODS.iter().filter(|method| !method.name.contains("visvalingam")) {
            group.bench_function(BenchmarkId::new(method.name, tolerance), |b| {
                b.iter(|| {
                    let mut kept = Vec::new();
                    (method.plane)(&PlaneMetric, &line, tolerance, &mut scratch, &mut kept);
                    kept
                });
            });
        }
        group.bench_function(BenchmarkId::new("cone in metres", tolerance), |b| {
            let cone = METHODS[0].geographic;
            b.iter(|| {
                let mut kept = Vec::new();
                cone(&GeographicMetric, &located, tolerance * 111e3, &mut scratch, &mut kept);
                kept
            });
        });
        group.bench_function(BenchmarkId::new("geo", tolerance), |b| {
            b.iter(|| peer.simplify(tolerance));
        });
    }
    group.bench_function("visvalingam", |b| {
        b.iter(|| EffectiveAreas::of_line(&PlaneMetric, &line, AreaWeight::Plain));
    });
    group.bench_function("visvalingam geo", |b| b.iter(|| peer.simplify_vw(1e-4)));
    group.finish();
}

fn hierarchies(c: &mut Criterion) {
    let points = coast();
    let starts = race::starts(points.len());
    let make = || -> Vec<Hierarchy> {
        starts
            .windows(2)
            .map(|ends| Hierarchy::new(&PlaneMetric, &points[ends[0]..ends[1]]))
            .collect()
    };
    let all = make();
    let mut group = c.benchmark_group("hierarchy");
    group.sample_size(10).throughput(Throughput::Elements(points.len() as u64));
    group.bench_function("make", |b| b.iter(make));
    for tolerance in TOLERANCES {
        group.bench_function(BenchmarkId::new("filter", tolerance), |b| {
            let mut kept = Vec::new();
            b.iter(|| {
                kept.clear();
                all.iter().for_each(|hierarchy| hierarchy.filter(tolerance, &mut kept));
                kept.len()
            });
        });
    }
    let bytes: Vec<Vec<u8>> = all.iter().map(Hierarchy::to_bytes).collect();
    group.bench_function("load", |b| {
        b.iter(|| {
            let load = |bytes: &Vec<u8>| Hierarchy::from_bytes(black_box(bytes));
            bytes.iter().map(load).collect::<Result<Vec<_>, _>>()
        });
    });
    group.finish();
}

/// A million vertices on which plain splits take off one vertex at a time, and a profile.
fn worst_cases(c: &mut Criterion) {
    let count = 1_000_000;
    let sign = |i: u32| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let spiral = |i: u32| {
        let (turn, radius) = (f64::from(i) * 0.01, 1e4 - f64::from(i) * 0.01);
        [radius * turn.cos(), radius * turn.sin()]
    };
    let arc = |i: u32| (f64::from(i) * 3e-6).sin_cos().into();
    let lines: [(&str, f64, Vec<Xy>); 4] = [
        ("zigzag", 0.5, (0..count).map(|i| [f64::from(i), sign(i)]).collect()),
        (
            "growing zigzag",
            0.5,
            (0..count).map(|i| [f64::from(i), f64::from(i) * sign(i)]).collect(),
        ),
        ("spiral", 0.5, (0..count).map(spiral).collect()),
        ("arc", 0.0, (0..count).map(arc).collect()),
    ];
    let mut scratch = SimplifyScratch::default();
    let mut group = c.benchmark_group("worst");
    group.sample_size(10).throughput(Throughput::Elements(u64::from(count)));
    for (name, tolerance, line) in &lines {
        for method in METHODS.iter().filter(|method| !method.name.contains("visvalingam")) {
            group.bench_function(BenchmarkId::new(method.name, name), |b| {
                b.iter(|| {
                    let mut kept = Vec::new();
                    (method.plane)(&PlaneMetric, line, *tolerance, &mut scratch, &mut kept);
                    kept
                });
            });
        }
    }
    let mut height = 0.0;
    let profile = (0..count).map(|i| {
        height += noise(u64::from(i));
        [f64::from(i), height]
    });
    let profile: Vec<Xy> = profile.collect();
    let cone = METHODS[0];
    group.bench_function("profile, vertical distance", |b| {
        b.iter(|| {
            let mut kept = Vec::new();
            (cone.vertical)(&VerticalMetric, &profile, 5.0, &mut scratch, &mut kept);
            kept
        });
    });
    group.bench_function("profile, distance in the plane", |b| {
        b.iter(|| {
            let mut kept = Vec::new();
            (cone.plane)(&PlaneMetric, &profile, 5.0, &mut scratch, &mut kept);
            kept
        });
    });
    group.finish();
}

criterion_group!(benches, methods, hierarchies, worst_cases);

fn main() {
    if !race::is_from_env(&coast()) {
        benches();
        Criterion::default().configure_from_args().final_summary();
    }
}
