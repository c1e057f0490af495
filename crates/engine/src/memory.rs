//! Division of the memory budget (`--memory`) of a job that works on a grid tile by tile.
//!
//! | share | bytes |
//! |---|---|
//! | program: code, stacks, buffers of the writer | [`PROGRAM`]: 16 MiB, 20 MiB in debug builds |
//! | each worker: the largest need of a tile | given by the job |
//! | cache of decoded blocks of the input: half of the rest, at most 1 GiB | [`MemoryShares::cache`] |
//! | unfinished mesh and data waiting for the writer: 7/8 of what is then left | [`MemoryShares::mesh`] |
//! | fragmentation of the heap: the last 1/8 | |
//!
//! Workers come first, as many as leave the cache a block at work each. Their memory cannot be spilled, so one too many
//! would exceed the budget. Blocks that do not fit into the cache are spilled, as is mesh that does not fit: that takes a
//! tenth of the time of decoding a block, so a worker is worth more than a large cache. The output does not depend on the
//! division.

use crate::Resources;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud as cloud;
use terrane_raster::{self as raster, GridOpenOptions, GridSource, Inputs};

/// Bytes for the program itself: code, stacks, buffers of the writer.
pub const PROGRAM: u64 = if cfg!(debug_assertions) { 20 << 20 } else { 16 << 20 };
/// Minimum bytes that [`beside_program`] returns, unless the budget is smaller.
const MIN_BESIDE: u64 = 4 << 20;
/// Minimum bytes for cache and mesh together.
const MIN_SHARED: u64 = 6 << 20;
/// Maximum bytes for decoded blocks: tiles are processed row by row, so older rows of blocks are not read again.
const MAX_CACHE: u64 = 1 << 30;

/// The part of the budget `memory` that the program itself leaves: at least 4 MiB, or all of a smaller budget.
pub fn beside_program(memory: u64) -> u64 {
    memory.saturating_sub(PROGRAM).max(memory.min(MIN_BESIDE))
}

/// Bytes for decoded blocks of a grid that a job with the budget `memory` reads in addition to its main input.
pub fn cache_beside(memory: u64) -> usize {
    usize::try_from(beside_program(memory) / 4).unwrap_or(usize::MAX)
}

/// One in `SLACK` bytes of unfinished mesh, or of other data in memory, is reserved for fragmentation of the heap.
const SLACK: u64 = 8;

/// The budget for `bytes` bytes of data, including the share for fragmentation.
pub fn with_slack(bytes: u64) -> u64 {
    bytes + bytes / (SLACK - 1)
}

/// The inverse of [`with_slack`]: the bytes of data in a budget with the share for fragmentation.
pub fn without_slack(budget: u64) -> u64 {
    budget - budget / SLACK
}

/// A divided budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryShares {
    /// Workers that fit, at least 1.
    pub threads: usize,
    /// Bytes for decoded blocks of the input.
    pub cache: u64,
    /// Bytes for unfinished mesh and data waiting for the writer.
    pub mesh: u64,
}

/// The smallest budget in bytes for one worker of `worker` bytes and an input with decoded blocks of `block` bytes.
pub fn least(worker: u64, block: u64) -> u64 {
    // Twice the block, as the cache takes half of what workers leave.
    PROGRAM + worker + MIN_SHARED.max(2 * block)
}

/// The smallest budget in bytes with which workers of `workers` bytes in all leave `waiting` bytes of
/// [`MemoryShares::mesh`].
pub fn least_with(workers: u64, waiting: u64) -> u64 {
    // Twice, as the cache takes half of what workers leave.
    let shared = MIN_SHARED.max(with_slack(waiting).saturating_mul(2));
    PROGRAM.saturating_add(workers).saturating_add(shared)
}

/// Divides `memory` among up to `threads` workers of `worker` bytes each. Fails with [`ErrorKind::Resource`] if not
/// even one fits; the error states the required memory.
pub fn divide(memory: u64, threads: usize, worker: u64) -> Result<MemoryShares> {
    divide_beside(memory, 0, threads, worker)
}

/// As [`divide`], with `reserved` bytes of the budget already in use for the whole job.
fn divide_beside(memory: u64, reserved: u64, threads: usize, worker: u64) -> Result<MemoryShares> {
    let least = least(worker, 0).saturating_add(reserved);
    if memory < least {
        return Err(too_little(memory, least));
    }
    let memory = memory - reserved;
    // No underflow: `least` is the sum of these and one worker, and was compared with the memory.
    let fitting = (memory - PROGRAM - MIN_SHARED) / worker.max(1);
    let threads = threads.clamp(1, usize::try_from(fitting).unwrap_or(usize::MAX).max(1));
    let rest = memory - PROGRAM - worker * threads as u64;
    let cache = (rest / 2).min(MAX_CACHE);
    let mesh = rest - cache;
    Ok(MemoryShares { threads, cache, mesh: without_slack(mesh) })
}

/// Adds a smaller tile to the remedy of an error for too little memory, as workers then need less.
pub fn or_smaller_tiles(error: Error) -> Error {
    if error.kind() == ErrorKind::Resource { error.or("a smaller ‹tile›") } else { error }
}

/// The error for a job that requires `least` bytes and has `memory` bytes.
pub fn too_little(memory: u64, least: u64) -> Error {
    let needed = least.div_ceil(1 << 20);
    let allowed = memory as f64 / (1 << 20) as f64;
    short(
        format!("at least {needed} MiB of memory are needed, {allowed:.1} MiB are allowed"),
        least,
    )
}

/// The error `message` for too little memory; the remedy is to pass `enough` bytes.
pub fn short(message: impl Into<String>, enough: u64) -> Error {
    let remedy = format!("pass ‹memory› {}M or more", enough.div_ceil(1 << 20));
    Error::new(ErrorKind::Resource, message).remedy(remedy)
}

/// Bytes that the clip polygons of a point cloud take for the whole job.
pub fn polygon_bytes(options: &cloud::CloudOpenOptions) -> u64 {
    options.filter.polygon.as_ref().map_or(0, |polygon| polygon.bytes())
}

/// The resources without the memory of the clip polygons of a point cloud.
pub fn beside_polygons(options: &cloud::CloudOpenOptions, resources: &Resources) -> Resources {
    let memory = resources.memory.saturating_sub(polygon_bytes(options));
    Resources { memory, ..resources.clone() }
}

/// Runs `work` with the memory that the clip polygons of a point cloud leave. If it has too little, the error names the
/// file of the polygons, and the memory in its remedy includes theirs.
pub fn with_polygons<T>(
    options: &cloud::CloudOpenOptions,
    resources: &Resources,
    work: impl FnOnce(Resources) -> Result<T>,
) -> Result<T> {
    let reserved = polygon_bytes(options).div_ceil(1 << 20);
    let path = options.filter.polygon.as_ref().and_then(|polygon| polygon.path());
    work(beside_polygons(options, resources)).map_err(|error| match path {
        Some(path) if error.kind() == ErrorKind::Resource && error.path().is_none() => {
            let remedy = error.remedy_text().unwrap_or("pass more ‹memory›");
            let remedy = raise_memory(remedy, reserved).unwrap_or_else(|| remedy.to_owned());
            error
                .at(format_args!("beside {reserved} MiB of polygons"))
                .in_file(path)
                .remedy(format!("{remedy}, or simplify the polygons"))
        }
        _ => error,
    })
}

/// A remedy with `more` MiB added to the memory that it asks for; `None` if it is not of the form that [`short`]
/// writes.
fn raise_memory(remedy: &str, more: u64) -> Option<String> {
    let (before, rest) = remedy.split_once("‹memory› ")?;
    let (number, after) = rest.split_once('M')?;
    Some(format!("{before}‹memory› {}M{after}", number.parse::<u64>().ok()? + more))
}

/// An opened grid with its memory shares.
pub type Opened = (Box<dyn GridSource>, MemoryShares);

/// Divides the memory among workers of `worker` bytes each, and opens `input` with its share as the block cache. Uses
/// fewer workers if the cache could not hold the decoded blocks that they work on. The error for too little memory states how
/// much suffices, including the blocks of this input.
pub fn open(
    input: &Inputs,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Result<Opened> {
    open_beside(0, input, options, resources, worker)
}

/// As [`open`], with `reserved` bytes of the budget already in use for the whole job.
pub fn open_beside(
    reserved: u64,
    input: &Inputs,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Result<Opened> {
    let open = |options: &GridOpenOptions| raster::open_all(input.names(), options);
    open_with(&open, reserved, options, resources, worker)
}

/// Opens a grid, with these options except for cache and threads.
pub type OpenGrid<'a> = &'a dyn Fn(&GridOpenOptions) -> Result<Box<dyn GridSource>>;

/// As [`open_beside`], for a grid that is opened by `open`, perhaps several times.
pub fn open_with(
    open: OpenGrid<'_>,
    reserved: u64,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Result<Opened> {
    let mut threads = resources.threads;
    loop {
        let mut fitting = 1;
        let opened =
            divide_beside(resources.memory, reserved, threads, worker).and_then(|shares| {
                fitting = shares.threads;
                let cache_bytes = usize::try_from(shares.cache).unwrap_or(usize::MAX);
                let options = GridOpenOptions { cache_bytes, threads: fitting, ..options.clone() };
                Ok((open(&options)?, shares))
            });
        match opened {
            // The block may fit: fewer workers leave a larger cache. Halving limits the number of attempts, each of
            // which opens the input again.
            Err(error) if error.kind() == ErrorKind::Resource && fitting > 1 => {
                threads = fitting / 2;
            }
            Err(error) if error.kind() == ErrorKind::Resource => {
                return Err(enough(open, reserved, options, resources, worker).unwrap_or(error));
            }
            Ok((source, shares)) if fitting > 1 && is_short(source.as_ref(), shares) => {
                threads = fitting / 2;
            }
            opened => return opened,
        }
    }
}

/// True if the cache cannot hold the blocks that the workers work on.
fn is_short(source: &dyn GridSource, shares: MemoryShares) -> bool {
    source.block_bytes().saturating_mul(shares.threads as u64) > shares.cache
}

/// The error that states how much memory suffices; `None` if no amount does.
fn enough(
    open: OpenGrid<'_>,
    reserved: u64,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Option<Error> {
    let block = open(&estimating(options)).ok()?.block_bytes();
    let least = least(worker, block).saturating_add(reserved);
    let is_enough = block <= MAX_CACHE && least > resources.memory;
    let error = is_enough.then(|| too_little(resources.memory, least))?;
    // The clip polygons take part of the memory, and simplifying them is another remedy.
    Some(match &options.clip {
        Some(clip) => error.at("with its polygons").in_file(clip.path()),
        None => error,
    })
}

/// Opens a grid for its metadata only, whatever the size of its blocks.
pub fn open_for_estimate(input: &Inputs, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    raster::open_all(input.names(), &estimating(options))
}

/// Options for reading metadata. Readers refuse blocks larger than the cache, but none is decoded.
fn estimating(options: &GridOpenOptions) -> GridOpenOptions {
    GridOpenOptions { cache_bytes: usize::MAX >> 8, threads: 1, ..options.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;
    /// Smallest budget in MiB for a worker of 48 MiB.
    const LEAST: u64 = PROGRAM / MIB + 48 + 6;

    #[test]
    fn workers_that_exceed_the_budget_are_left_out() {
        let shares = |memory, threads| divide(memory * MIB, threads, 48 * MIB).unwrap();
        assert_eq!(shares(LEAST, 8).threads, 1);
        assert_eq!(shares(128, 8).threads, 2);
        assert_eq!(shares(4096, 8).threads, 8);
        for memory in [LEAST, LEAST + 1, 128, 1000, 9000] {
            let MemoryShares { threads, cache, mesh } = shares(memory, 8);
            let left = memory * MIB - PROGRAM - 48 * MIB * threads as u64;
            assert_eq!(cache, (left / 2).min(MAX_CACHE));
            assert_eq!(mesh + (left - cache) / SLACK, left - cache);
        }
    }

    #[test]
    fn the_smallest_budget_holds_one_worker_and_one_block() {
        for (block, more) in [(0, 0), (3, 1), (4, 0), (100, 7), (1024, 500)] {
            let least = least(48 * MIB, block * MIB);
            let shares = divide(least + more * MIB, 1, 48 * MIB).unwrap();
            assert!(shares.cache >= block * MIB, "{block} MiB: {shares:?}");
            let less = divide(least - 2 * MIB, 1, 48 * MIB);
            assert!(less.is_err() || less.unwrap().cache < block * MIB);
        }
    }

    #[test]
    fn slack_is_left_as_it_was_added() {
        let all = [0, 1, 6, 7, 8, 13, 14, 1000, 12_345_678_901];
        assert_eq!(all.map(|bytes| without_slack(with_slack(bytes))), all);
    }

    #[test]
    fn reserved_memory_is_not_divided() {
        for reserved in [0, 9, 1000] {
            let shares =
                divide_beside((128 + reserved) * MIB, reserved * MIB, 8, 48 * MIB).unwrap();
            assert_eq!(shares, divide(128 * MIB, 8, 48 * MIB).unwrap());
            let error =
                divide_beside((60 + reserved) * MIB, reserved * MIB, 8, 48 * MIB).unwrap_err();
            assert!(error.to_string().starts_with(&format!("at least {} MiB", LEAST + reserved)));
        }
    }

    #[test]
    fn too_little_memory_is_refused_with_the_required_amount() {
        let error = divide(65 * MIB, 1, 48 * MIB).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Resource);
        let expected = format!("at least {LEAST} MiB of memory are needed, 65.0 MiB");
        assert!(error.to_string().starts_with(&expected), "{error}");
    }
}
