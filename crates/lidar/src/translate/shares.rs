//! How the memory of a job on points is divided.

use crate::records::RecordFlow;
use terrane_base::error::Result;
use terrane_cloud::write::CHUNK;
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, too_little};

/// Memory of a thread for reading, beside the records it hands on; and more for each extra byte, as a compressed one
/// has models of its own in every channel of a scanner.
const READING: u64 = 4 << 20;
const READING_EXTRA: u64 = 4 << 10;
/// Chunks that a thread holds while it packs one: its records, the same compressed, and the compressor's.
const PACKING: u64 = 4;
/// Most bytes of the records of a round, for each thread.
const ROUND: u64 = 16 << 20;

/// How the memory is divided.
pub(super) struct TranslateMemory {
    pub(super) threads: usize,
    pub(super) flow: RecordFlow,
    /// Bytes for what is looked at before.
    pub(super) marks: u64,
}

impl TranslateMemory {
    /// For records of so many bytes, some of them extra, beside so many that what is looked at before needs, and
    /// each thread for it.
    pub(super) fn new(
        resources: &Resources,
        (record, extra): (usize, usize),
        [needed, looking]: [u64; 2],
    ) -> Result<Self> {
        let chunk = (CHUNK * record) as u64;
        let [least, worker] = Self::least((record, extra), [needed, looking]);
        let Some(rest) = resources.memory.checked_sub(least) else {
            return Err(too_little(resources.memory, least));
        };
        let threads = resources.threads.clamp(1, 1 + (rest / (2 * worker)) as usize);
        let rest = rest - worker * (threads as u64 - 1);
        let round = (2 * chunk + rest / 4).min(ROUND * threads as u64);
        Ok(Self { threads, flow: RecordFlow { record, round }, marks: needed + rest / 2 })
    }

    /// Bytes without which nothing can be done, and those of them for a thread.
    pub(super) fn least((record, extra): (usize, usize), [needed, looking]: [u64; 2]) -> [u64; 2] {
        let chunk = (CHUNK * record) as u64;
        let worker = (READING + READING_EXTRA * extra as u64 + PACKING * chunk).max(looking);
        [PROGRAM + worker + 4 * chunk + needed, worker]
    }

    /// For the columns of an octree: bytes of one that is held, and of all that wait.
    pub(super) fn columns(&self) -> [u64; 2] {
        [self.marks / 32, self.marks / 4]
    }
}
