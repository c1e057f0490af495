//! Cache of decoded blocks, shared by the threads of a job and by the grids of a mosaic.
//!
//! A block is decoded by one thread, outside the lock, into a buffer that an earlier block has left. It then waits in
//! memory for all readers of its samples. If the memory is full, the least recently used block is written to a temporary
//! file and read from there by rows, as an uncompressed one is: writing and reading it takes a tenth of the time of
//! decoding. A job that
//! [releases](BlockCache::release) samples keeps the file as small as the part of the grid that is in work. If the file
//! would exceed [`MAX_SPILLED`], blocks are dropped and decoded again. Threads decode at the same time only what the memory
//! holds, with the bytes that blocks are decoded from.

mod state;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::{RowRun, SpoolExtent, SpoolFile, lock, wait};

use state::{BlockCacheState, BlockLookup};

/// Maximum size in bytes of the blocks of a cache in the temporary file.
const MAX_SPILLED: u64 = 4 << 30;

/// Blocks decoded by this process.
static DECODED: AtomicU64 = AtomicU64::new(0);

/// Number of blocks that this process has decoded so far, all grids together; a block that is decoded twice counts twice.
pub fn decoded_blocks() -> u64 {
    DECODED.load(Ordering::Relaxed)
}

/// A block: the grid, and its number there.
pub(crate) type BlockKey = (u64, u64);

/// A cache that several grids share, as the files of a mosaic do.
#[derive(Clone, Debug)]
pub struct SharedBlocks {
    cache: Arc<BlockCache>,
    grid: u64,
}

impl SharedBlocks {
    /// A cache of at most `most` bytes in memory; further blocks are in an unnamed file in `folder`, or else in the
    /// system's temporary folder.
    pub(crate) fn new(most: usize, folder: Option<&Path>) -> Self {
        Self { cache: Arc::new(BlockCache::new(most, folder)), grid: 0 }
    }

    /// The same cache for the blocks of the grid `grid`.
    pub(crate) fn of_grid(&self, grid: u64) -> Self {
        Self { grid, ..self.clone() }
    }

    /// Maximum bytes of blocks in memory.
    pub(crate) fn max_bytes(&self) -> usize {
        self.cache.most
    }

    /// The block `block`, decoded by `decode` unless cached. `decode` gets a buffer with any content. If another thread is
    /// decoding the block, waits for it, or returns `None` without `wait`.
    pub(crate) fn get(
        &self,
        block: u64,
        bytes: DecodeBytes,
        wait: bool,
        decode: impl FnOnce(&mut Vec<u8>) -> Result<()>,
    ) -> Result<Option<CachedBlock>> {
        self.cache.get((self.grid, block), bytes, wait, decode)
    }

    /// Notes that `samples` of the `of` samples of a block will not be read again. Drops the block once that is so for
    /// all of them.
    pub(crate) fn release(&self, block: u64, samples: u64, of: u64) {
        self.cache.release((self.grid, block), samples, of);
    }
}

/// Bytes of a block, and those that are in memory beside it while it is decoded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DecodeBytes {
    pub(crate) block: usize,
    pub(crate) beside: usize,
}

/// A decoded block, in memory or in the temporary file.
#[derive(Clone, Debug)]
pub(crate) enum CachedBlock {
    Held(Arc<Vec<u8>>),
    Spilled(Arc<SpooledBlock>),
}

thread_local! {
    /// Rows of blocks in the temporary file.
    static ROWS: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

impl CachedBlock {
    /// Passes the rows of `run`, with offsets in the block, to `each`.
    pub(crate) fn each_row(&self, run: RowRun, mut each: impl FnMut(usize, &[u8])) -> Result<()> {
        match self {
            Self::Held(block) => {
                let (offset, pitch) = (run.offset as usize, run.pitch as usize);
                (0..run.rows)
                    .for_each(|row| each(row, &block[offset + row * pitch..][..run.bytes]));
                Ok(())
            }
            Self::Spilled(block) => ROWS.with_borrow_mut(|rows| {
                run.each(rows, |at, out| block.read(at, out), |row, bytes| each(row, bytes))
            }),
        }
    }
}

/// A block in the temporary file, which frees its space when the last reader is done.
#[derive(Debug)]
pub(crate) struct SpooledBlock {
    spool: Arc<SpoolFile>,
    /// `None` only while it is dropped.
    extent: Option<SpoolExtent>,
    bytes: u64,
}

impl SpooledBlock {
    fn read(&self, at: u64, out: &mut [u8]) -> Result<()> {
        self.extent.iter().try_for_each(|extent| self.spool.get(extent, at, &mut [&mut *out]))
    }
}

impl Drop for SpooledBlock {
    fn drop(&mut self) {
        self.extent.take().into_iter().for_each(|extent| self.spool.free(extent));
    }
}

/// The cache.
#[derive(Debug)]
struct BlockCache {
    /// Maximum bytes of blocks in memory.
    most: usize,
    spool: Arc<SpoolFile>,
    state: Mutex<BlockCacheState>,
    /// Signalled whenever a block is ready or has failed.
    changed: Condvar,
}

impl BlockCache {
    fn new(most: usize, folder: Option<&Path>) -> Self {
        let folder = folder.map_or_else(std::env::temp_dir, PathBuf::from);
        Self {
            most,
            spool: Arc::new(SpoolFile::new(&folder)),
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    fn get(
        &self,
        key: BlockKey,
        bytes: DecodeBytes,
        wait: bool,
        decode: impl FnOnce(&mut Vec<u8>) -> Result<()>,
    ) -> Result<Option<CachedBlock>> {
        match self.find_or_claim(key, wait) {
            BlockLookup::Found(block) => return Ok(Some(block)),
            BlockLookup::Busy => return Ok(None),
            BlockLookup::Claimed => {}
        }
        // Dropped on failure and on panic, so that waiting threads retry.
        let mut claim = BlockDecodeClaim { cache: self, key, reserved: 0 };
        let mut buffer = self.buffer(&mut claim, bytes)?;
        DECODED.fetch_add(1, Ordering::Relaxed);
        decode(&mut buffer)?;
        Ok(Some(CachedBlock::Held(claim.fulfil(buffer))))
    }

    fn release(&self, key: BlockKey, samples: u64, of: u64) {
        lock(&self.state).release(key, samples, of);
    }

    /// The cached block, or a claim to decode it.
    fn find_or_claim(&self, key: BlockKey, is_waiting: bool) -> BlockLookup {
        let mut state = lock(&self.state);
        loop {
            match state.find_or_claim(key) {
                BlockLookup::Busy if is_waiting => state = wait(&self.changed, state),
                found => return found,
            }
        }
    }

    /// A buffer for a block with any content, counted for `claim` with what is beside it: one that another block has left,
    /// or a new one. Waits while other threads decode, if the memory does not hold this block as well.
    fn buffer(&self, claim: &mut BlockDecodeClaim<'_>, bytes: DecodeBytes) -> Result<Vec<u8>> {
        let needed = bytes.block + bytes.beside;
        let mut state = lock(&self.state);
        while state.decoding > 0 && state.decoding + needed > self.most {
            state = wait(&self.changed, state);
        }
        // Before the lock is given back, so that others wait for this one.
        claim.reserved = needed;
        state.decoding += needed;
        let mut found = state.spare(bytes.block);
        let leaving = state.make_room(self.most);
        drop(state);
        // Without the lock, so that other threads find their blocks meanwhile, these among them.
        let spilled: Vec<_> = leaving.iter().map(|(_, block)| self.spill(block)).collect();
        let mut state = lock(&self.state);
        let mut failed = None;
        for ((key, block), spilled) in leaving.into_iter().zip(spilled) {
            let spilled = spilled.unwrap_or_else(|error| {
                failed = Some(error);
                None
            });
            let buffer = state.leave(key, block, spilled);
            found = found.or(buffer.filter(|buffer| state::suits(buffer, bytes.block)));
        }
        drop(state);
        if let Some(error) = failed {
            return Err(error);
        }
        let mut buffer = found.unwrap_or_else(|| Vec::with_capacity(bytes.block));
        buffer.resize(bytes.block, 0);
        Ok(buffer)
    }

    /// Writes a block to the temporary file, unless it is too large for that.
    fn spill(&self, block: &[u8]) -> Result<Option<Arc<SpooledBlock>>> {
        let bytes = block.len() as u64;
        if bytes > MAX_SPILLED {
            return Ok(None);
        }
        let extent = Some(self.spool.put(&[block])?);
        Ok(Some(Arc::new(SpooledBlock { spool: self.spool.clone(), extent, bytes })))
    }
}

/// Claim of one thread to decode one block.
struct BlockDecodeClaim<'a> {
    cache: &'a BlockCache,
    key: BlockKey,
    /// Bytes of its buffer, and those beside it.
    reserved: usize,
}

impl BlockDecodeClaim<'_> {
    fn fulfil(mut self, buffer: Vec<u8>) -> Arc<Vec<u8>> {
        // The guard is dropped before `self`, as locals are before arguments. The drop of `self` locks
        // again and wakes the threads that wait.
        let mut state = lock(&self.cache.state);
        state.decoding -= std::mem::take(&mut self.reserved);
        let block = Arc::new(buffer);
        // A block larger than the cache is handed on and not kept. Threads that wait for it find no slot
        // and decode it for themselves.
        if block.len() <= self.cache.most {
            state.hold(self.key, block.clone());
        }
        block
    }
}

impl Drop for BlockDecodeClaim<'_> {
    fn drop(&mut self) {
        let mut state = lock(&self.cache.state);
        state.decoding -= self.reserved;
        state.give_up(self.key);
        drop(state);
        self.cache.changed.notify_all();
    }
}

/// Error of a block of `bytes` that exceeds the block cache, which is at least a quarter of the memory limit.
pub(crate) fn too_large_for_cache(message: String, bytes: u64) -> Error {
    let remedy = format!("pass ‹memory› {}M or more", 4 * bytes.div_ceil(1 << 20) + 64);
    Error::new(ErrorKind::Resource, message).remedy(remedy)
}

#[cfg(test)]
mod tests;
