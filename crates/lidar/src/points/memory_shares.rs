//! Division of the memory of a job on points.

use super::job::StageNeeds;
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
    /// Bytes for all stages and the output.
    marks: u64,
    needs: StageNeeds,
}

impl TranslateMemory {
    /// The division for records of this size and extra bytes, given the needs of the stages.
    pub(super) fn new(
        resources: &Resources,
        record: usize,
        extra: usize,
        needs: StageNeeds,
    ) -> Result<Self> {
        let chunk = (CHUNK * record) as u64;
        let [least, worker] = Self::min_memory(record, extra, &needs);
        let Some(rest) = resources.memory.checked_sub(least) else {
            return Err(too_little(resources.memory, least));
        };
        let threads = resources.threads.clamp(1, 1 + (rest / (2 * worker)) as usize);
        let rest = rest - worker * (threads as u64 - 1);
        let round = (2 * chunk + rest / 4).min(ROUND * threads as u64);
        let marks = needs.total() + rest / 2;
        Ok(Self { threads, flow: RecordFlow { record, round }, marks, needs })
    }

    /// Least memory, and its part for a thread.
    pub(super) fn min_memory(record: usize, extra: usize, needs: &StageNeeds) -> [u64; 2] {
        let chunk = (CHUNK * record) as u64;
        let worker = (READING + READING_EXTRA * extra as u64 + PACKING * chunk).max(needs.thread);
        [PROGRAM + worker + 4 * chunk + needs.total(), worker]
    }

    /// Bytes for a stage while the others hold what they need.
    pub(super) fn of_stage(&self, number: usize) -> u64 {
        self.needs.share(number, self.marks)
    }

    /// Bytes for the output while the stages hold what they need.
    pub(super) fn of_output(&self) -> u64 {
        self.marks - (self.needs.total() - self.needs.output)
    }

    /// For the columns of an octree: bytes of one in memory, and of all pending ones.
    pub(super) fn columns(&self) -> [u64; 2] {
        [self.of_output() / 32, self.of_output() / 4]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_stage_uses_what_the_others_hold() {
        for (stages, output) in
            [(vec![], 9), (vec![5], 0), (vec![70_000_000; 20], 32), (vec![3, 0, 8], 1)]
        {
            let all: u64 = stages.iter().sum::<u64>() + 1000 * output;
            let held = 1000 * output;
            let needs = || StageNeeds { output, held, stages: stages.clone(), thread: 7 };
            let [least, _] = TranslateMemory::min_memory(38, 0, &needs());
            for more in [0, 1 << 20, 1 << 30] {
                let memory = least + more;
                let resources = Resources { memory, threads: 3, temp_dir: None };
                let shares = TranslateMemory::new(&resources, 38, 0, needs()).unwrap();
                for (number, needed) in stages.iter().enumerate() {
                    let share = shares.of_stage(number);
                    assert!(share >= *needed && share + all - needed + output <= memory);
                }
                assert!(shares.of_output() >= output && shares.of_output() + all <= memory);
            }
            let little = Resources { memory: least - 1, threads: 3, temp_dir: None };
            assert!(TranslateMemory::new(&little, 38, 0, needs()).is_err());
        }
    }
}
