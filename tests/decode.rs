//! Each compressed block of a grid is decoded about once, by every job, on any number of threads and in any memory that it
//! accepts.
//!
//! Blocks are counted for the whole process, so there is one test here.

#[path = "common/cli_support.rs"]
mod cli_support;

use std::path::Path;

use cli_support::Place;
use terrane::ErrorKind;
use terrane::prelude::*;

/// The most blocks decoded, of 100 blocks of the file. A block beside a thread that the system has stopped for a while may
/// be dropped before that thread reads it.
const MAX_PERCENT: u64 = 110;

/// Columns and rows of the grid: two rows of tiles are more than the cache holds in the smallest memory.
const SIZE: [u64; 2] = [8193, 641];

/// A job on the grid in a file, with threads and MiB of memory.
type RunJob = fn(&terrane::Grid, &Path, usize, u64) -> terrane::Result<()>;

/// Sets the resources of a job, and runs it.
macro_rules! run {
    ($job:expr, $threads:ident, $memory:ident, $output:expr) => {{
        let job = $job.threads($threads).memory($memory << 20).overwrite(true);
        job.write($output).map(drop)
    }};
}

/// Jobs of different reach and order.
const JOBS: [(&str, RunJob); 6] = [
    ("tin, tiles of the blocks", |grid, file, threads, memory| {
        let job = grid.tin().max_error(40.0).tile(128);
        run!(job, threads, memory, file.with_file_name("out.ply"))
    }),
    ("tin, other tiles", |grid, file, threads, memory| {
        let job = grid.tin().max_error(40.0).tile(100);
        run!(job, threads, memory, file.with_file_name("out.ply"))
    }),
    ("contour", |grid, file, threads, memory| {
        let job = grid.contour().interval(500.0).tile(96);
        run!(job, threads, memory, file.with_file_name("out.geojson"))
    }),
    ("convert", |grid, file, threads, memory| {
        run!(grid.convert(), threads, memory, file.with_file_name("out.flt"))
    }),
    ("convert to tiles", |grid, file, threads, memory| {
        let job = grid.convert().format("store");
        run!(job, threads, memory, file.with_file_name("out.store.tif"))
    }),
    ("slope", |grid, file, threads, memory| {
        run!(grid.slope(), threads, memory, file.with_file_name("out.tif"))
    }),
];

/// Blocks that `job` decodes.
fn decoded(job: RunJob, file: &Path, threads: usize, memory: u64) -> terrane::Result<u64> {
    let before = terrane_raster::decoded_blocks();
    job(&terrane::open(file)?, file, threads, memory)?;
    Ok(terrane_raster::decoded_blocks() - before)
}

/// The smallest memory in MiB that `job` accepts.
fn least_memory(job: RunJob, file: &Path) -> u64 {
    let grid = terrane::open(file).unwrap();
    let is_enough = |memory: &u64| match job(&grid, file, 1, *memory) {
        Ok(()) => true,
        Err(error) => {
            assert_eq!(error.kind(), ErrorKind::Resource, "{error}");
            false
        }
    };
    (4..200).find(is_enough).unwrap()
}

/// Writes the grid, and returns the number of its blocks.
fn write(place: &Place, name: &str, options: &[&str], [width, height]: [u64; 2]) -> u64 {
    let [across, down] = SIZE;
    let terrain = format!("synth:rough,width={across},height={down}");
    let options: Vec<&str> = options.iter().flat_map(|option| ["--co", option]).collect();
    place.ok(&[&["convert", &terrain, name][..], &options].concat());
    across.div_ceil(width) * down.div_ceil(height)
}

#[test]
fn each_block_is_decoded_once_in_any_memory() {
    let place = Place::new();
    let tiles =
        ["COMPRESS=DEFLATE", "PREDICTOR=3", "TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=128"];
    let strips = ["COMPRESS=ZSTD", "TILED=NO", "BLOCKYSIZE=24"];
    let files = [
        ("tiles.tif", write(&place, "tiles.tif", &tiles, [128, 128])),
        ("strips.tif", write(&place, "strips.tif", &strips, [SIZE[0], 24])),
    ];
    let mut faults = Vec::new();
    for (name, blocks) in files {
        let file = place.path(name);
        for (job_name, job) in JOBS {
            let least = least_memory(job, &file);
            for (threads, memory) in [(1, least), (3, least), (2, least + 8), (4, 400)] {
                let count = decoded(job, &file, threads, memory).unwrap();
                if count < blocks || 100 * count > MAX_PERCENT * blocks {
                    faults.push(format!(
                        "{name}, {job_name}, {threads} threads, {memory} MiB: {count} decoded of {blocks}"
                    ));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
