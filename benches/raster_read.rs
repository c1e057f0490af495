//! Reading rate of compressed GeoTIFF, one thread: our decode path beside the `tiff` crate's, on
//! the same bytes; and of text grids. Criterion prints samples or bytes per second.
//!
//! With the arguments `read THREADS WIDTH HEIGHT FILE` it reads that file once, by windows of that
//! size, and prints the seconds; `benches/read_peers.py` compares them with GDAL's.

use std::fmt::Write;
use std::hint::black_box;
use std::io::Cursor;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use criterion::{Criterion, Throughput};
use terrane_base::geom::Rect;
use terrane_raster::{GridOpenOptions, GridSource, open};

#[path = "../tests/common/raster_support/tiff_builder.rs"]
#[allow(dead_code)]
mod tiff_builder;

use tiff_builder::Spec;

const SIDE: u32 = 2048;
const TILE: u32 = 512;

/// Rolling hills with small-scale roughness, in float32.
fn terrain(col: usize, row: usize, _band: usize) -> f64 {
    let (x, y) = (col as f64, row as f64);
    let noise = ((col * 7919 + row * 104_729) % 1013) as f64 / 1013.0;
    let height = 300.0 * (x * 0.004).sin() * (y * 0.003).cos() + 20.0 * (x * 0.05 + y * 0.03).sin();
    f64::from((height + noise) as f32)
}

fn specs() -> Vec<(&'static str, Spec)> {
    let spec = |compression, predictor, format, bits| {
        let mut spec = Spec::new(SIDE as usize, SIDE as usize, format, bits);
        (spec.compression, spec.predictor, spec.tile) = (compression, predictor, Some((256, 256)));
        spec
    };
    vec![
        ("float32 deflate predictor 3", spec(8, 3, 3, 32)),
        ("float32 zstd predictor 3", spec(50000, 3, 3, 32)),
        ("int16 deflate predictor 2", spec(8, 2, 2, 16)),
        ("int16 LZW predictor 2", spec(5, 2, 2, 16)),
        ("float32 none", spec(1, 1, 3, 32)),
    ]
}

/// Every sample once, tile by tile, as the TIN job reads.
fn read_tiles(source: &dyn GridSource, out: &mut [f32]) {
    for row in (0..SIDE).step_by(TILE as usize) {
        for col in (0..SIDE).step_by(TILE as usize) {
            source.read_f32(Rect::new(col, row, TILE, TILE), out).unwrap();
            source.release(Rect::new(col, row, TILE, TILE));
        }
    }
    black_box(&out);
}

fn ours(path: &Path, out: &mut [f32]) {
    let source = open(path.to_str().unwrap(), &GridOpenOptions::default()).unwrap();
    read_tiles(source.as_ref(), out);
}

fn tiff_crate(bytes: &[u8]) {
    let mut decoder = tiff::decoder::Decoder::new(Cursor::new(bytes)).unwrap();
    for chunk in 0..decoder.tile_count().unwrap() {
        black_box(decoder.read_chunk(chunk).unwrap());
    }
}

fn reading(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let mut out = vec![0.0; (TILE * TILE) as usize];
    for (name, spec) in specs() {
        let bytes = spec.build(terrain);
        let path = folder.path().join("t.tif");
        std::fs::write(&path, &bytes).unwrap();
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(u64::from(SIDE) * u64::from(SIDE)));
        group.sample_size(10);
        group.bench_function("terrane", |b| b.iter(|| ours(&path, &mut out)));
        group.bench_function("tiff crate", |b| b.iter(|| tiff_crate(&bytes)));
        group.finish();
    }
}

/// The terrain as text, with two decimals.
fn text() -> String {
    let mut text = format!("ncols {SIDE}\nnrows {SIDE}\nxllcorner 0\nyllcorner 0\ncellsize 1\n");
    for row in 0..SIDE as usize {
        for col in 0..SIDE as usize {
            let _ = write!(text, "{:.2} ", terrain(col, row, 0));
        }
        text.push('\n');
    }
    text
}

/// Opening parses every value, and so does reading.
fn text_grids(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let (text, path) = (text(), folder.path().join("t.asc"));
    std::fs::write(&path, &text).unwrap();
    let mut group = criterion.benchmark_group("text");
    group.throughput(Throughput::Bytes(text.len() as u64));
    group.sample_size(10);
    let open = || open(path.to_str().unwrap(), &GridOpenOptions::default()).unwrap();
    group.bench_function("open", |b| b.iter(|| black_box(open().info().sample_type)));
    let mut out = vec![0.0; (TILE * TILE) as usize];
    group.bench_function("open and read", |b| b.iter(|| read_tiles(open().as_ref(), &mut out)));
    group.finish();
}

/// Reads every sample of `file` once, by windows of `width` x `height` from `threads` threads, and
/// returns the seconds from opening on.
fn read_file(threads: usize, width: u32, height: u32, file: &str) -> f64 {
    let start = Instant::now();
    let source = open(file, &GridOpenOptions::default()).unwrap();
    let bounds = source.info().bounds();
    let rows = (0..bounds.height).step_by(height as usize);
    let at = |row| (0..bounds.width).step_by(width as usize).map(move |col| (col, row));
    let windows: Vec<_> =
        rows.flat_map(at).map(|(c, r)| Rect::new(c, r, width, height).intersect(&bounds)).collect();
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut out = vec![0.0; (width * height) as usize];
                while let Some(rect) = windows.get(next.fetch_add(1, Ordering::Relaxed)) {
                    source.read_f32(*rect, &mut out[..rect.len()]).unwrap();
                    source.release(*rect);
                    black_box(&out);
                }
            });
        }
    });
    start.elapsed().as_secs_f64()
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [verb, threads, width, height, file] = args.as_slice()
        && verb == "read"
    {
        let number = |text: &str| text.parse().unwrap();
        println!("{}", read_file(number(threads) as usize, number(width), number(height), file));
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    reading(&mut criterion);
    text_grids(&mut criterion);
    criterion.final_summary();
}
