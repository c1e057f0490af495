//! Crossings mended, and arcs of coverages: plain simplification and the rest of it side by side, in
//! seconds of processor time.
//!
//! `cargo bench --bench line_topology [FILTER]`. With TERRANE_COAST_ALL and TERRANE_COAST_ALL_OFFSETS
//! naming a file of x, y pairs (little-endian f64) and one of ring starts (u64), those rings are done,
//! too. TOLERANCE is that of the rings, .01 unless told.

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{Criterion, criterion_group, criterion_main};
use terrane_line::arcs::CoverageArcs;
use terrane_line::metric::PlaneMetric;
use terrane_line::rdp::rdp;
use terrane_line::topology::{
    Chains, RetainedChainVertices, Strategy, UntangleOptions, refining, untangle,
};
use terrane_line::{SimplifyScratch, Xy};

/// Processor time of the thread, from Linux.
struct Processor;

impl Measurement for Processor {
    type Intermediate = Duration;
    type Value = Duration;

    fn start(&self) -> Duration {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("needs Linux");
        let nanoseconds = text.split(' ').next().and_then(|word| word.parse().ok());
        Duration::from_nanos(nanoseconds.expect("a number"))
    }

    fn end(&self, start: Duration) -> Duration {
        self.start() - start
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// A generator with a fixed seed (SplitMix64).
struct Dice(u64);

impl Dice {
    /// From -1 to 1.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Closed rings, flat.
struct Rings {
    points: Vec<Xy>,
    starts: Vec<usize>,
    closed: Vec<bool>,
}

impl Rings {
    fn new() -> Self {
        Self { points: vec![], starts: vec![0], closed: vec![] }
    }

    /// Adds a ring of which the first vertex is not repeated.
    fn push(&mut self, ring: &[Xy]) {
        self.points.extend_from_slice(ring);
        self.points.push(ring[0]);
        self.starts.push(self.points.len());
        self.closed.push(true);
    }

    fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }

    /// The rings that the environment names.
    fn named() -> Option<Self> {
        let read = |name| std::fs::read(std::env::var(name).ok()?).ok();
        let words = |bytes: Vec<u8>| -> Vec<u64> {
            bytes.chunks_exact(8).map(|w| u64::from_le_bytes(w.try_into().unwrap())).collect()
        };
        let bits = words(read("TERRANE_COAST_ALL")?);
        let starts = words(read("TERRANE_COAST_ALL_OFFSETS")?);
        let points = bits.chunks_exact(2).map(|p| [p[0], p[1]].map(f64::from_bits)).collect();
        let closed = vec![true; starts.len() - 1];
        Some(Self { points, starts: starts.into_iter().map(|s| s as usize).collect(), closed })
    }
}

/// A line whose segments are halved again and again, each middle moved to the side.
fn fractal(dice: &mut Dice, a: Xy, b: Xy, levels: u32) -> Vec<Xy> {
    let mut line = vec![a, b];
    for _ in 0..levels {
        let mut finer = Vec::with_capacity(2 * line.len());
        for pair in line.windows(2) {
            let [x, y] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let off = 0.25 * dice.signed();
            finer.push(pair[0]);
            finer.push([pair[0][0] + x / 2.0 - off * y, pair[0][1] + y / 2.0 + off * x]);
        }
        finer.push(b);
        line = finer;
    }
    line
}

/// Islands of all sizes, most of them small, in the cells of a grid.
fn archipelago(side: usize) -> Rings {
    let (mut dice, mut rings) = (Dice(1), Rings::new());
    for k in 0..side * side {
        let at = [k % side, k / side].map(|v| v as f64);
        let size = 0.35 * dice.signed().powi(6);
        let levels = if size > 0.1 { 9 } else { 2 };
        let corners = [[-size, 0.0], [0.0, -size], [size, 0.0], [0.0, size]];
        let mut ring = Vec::new();
        for i in 0..4 {
            let [a, b] = [corners[i], corners[(i + 1) % 4]].map(|c| [at[0] + c[0], at[1] + c[1]]);
            let mut line = fractal(&mut dice, a, b, levels);
            line.pop();
            ring.append(&mut line);
        }
        rings.push(&ring);
    }
    rings
}

/// The cells of a jittered grid with fractal borders, each ring from another start: 10.25 million
/// vertices for 100 cells a side and 8 levels.
fn coverage(side: usize, levels: u32) -> Rings {
    let mut dice = Dice(7);
    let mut jitter = |v: usize| v as f64 + 0.3 * dice.signed();
    let corners: Vec<Vec<Xy>> =
        (0..=side).map(|y| (0..=side).map(|x| [jitter(x), jitter(y)]).collect()).collect();
    let mut dice = Dice(8);
    let mut borders = |down: usize| -> Vec<Vec<Vec<Xy>>> {
        let line = |y: usize, x: usize, dice: &mut Dice| {
            fractal(dice, corners[y][x], corners[y + down][x + 1 - down], levels)
        };
        let (rows, columns) = (side + 1 - down, side + down);
        (0..rows).map(|y| (0..columns).map(|x| line(y, x, &mut dice)).collect()).collect()
    };
    let (flat, upright) = (borders(0), borders(1));
    let mut rings = Rings::new();
    for k in 0..side * side {
        let (x, y) = (k % side, k / side);
        let mut ring: Vec<Xy> = [&flat[y][x][1..], &upright[y][x + 1][1..]].concat();
        ring.extend(flat[y + 1][x].iter().rev().skip(1));
        ring.extend(upright[y][x].iter().rev().skip(1));
        let turn = k % ring.len();
        ring.rotate_left(turn);
        rings.push(&ring);
    }
    rings
}

/// Ramer-Douglas-Peucker on parts of chains.
fn method(points: &[Xy], tolerance: f64) -> impl FnMut(usize, u32, u32, &mut Vec<u32>) + '_ {
    let mut scratch = SimplifyScratch::default();
    refining(points, move |part, kept| rdp(&PlaneMetric, part, tolerance, &mut scratch, kept))
}

fn plain(chains: &Chains<'_>, tolerance: f64) -> RetainedChainVertices {
    RetainedChainVertices::simplified(chains, &mut method(chains.points, tolerance))
}

fn clean(chains: &Chains<'_>, tolerance: f64, strategy: Strategy) -> RetainedChainVertices {
    let options = UntangleOptions { strategy, ..UntangleOptions::default() };
    let mut refine = method(chains.points, tolerance);
    let kept = RetainedChainVertices::simplified(chains, &mut refine);
    untangle(chains, &kept, &[], &options, &mut refine).unwrap().kept
}

fn rings(c: &mut Criterion<Processor>, name: &str, rings: &Rings, tolerance: f64) {
    let mut group = c.benchmark_group(name);
    group.sample_size(10);
    let chains = rings.chains();
    group.bench_function("plain", |b| b.iter(|| black_box(plain(&chains, tolerance))));
    for strategy in [Strategy::Retroactive, Strategy::Proactive] {
        group.bench_function(format!("{strategy:?}"), |b| {
            b.iter(|| black_box(clean(&chains, tolerance, strategy)));
        });
    }
    group.finish();
}

fn coverages(c: &mut Criterion<Processor>) {
    let parts = coverage(100, 8);
    let mut group = c.benchmark_group("coverage of 10.25 M vertices");
    group.sample_size(10);
    group.bench_function("arcs", |b| b.iter(|| black_box(CoverageArcs::new(&parts.chains(), 0.0))));
    let whole = |snap: f64| {
        let arcs = CoverageArcs::new(&parts.chains(), snap).unwrap();
        arcs.rebuild(&clean(&arcs.chains(), 0.02, Strategy::Retroactive))
    };
    group.bench_function("arcs, simplified, clean, rebuilt", |b| b.iter(|| black_box(whole(0.0))));
    group.bench_function("the same, snapped", |b| b.iter(|| black_box(whole(1e-6))));
    group.finish();
}

fn archipelagos(c: &mut Criterion<Processor>) {
    rings(c, "archipelago", &archipelago(300), 0.01);
    let told = std::env::var("TOLERANCE").ok().and_then(|text| text.parse().ok());
    if let Some(named) = Rings::named() {
        rings(c, "coast", &named, told.unwrap_or(0.01));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(Processor);
    targets = archipelagos, coverages
}
criterion_main!(benches);
