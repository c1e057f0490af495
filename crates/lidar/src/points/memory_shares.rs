//! Division of the memory of a job on points.

use crate::records::RecordFlow;
use terrane_base::error::Result;
use terrane_cloud::write::CHUNK;
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, too_little};

/// Memory of a thread for reading, without its records.
const READING: u64 = 4 << 20;
/// More for each extra byte, which has its own compression models in every scanner channel.
const READING_EXTRA: u64 = 4 << 10;
/// Chunks that a thread holds while it packs one: its records, the same compressed, and the compressor's.
const PACKING: u64 = 4;
/// Most bytes of the records of a round, for each thread.
const ROUND: u64 = 16 << 20;

/// Division of the memory.
pub(super) struct TranslateMemory {
    pub(super) threads: usize,
    pub(super) flow: RecordFlow,
    /// Bytes for steps before writing.
    pub(super) marks: u64,
}

impl TranslateMemory {
    /// The division for records of this size and extra bytes, given the needs of earlier steps and of each of
    /// their threads.
    pub(super) fn new(
        resources: &Resources,
        record: usize,
        extra: usize,
        [needed, thread_needed]: [u64; 2],
    ) -> Result<Self> {
        let chunk = (CHUNK * record) as u64;
        let [least, worker] = Self::min_memory(record, extra, [needed, thread_needed]);
        let Some(rest) = resources.memory.checked_sub(least) else {
            return Err(too_little(resources.memory, least));
        };
        let threads = resources.threads.clamp(1, 1 + (rest / (2 * worker)) as usize);
        let rest = rest - worker * (threads as u64 - 1);
        let round = (2 * chunk + rest / 4).min(ROUND * threads as u64);
        Ok(Self { threads, flow: RecordFlow { record, round }, marks: needed + rest / 2 })
    }

    /// Least memory, and its part for a thread.
    pub(super) fn min_memory(
        record: usize,
        extra: usize,
        [needed, thread_needed]: [u64; 2],
    ) -> [u64; 2] {
        let chunk = (CHUNK * record) as u64;
        let worker = (READING + READING_EXTRA * extra as u64 + PACKING * chunk).max(thread_needed);
        [PROGRAM + worker + 4 * chunk + needed, worker]
    }

    /// For the columns of an octree: bytes of one in memory, and of all pending ones.
    pub(super) fn columns(&self) -> [u64; 2] {
        [self.marks / 32, self.marks / 4]
    }
}
