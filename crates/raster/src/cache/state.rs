//! The state of a block cache under its lock: which blocks are where, in the order of their last use.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::{BlockKey, CachedBlock, MAX_SPILLED, SpooledBlock};

/// Where a block is.
#[derive(Debug)]
enum BlockSlot {
    /// A thread is decoding the block.
    Decoding,
    /// In memory.
    Held { block: Arc<Vec<u8>>, stamp: u64 },
    /// In memory, while a thread writes it to the temporary file.
    Leaving(Arc<Vec<u8>>),
    /// In the temporary file.
    Spilled { block: Arc<SpooledBlock>, stamp: u64 },
}

/// Answer to a request for a block.
#[derive(Debug)]
pub(super) enum BlockLookup {
    Found(CachedBlock),
    /// Another thread is decoding it.
    Busy,
    /// The caller is to decode it.
    Claimed,
}

/// The blocks of a cache.
#[derive(Debug, Default)]
pub(super) struct BlockCacheState {
    slots: HashMap<BlockKey, BlockSlot>,
    /// Blocks in memory by time of last use; the first leaves next.
    held: BTreeMap<u64, BlockKey>,
    /// Blocks in the temporary file by time of last use; the first is dropped next.
    spilled: BTreeMap<u64, BlockKey>,
    spilled_bytes: u64,
    /// Samples left of blocks that are partly released.
    left: HashMap<BlockKey, u64>,
    /// Buffers of released blocks.
    spares: Vec<Vec<u8>>,
    clock: u64,
    /// Bytes of the buffers of blocks in memory, and of spare ones.
    pub(super) bytes: usize,
    /// Bytes that threads decode into, and from.
    pub(super) decoding: usize,
}

impl BlockCacheState {
    /// The block `key`, or a claim for the caller.
    pub(super) fn find_or_claim(&mut self, key: BlockKey) -> BlockLookup {
        self.clock += 1;
        let (order, stamp, found) = match self.slots.get_mut(&key) {
            Some(BlockSlot::Decoding) => return BlockLookup::Busy,
            Some(BlockSlot::Leaving(block)) => {
                return BlockLookup::Found(CachedBlock::Held(block.clone()));
            }
            Some(BlockSlot::Held { block, stamp }) => {
                (&mut self.held, stamp, CachedBlock::Held(block.clone()))
            }
            Some(BlockSlot::Spilled { block, stamp }) => {
                (&mut self.spilled, stamp, CachedBlock::Spilled(block.clone()))
            }
            None => {
                self.slots.insert(key, BlockSlot::Decoding);
                return BlockLookup::Claimed;
            }
        };
        order.remove(stamp);
        order.insert(self.clock, key);
        *stamp = self.clock;
        BlockLookup::Found(found)
    }

    /// Ends the claim on a block that is not held.
    pub(super) fn give_up(&mut self, key: BlockKey) {
        if let Some(BlockSlot::Decoding) = self.slots.get(&key) {
            self.slots.remove(&key);
        }
    }

    /// Holds a decoded block.
    pub(super) fn hold(&mut self, key: BlockKey, block: Arc<Vec<u8>>) {
        self.clock += 1;
        self.bytes += block.capacity();
        self.held.insert(self.clock, key);
        self.slots.insert(key, BlockSlot::Held { block, stamp: self.clock });
    }

    /// A spare buffer for `bytes` bytes, which then no longer counts.
    pub(super) fn spare(&mut self, bytes: usize) -> Option<Vec<u8>> {
        let found = self.spares.iter().position(|spare| suits(spare, bytes))?;
        let spare = self.spares.swap_remove(found);
        self.bytes -= spare.capacity();
        Some(spare)
    }

    /// Drops spare buffers, and then takes the least recently used blocks from the order, until all bytes are within
    /// `most` or none is left. Each of these is to [leave](Self::leave).
    pub(super) fn make_room(&mut self, most: usize) -> Vec<(BlockKey, Arc<Vec<u8>>)> {
        let mut leaving = Vec::new();
        let mut total = self.bytes + self.decoding;
        while total > most
            && let Some(spare) = self.spares.pop()
        {
            self.bytes -= spare.capacity();
            total -= spare.capacity();
        }
        while total > most
            && let Some((_, key)) = self.held.pop_first()
        {
            if let Some(slot) = self.slots.get_mut(&key)
                && let BlockSlot::Held { block, .. } = slot
            {
                let block = block.clone();
                *slot = BlockSlot::Leaving(block.clone());
                total -= block.capacity();
                leaving.push((key, block));
            }
        }
        leaving
    }

    /// Ends the stay in memory of a block that was to leave; without `spilled` it is dropped. Returns its buffer, which no
    /// longer counts, unless someone is reading it.
    pub(super) fn leave(
        &mut self,
        key: BlockKey,
        block: Arc<Vec<u8>>,
        spilled: Option<Arc<SpooledBlock>>,
    ) -> Option<Vec<u8>> {
        // It may have been released meanwhile, and even be decoded again.
        let is_here = matches!(
            self.slots.get(&key), Some(BlockSlot::Leaving(here)) if Arc::ptr_eq(here, &block)
        );
        if is_here {
            self.slots.remove(&key);
            spilled.into_iter().for_each(|spilled| self.keep_spilled(key, spilled));
        }
        self.bytes -= block.capacity();
        Arc::into_inner(block)
    }

    fn keep_spilled(&mut self, key: BlockKey, block: Arc<SpooledBlock>) {
        while self.spilled_bytes + block.bytes > MAX_SPILLED
            && let Some((_, oldest)) = self.spilled.first_key_value()
        {
            let oldest = *oldest;
            self.remove(oldest);
        }
        self.clock += 1;
        self.spilled_bytes += block.bytes;
        self.spilled.insert(self.clock, key);
        self.slots.insert(key, BlockSlot::Spilled { block, stamp: self.clock });
    }

    /// Counts `samples` of the `of` samples of a block as released, and drops it after the last.
    pub(super) fn release(&mut self, key: BlockKey, samples: u64, of: u64) {
        let left = self.left.remove(&key).unwrap_or(of).saturating_sub(samples);
        if left > 0 {
            self.left.insert(key, left);
        } else {
            self.remove(key);
        }
    }

    /// Drops a block that is not being decoded.
    fn remove(&mut self, key: BlockKey) {
        match self.slots.remove(&key) {
            Some(BlockSlot::Held { block, stamp }) => {
                self.held.remove(&stamp);
                let bytes = block.capacity();
                match Arc::into_inner(block) {
                    Some(buffer) => self.spares.push(buffer),
                    None => self.bytes -= bytes,
                }
            }
            Some(BlockSlot::Spilled { block, stamp }) => {
                self.spilled.remove(&stamp);
                self.spilled_bytes -= block.bytes;
            }
            // The thread that writes it takes its bytes off.
            Some(BlockSlot::Leaving(_)) | None => {}
            Some(BlockSlot::Decoding) => {
                self.slots.insert(key, BlockSlot::Decoding);
            }
        }
    }

    /// Number of blocks in memory and in the file.
    #[cfg(test)]
    pub(super) fn lookups(&self) -> [usize; 2] {
        [self.held.len(), self.spilled.len()]
    }

    /// True if some samples of a block are released.
    #[cfg(test)]
    pub(super) fn is_partly_released(&self, key: BlockKey) -> bool {
        self.left.contains_key(&key)
    }

    /// Fails the test if the counts do not match the blocks.
    #[cfg(test)]
    pub(super) fn validate(&self, claimed: usize) {
        assert_eq!(self.decoding, claimed);
        let [mut bytes, mut held, mut spilled] = [0; 3];
        let mut spilled_bytes = 0;
        for (key, slot) in &self.slots {
            match slot {
                BlockSlot::Decoding => {}
                BlockSlot::Leaving(block) => bytes += block.capacity(),
                BlockSlot::Held { block, stamp } => {
                    assert_eq!(self.held[stamp], *key);
                    (bytes, held) = (bytes + block.capacity(), held + 1);
                }
                BlockSlot::Spilled { block, stamp } => {
                    assert_eq!(self.spilled[stamp], *key);
                    (spilled_bytes, spilled) = (spilled_bytes + block.bytes, spilled + 1);
                }
            }
        }
        bytes += self.spares.iter().map(Vec::capacity).sum::<usize>();
        assert_eq!((self.bytes, self.held.len()), (bytes, held));
        assert_eq!((self.spilled_bytes, self.spilled.len()), (spilled_bytes, spilled));
    }
}

/// True if a buffer is large enough for `bytes` bytes, and not much too large.
pub(super) fn suits(buffer: &Vec<u8>, bytes: usize) -> bool {
    (bytes..=bytes.saturating_mul(2)).contains(&buffer.capacity())
}
