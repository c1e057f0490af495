//! Figures of a run, which every job reports alike: what it was allowed and what it took.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::{Resources, peak_memory};

/// What a run was allowed and what it took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunStatistics {
    /// Threads used.
    pub threads: usize,
    /// Bytes that it might hold.
    pub memory_budget: u64,
    /// Largest resident memory of the process so far, in bytes, where the system tells.
    pub peak_memory: Option<u64>,
    /// Bytes that went through temporary files, where they are counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spilled_bytes: Option<u64>,
    /// Seconds from start to end.
    pub wall_seconds: f64,
}

impl RunStatistics {
    /// Of a run with `resources` that began at `started` and ends now.
    pub fn since(started: Instant, resources: &Resources) -> Self {
        Self {
            threads: resources.threads,
            memory_budget: resources.memory,
            peak_memory: peak_memory(),
            spilled_bytes: None,
            wall_seconds: started.elapsed().as_secs_f64(),
        }
    }

    /// Of a run that used so many threads.
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Of a run of which so many bytes went through temporary files; `None` where they are not counted.
    pub fn with_spilled(self, bytes: impl Into<Option<u64>>) -> Self {
        Self { spilled_bytes: bytes.into(), ..self }
    }

    /// So many a second.
    pub fn rate(&self, count: u64) -> f64 {
        count as f64 / self.wall_seconds.max(1e-9)
    }
}
