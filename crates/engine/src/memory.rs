//! Division of a tile job's memory budget.
//!
//! | share | bytes |
//! |---|---|
//! | program: code, stacks, allocator slack, sink buffers; more in debug builds | 16 MiB, 20 MiB |
//! | each worker: the maximum of a tile | given |
//! | decoded blocks of the input: half of the rest, at most 1 GiB | [`MemoryShares::cache`] |
//! | unfinished mesh and parts waiting for the writer: seven eighths of the remainder | [`MemoryShares::mesh`] |
//! | fragmentation between them: the last eighth | |
//!
//! Workers come first: a worker too many would break the budget, one too few costs only time. The other two are read
//! again or spilled if they do not fit. The result does not depend on the division.

use crate::Resources;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud as cloud;
use terrane_raster::{self as raster, GridOpenOptions, GridSource, Inputs};

/// Bytes for the program itself.
pub const PROGRAM: u64 = if cfg!(debug_assertions) { 20 << 20 } else { 16 << 20 };
/// Minimum memory beside the program, whatever the limit.
const MIN_BESIDE: u64 = 4 << 20;
/// Minimum bytes for cache and mesh together.
const MIN_SHARED: u64 = 6 << 20;
/// Maximum bytes for decoded blocks: more than a few rows of blocks are never read again.
const MAX_CACHE: u64 = 1 << 30;

/// The memory left beside the program; a small minimum if `memory` is less than the program takes.
pub fn beside_program(memory: u64) -> u64 {
    memory.saturating_sub(PROGRAM).max(memory.min(MIN_BESIDE))
}

/// Bytes for decoded blocks of a grid that is read beside the main work of a job with `memory`.
pub fn cache_beside(memory: u64) -> usize {
    usize::try_from(beside_program(memory) / 4).unwrap_or(usize::MAX)
}

/// One in `SLACK` bytes of unfinished mesh, or of held data, is left to the allocator.
const SLACK: u64 = 8;

/// A number of bytes with the allocator's slack.
pub fn with_slack(bytes: u64) -> u64 {
    // The inverse of m - m / 8, as `divide` leaves it.
    bytes + bytes / (SLACK - 1)
}

/// A divided budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryShares {
    /// Workers that fit, at least 1.
    pub threads: usize,
    /// Bytes for decoded blocks of the input.
    pub cache: u64,
    /// Bytes for unfinished mesh.
    pub mesh: u64,
}

/// Bytes that suffice for one worker of `worker` bytes and decoded blocks of `block` bytes.
pub fn least(worker: u64, block: u64) -> u64 {
    PROGRAM + worker + MIN_SHARED.max(2 * block)
}

/// Divides `memory` among up to `threads` workers of `worker` bytes each. Fails with [`ErrorKind::Resource`] if not
/// even one fits; the error states the required memory.
pub fn divide(memory: u64, threads: usize, worker: u64) -> Result<MemoryShares> {
    divide_beside(memory, 0, threads, worker)
}

/// As [`divide`], with `reserved` bytes in permanent use.
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
    Ok(MemoryShares { threads, cache, mesh: mesh - mesh / SLACK })
}

/// Adds to the error that smaller tiles need less memory per worker.
pub fn or_smaller_tiles(error: Error) -> Error {
    if error.kind() == ErrorKind::Resource { error.or("a smaller ‹tile›") } else { error }
}

/// The error for a job that requires `least` bytes.
pub fn too_little(memory: u64, least: u64) -> Error {
    let needed = least.div_ceil(1 << 20);
    let allowed = memory as f64 / (1 << 20) as f64;
    short(
        format!("at least {needed} MiB of memory are needed, {allowed:.1} MiB are allowed"),
        least,
    )
}

/// The error for too little memory, where `enough` bytes suffice.
pub fn short(message: impl Into<String>, enough: u64) -> Error {
    let remedy = format!("pass ‹memory› {}M or more", enough.div_ceil(1 << 20));
    Error::new(ErrorKind::Resource, message).remedy(remedy)
}

/// Bytes of the clip polygons of point clouds.
pub fn polygon_bytes(options: &cloud::CloudOpenOptions) -> u64 {
    options.filter.polygon.as_ref().map_or(0, |polygon| polygon.bytes())
}

/// The resources that the clip polygons of point clouds leave.
pub fn beside_polygons(options: &cloud::CloudOpenOptions, resources: &Resources) -> Resources {
    let memory = resources.memory.saturating_sub(polygon_bytes(options));
    Resources { memory, ..resources.clone() }
}

/// Does work with the memory that the clip polygons of point clouds leave; an error for too little memory names them.
pub fn with_polygons<T>(
    options: &cloud::CloudOpenOptions,
    resources: &Resources,
    work: impl FnOnce(Resources) -> Result<T>,
) -> Result<T> {
    let reserved = polygon_bytes(options).div_ceil(1 << 20);
    let path = options.filter.polygon.as_ref().and_then(|polygon| polygon.path());
    work(beside_polygons(options, resources)).map_err(|error| match path {
        Some(path) if error.kind() == ErrorKind::Resource && error.path().is_none() => {
            let remedy = with_more(error.remedy_text().unwrap_or("pass more ‹memory›"), reserved);
            error
                .at(format_args!("beside {reserved} MiB of polygons"))
                .in_file(path)
                .remedy(format!("{remedy}, or simplify the polygons"))
        }
        _ => error,
    })
}

/// A remedy that asks for a number of MiB more.
fn with_more(remedy: &str, more: u64) -> String {
    raise_memory(remedy, more).unwrap_or_else(|| remedy.to_owned())
}

fn raise_memory(remedy: &str, more: u64) -> Option<String> {
    let (before, rest) = remedy.split_once("‹memory› ")?;
    let (number, after) = rest.split_once('M')?;
    Some(format!("{before}‹memory› {}M{after}", number.parse::<u64>().ok()? + more))
}

/// An opened grid with its memory shares.
pub type Opened = (Box<dyn GridSource>, MemoryShares);

/// Divides the memory among workers of `worker` bytes each, and opens `input` with its share; uses fewer workers if a
/// block of the input does not fit beside all. The error for too little memory states how much suffices, including the
/// blocks of this input.
pub fn open(
    input: &Inputs,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Result<Opened> {
    open_beside(0, input, options, resources, worker)
}

/// As [`open`], with `reserved` bytes in permanent use.
pub fn open_beside(
    reserved: u64,
    input: &Inputs,
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
                Ok((raster::open_all(input.names(), &options)?, shares))
            });
        match opened {
            // A cache grows as workers go. Halving ends after a few tries, each of which opens the input anew.
            Err(error) if error.kind() == ErrorKind::Resource && fitting > 1 => {
                threads = fitting / 2;
            }
            Err(error) if error.kind() == ErrorKind::Resource => {
                return Err(enough(reserved, input, options, resources, worker).unwrap_or(error));
            }
            opened => return opened,
        }
    }
}

/// The error that states how much memory suffices; `None` if no amount does.
fn enough(
    reserved: u64,
    input: &Inputs,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
) -> Option<Error> {
    let block = open_for_estimate(input, options).ok()?.block_bytes();
    let least = least(worker, block).saturating_add(reserved);
    let is_enough = block <= MAX_CACHE && least > resources.memory;
    let error = is_enough.then(|| too_little(resources.memory, least))?;
    // Where polygons are among what takes it, they are named.
    Some(match &options.clip {
        Some(clip) => error.at("with its polygons").in_file(clip.path()),
        None => error,
    })
}

/// Opens a grid for its metadata only: no block is ever held.
pub fn open_for_estimate(input: &Inputs, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let options = GridOpenOptions { cache_bytes: usize::MAX >> 8, threads: 1, ..options.clone() };
    raster::open_all(input.names(), &options)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;
    /// MiB for the program, a worker of 48 MiB, and the least that is shared.
    const LEAST: u64 = PROGRAM / MIB + 48 + 6;

    #[test]
    fn workers_are_left_out_before_the_budget_is_broken() {
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
    fn the_least_memory_and_more_hold_a_block_beside_one_worker() {
        for (block, more) in [(0, 0), (3, 1), (4, 0), (100, 7), (1024, 500)] {
            let least = least(48 * MIB, block * MIB);
            let shares = divide(least + more * MIB, 1, 48 * MIB).unwrap();
            assert!(shares.cache >= block * MIB, "{block} MiB: {shares:?}");
            let less = divide(least - 2 * MIB, 1, 48 * MIB);
            assert!(less.is_err() || less.unwrap().cache < block * MIB);
        }
    }

    #[test]
    fn what_is_held_is_no_share() {
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
    fn too_little_is_refused_with_the_least_needed() {
        let error = divide(65 * MIB, 1, 48 * MIB).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Resource);
        let told = format!("at least {LEAST} MiB of memory are needed, 65.0 MiB");
        assert!(error.to_string().starts_with(&told), "{error}");
    }
}
