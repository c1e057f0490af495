//! Statistics of a run, common to all jobs: limits and usage.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::{Resources, peak_memory};

/// Limits and usage of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunStatistics {
    /// Threads used.
    pub threads: usize,
    /// Memory limit, in bytes.
    pub memory_budget: u64,
    /// Peak resident memory of the process so far, in bytes, if the system reports it.
    pub peak_memory: Option<u64>,
    /// Bytes written to temporary files, if counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spilled_bytes: Option<u64>,
    /// Elapsed seconds.
    pub wall_seconds: f64,
}

impl RunStatistics {
    /// Statistics of a run with `resources` from `started` to now.
    pub fn since(started: Instant, resources: &Resources) -> Self {
        Self {
            threads: resources.threads,
            memory_budget: resources.memory,
            peak_memory: peak_memory(),
            spilled_bytes: None,
            wall_seconds: started.elapsed().as_secs_f64(),
        }
    }

    /// The same with the number of threads used.
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// The same with the bytes written to temporary files; `None` if not counted.
    pub fn with_spilled(self, bytes: impl Into<Option<u64>>) -> Self {
        Self { spilled_bytes: bytes.into(), ..self }
    }

    /// Units per second for a count of units.
    pub fn rate(&self, count: u64) -> f64 {
        count as f64 / self.wall_seconds.max(1e-9)
    }
}
