//! The kernels one by one: tile triangulation, seam patch, synthetic terrain, mesh writing.
//!
//! `cargo bench --bench kernels [FILTER]`. Times of tiles, patches and terrain are for their
//! samples (`elem/s`), those of writing for the bytes of the file.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use terrane_base::bound::ErrorBound;
use terrane_base::geom::{Crs, Point3, Rect};
use terrane_mesh::{FORMATS, MeshBatch, MeshFormat, MeshHeader, Promises, SinkOptions};
use terrane_synth::{CHARACTERS, Terrain};
use terrane_tin::{
    HeightWindow, PatchInput, TileInput, TileMesh, TilePosition, TileScratch, TileTriangle,
    TinSpec, mend_patch, triangulate_tile,
};

/// Cells along the side of a tile.
const CELLS: u32 = 512;

/// Shares of the samples kept by greedy insertion alone.
const SHARES: [f64; 3] = [0.002, 0.01, 0.05];

/// Heights of a window far from the origin, where relief is neither all plain nor all ridge.
fn window(character: &str, cols: u32, rows: u32) -> Vec<f32> {
    let terrain = Terrain::parse(&format!("{character},size=4097,seed=7")).expect("a known name");
    let mut heights = vec![0.0; cols as usize * rows as usize];
    terrain.fill_f32(Rect::new(1536, 1536, cols, rows), &mut heights);
    heights
}

fn spec(tolerance: f64, drop: bool) -> TinSpec {
    TinSpec {
        tolerance,
        bound: ErrorBound::Samples,
        strict: false,
        drop,
        fit_heights: false,
        data_dependent: false,
        min_angle: None,
        single_precision: None,
        measure: false,
    }
}

/// A tile with more grid on the right, when `apron` is 1, and nothing else around it.
fn tile(heights: &[f32], width: u32, spec: &TinSpec, scratch: &mut TileScratch) -> TileMesh {
    let apron = width - CELLS - 1;
    let heights = HeightWindow { width, height: CELLS + 1, f32: heights, f64: None };
    let input = TileInput {
        heights,
        apron_left: 0,
        apron_right: apron,
        apron_above: 0,
        apron_below: 0,
        spacing: u32::MAX,
        kept: &[],
        lines: &[],
    };
    triangulate_tile(&input, spec, scratch)
}

/// The tolerance at which greedy insertion keeps a share of the tile's samples, by bisection.
fn tolerance_for(share: f64, heights: &[f32], scratch: &mut TileScratch) -> f64 {
    let wanted = share * heights.len() as f64;
    let (mut low, mut high) = (1e-3_f64, 1e3_f64);
    for _ in 0..24 {
        let middle = (low * high).sqrt();
        let kept = tile(heights, CELLS + 1, &spec(middle, false), scratch).vertices.len();
        (low, high) = if kept as f64 > wanted { (middle, high) } else { (low, middle) };
    }
    high
}

fn tiles(c: &mut Criterion) {
    let mut scratch = TileScratch::default();
    for character in ["rough", "smooth", "integer"] {
        let heights = window(character, CELLS + 1, CELLS + 1);
        let mut group = c.benchmark_group(format!("tile/{character}"));
        group.throughput(Throughput::Elements(heights.len() as u64)).sample_size(20);
        for share in SHARES {
            let tolerance = tolerance_for(share, &heights, &mut scratch);
            for (name, drop) in [("greedy", false), ("drop", true)] {
                let spec = spec(tolerance, drop);
                group.bench_function(format!("{name}/{}%", 100.0 * share), |b| {
                    b.iter(|| tile(black_box(&heights), CELLS + 1, &spec, &mut scratch));
                });
            }
        }
        group.finish();
    }
}

/// The strip of `2 * REACH` columns around the seam of two tiles, as the scheduler cuts it.
struct Seam {
    heights: Vec<f32>,
    triangles: Vec<TileTriangle>,
}

/// Columns of a patch on either side of its seam.
const REACH: u32 = CELLS / 2;

impl Seam {
    fn new(share: f64, scratch: &mut TileScratch) -> Self {
        let all = window("rough", 2 * CELLS + 1, CELLS + 1);
        let columns = |from: u32, count: u32| -> Vec<f32> {
            let rows = all.chunks_exact(2 * CELLS as usize + 1);
            rows.flat_map(|row| &row[from as usize..(from + count) as usize]).copied().collect()
        };
        let tolerance = tolerance_for(share, &columns(0, CELLS + 1), scratch);
        let spec = spec(tolerance, true);
        let left = tile(&columns(0, CELLS + 1), CELLS + 1, &spec, scratch);
        let right = tile(&columns(CELLS, CELLS + 1), CELLS + 1, &spec, scratch);
        let mut triangles = within(&left, REACH, CELLS, 0);
        triangles.extend(within(&right, 0, REACH, REACH));
        Self { heights: columns(CELLS - REACH, 2 * REACH + 1), triangles }
    }

    fn input(&self) -> PatchInput<'_> {
        let heights =
            HeightWindow { width: 2 * REACH + 1, height: CELLS + 1, f32: &self.heights, f64: None };
        let triangles = &self.triangles;
        PatchInput {
            vertices: &[],
            heights,
            triangles,
            seam_col: Some(REACH),
            seam_row: None,
            grid_ends: [false, false, true, true],
            spacing: u32::MAX,
            kept: &[],
            lines: &[],
        }
    }
}

/// The triangles of a tile within columns `from ..= to`, moved so that `from` becomes `place`.
fn within(mesh: &TileMesh, from: u32, to: u32, place: u32) -> Vec<TileTriangle> {
    let is_within = |t: &&TileTriangle| t.corners.iter().all(|p| (from..=to).contains(&p.col()));
    let moved = |t: &TileTriangle| {
        let corners = t.corners.map(|p| TilePosition::new(p.col() - from + place, p.row()));
        TileTriangle { corners, ..*t }
    };
    mesh.triangles.iter().filter(is_within).map(moved).collect()
}

fn seams(c: &mut Criterion) {
    let mut scratch = TileScratch::default();
    let mut group = c.benchmark_group("seam/rough");
    group.sample_size(20);
    for share in SHARES {
        let seam = Seam::new(share, &mut scratch);
        let tolerance = tolerance_for(share, &window("rough", CELLS + 1, CELLS + 1), &mut scratch);
        let spec = spec(tolerance, true);
        group.throughput(Throughput::Elements(seam.heights.len() as u64));
        group.bench_function(format!("{}%", 100.0 * share), |b| {
            b.iter(|| mend_patch(&black_box(&seam).input(), &spec, &mut scratch));
        });
    }
    group.finish();
}

fn terrain(c: &mut Criterion) {
    let rect = Rect::new(1536, 1536, 1024, 1024);
    let mut heights = vec![0.0; rect.len()];
    let mut group = c.benchmark_group("synth");
    group.throughput(Throughput::Elements(rect.len() as u64)).sample_size(20);
    for character in CHARACTERS {
        let terrain = Terrain::new(character);
        group.bench_function(character.name, |b| {
            b.iter(|| terrain.fill_f32(black_box(rect), &mut heights));
        });
    }
    group.finish();
}

/// A lattice of triangles in batches, as big as a mesh of 1 % of 4097^2.
struct Mesh {
    batches: Vec<(Vec<Point3>, Vec<[u64; 3]>)>,
}

/// Vertices along a row of the mesh, and rows.
const SIDE: u64 = 410;

/// Rows of vertices in a batch.
const BATCH: u64 = 41;

impl Mesh {
    fn new() -> Self {
        let rows = |first: u64| first * BATCH..(first + 1) * BATCH;
        let batch = |first: u64| {
            let vertices = rows(first).flat_map(|row| (0..SIDE).map(move |col| point(col, row)));
            let triangles = rows(first).filter(|&row| row > 0).flat_map(cells);
            (vertices.collect(), triangles.collect())
        };
        Self { batches: (0..SIDE / BATCH).map(batch).collect() }
    }

    /// Writes the mesh and returns the bytes of the file.
    fn write(&self, format: &MeshFormat, folder: &std::path::Path) -> u64 {
        let path = folder.join("mesh").with_extension(format.extensions[0]);
        let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
        let mut sink = (format.create)(&path, &header(), &options).expect("a writable folder");
        let wants_corners = sink.wants_corners();
        for (vertices, triangles) in &self.batches {
            let corners: Vec<[Point3; 3]> = match wants_corners {
                true => triangles.iter().map(|t| t.map(|id| point(id % SIDE, id / SIDE))).collect(),
                false => Vec::new(),
            };
            let batch = MeshBatch { vertices, values: &[], triangles, corners: &corners };
            sink.push(batch).expect("room on the disk");
        }
        sink.finish().expect("room on the disk")
    }
}

fn header() -> MeshHeader {
    let bounds = [point(0, SIDE - 1), point(SIDE - 1, 0)];
    let origin = [bounds[0][0], bounds[0][1], 0.0];
    MeshHeader {
        crs: Crs::default(),
        origin,
        scale: [1.0; 3],
        unit: None,
        bounds,
        promises: Promises::default(),
        channels: Vec::new(),
    }
}

fn point(col: u64, row: u64) -> Point3 {
    let (x, y) = (col as f64, row as f64);
    [500_000.0 + 100.0 * x, 5_000_000.0 - 100.0 * y, (x * 0.3).sin() * (y * 0.2).cos() * 200.0]
}

/// The triangles between a row of vertices and the one above it.
fn cells(row: u64) -> impl Iterator<Item = [u64; 3]> {
    (1..SIDE).flat_map(move |col| {
        let here = row * SIDE + col;
        let (above, before) = (here - SIDE, here - 1);
        [[before, here, above], [before, above, above - 1]]
    })
}

fn writing(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let mesh = Mesh::new();
    let mut group = c.benchmark_group("write");
    group.sample_size(20);
    for format in FORMATS {
        group.throughput(Throughput::Bytes(mesh.write(format, folder.path())));
        group.bench_function(format.name, |b| {
            b.iter_batched(|| (), |()| mesh.write(format, folder.path()), BatchSize::PerIteration);
        });
    }
    group.finish();
}

criterion_group!(kernels, tiles, seams, terrain, writing);
criterion_main!(kernels);
