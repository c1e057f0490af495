//! LRU cache of decoded blocks with a size limit, shared by threads. Blocks are decoded outside the lock,
//! each by one thread.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Condvar, Mutex};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::{lock, wait};

/// A decoded block.
pub(crate) type Block = Arc<Vec<u8>>;

/// The cache. Keys are block numbers.
#[derive(Debug)]
pub(crate) struct BlockCache {
    most: usize,
    state: Mutex<BlockCacheState>,
    /// Signalled whenever a block is ready or has failed.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct BlockCacheState {
    slots: HashMap<u64, BlockCacheSlot>,
    /// Keys by time of last use; the first entry is evicted next.
    order: BTreeMap<u64, u64>,
    clock: u64,
    bytes: usize,
}

#[derive(Debug)]
enum BlockCacheSlot {
    /// A thread is decoding the block.
    Decoding,
    Ready {
        block: Block,
        stamp: u64,
    },
}

impl BlockCache {
    /// A cache of at most `most` bytes.
    pub(crate) fn new(most: usize) -> Self {
        Self { most, state: Mutex::default(), changed: Condvar::new() }
    }

    /// The block `key`, decoded by `decode` unless cached.
    pub(crate) fn get(&self, key: u64, decode: impl FnOnce() -> Result<Vec<u8>>) -> Result<Block> {
        if let Some(block) = self.find_or_claim(key) {
            return Ok(block);
        }
        // Dropped on failure and on panic, so that waiting threads retry.
        let claim = BlockDecodeClaim { cache: self, key };
        let block = Arc::new(decode()?);
        claim.fulfil(&block);
        Ok(block)
    }

    /// Drops the block `key` from the cache.
    pub(crate) fn forget(&self, key: u64) {
        lock(&self.state).remove_ready(key);
    }

    /// The cached block, or `None` after claiming it for this thread.
    fn find_or_claim(&self, key: u64) -> Option<Block> {
        let mut state = lock(&self.state);
        loop {
            match state.slots.get(&key) {
                Some(BlockCacheSlot::Ready { .. }) => return state.touch(key),
                Some(BlockCacheSlot::Decoding) => {
                    state = wait(&self.changed, state);
                }
                None => {
                    state.slots.insert(key, BlockCacheSlot::Decoding);
                    return None;
                }
            }
        }
    }
}

impl BlockCacheState {
    fn touch(&mut self, key: u64) -> Option<Block> {
        let Some(BlockCacheSlot::Ready { block, stamp }) = self.slots.get_mut(&key) else {
            return None;
        };
        self.clock += 1;
        self.order.remove(stamp);
        self.order.insert(self.clock, key);
        *stamp = self.clock;
        Some(block.clone())
    }

    fn insert(&mut self, key: u64, block: Block, most: usize) {
        let bytes = block.len();
        // A block larger than the cache is handed on and not kept. Threads that wait for it find no slot
        // and decode it for themselves.
        if bytes > most {
            return;
        }
        while self.bytes + bytes > most {
            let Some((_, oldest)) = self.order.first_key_value() else { break };
            let oldest = *oldest;
            self.remove_ready(oldest);
        }
        self.clock += 1;
        self.bytes += bytes;
        self.order.insert(self.clock, key);
        self.slots.insert(key, BlockCacheSlot::Ready { block, stamp: self.clock });
    }

    fn remove_ready(&mut self, key: u64) {
        if let Some(BlockCacheSlot::Ready { block, stamp }) = self.slots.get(&key) {
            self.bytes -= block.len();
            self.order.remove(stamp);
            self.slots.remove(&key);
        }
    }
}

/// Claim of one thread to decode one block.
struct BlockDecodeClaim<'a> {
    cache: &'a BlockCache,
    key: u64,
}

impl BlockDecodeClaim<'_> {
    fn fulfil(self, block: &Block) {
        // The guard is dropped before `self`, as locals are before arguments. The drop of `self` locks
        // again and wakes the threads that wait.
        let mut state = lock(&self.cache.state);
        state.slots.remove(&self.key);
        state.insert(self.key, block.clone(), self.cache.most);
    }
}

impl Drop for BlockDecodeClaim<'_> {
    fn drop(&mut self) {
        let mut state = lock(&self.cache.state);
        if let Some(BlockCacheSlot::Decoding) = state.slots.get(&self.key) {
            state.slots.remove(&self.key);
        }
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
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use terrane_base::error::Error;

    fn filled(n: u8) -> Result<Vec<u8>> {
        Ok(vec![n; 10])
    }

    #[test]
    fn stays_within_its_bytes_and_drops_the_least_recently_used() {
        let cache = BlockCache::new(25);
        cache.get(1, || filled(1)).unwrap();
        cache.get(2, || filled(2)).unwrap();
        cache.get(1, || panic!("is cached")).unwrap();
        cache.get(3, || filled(3)).unwrap();
        assert_eq!(lock(&cache.state).bytes, 20);
        cache.get(1, || panic!("was used last")).unwrap();
        let decoded = AtomicUsize::new(0);
        cache.get(2, || Ok(vec![decoded.fetch_add(1, Ordering::Relaxed) as u8])).unwrap();
        assert_eq!(decoded.into_inner(), 1);
        cache.forget(1);
        cache.forget(99);
        let state = lock(&cache.state);
        assert_eq!(state.bytes, state.slots.len() * 10 - 9);
        assert_eq!(state.order.len(), state.slots.len());
    }

    #[test]
    fn blocks_larger_than_the_cache_are_handed_out_but_not_kept() {
        let cache = BlockCache::new(5);
        assert_eq!(cache.get(1, || filled(7)).unwrap()[0], 7);
        let state = lock(&cache.state);
        assert_eq!((state.bytes, state.slots.len()), (0, 0));
    }

    #[test]
    fn a_failed_or_panicking_decode_leaves_the_block_to_others() {
        let cache = BlockCache::new(100);
        assert!(cache.get(1, || Err(Error::bad_input("no"))).is_err());
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let _ = cache.get(1, || panic!("bug"));
        }));
        assert!(panicked.is_err());
        assert_eq!(cache.get(1, || filled(4)).unwrap()[0], 4);
    }

    #[test]
    fn many_threads_decode_each_block_once() {
        let cache = BlockCache::new(1000);
        let decoded = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for key in 0..50 {
                        let block = cache.get(key, || {
                            decoded.fetch_add(1, Ordering::Relaxed);
                            std::thread::yield_now();
                            filled(key as u8)
                        });
                        assert_eq!(block.unwrap()[9], key as u8);
                    }
                });
            }
        });
        assert_eq!(decoded.into_inner(), 50);
    }
}
