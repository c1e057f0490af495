//! Settings of the core of a job.

use std::path::Path;

use terrane_engine::constraints::GridConstraints;
use terrane_engine::{Cancel, Progress};
use terrane_tin::TinSpec;

/// How to run the core of a job.
#[derive(Clone, Copy)]
pub struct TinSettings<'a> {
    /// Settings of the kernel.
    pub spec: TinSpec,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Samples that must be vertices, and breaklines.
    pub constraints: &'a GridConstraints,
    /// Worker threads. With one, everything runs on the calling thread; with more, one further
    /// thread writes.
    pub threads: usize,
    /// Bytes of unfinished mesh to hold in memory; the rest is spilled.
    pub mesh_bytes: u64,
    /// Folder for the spill file.
    pub temp_dir: &'a Path,
    /// Seed of a random order of tasks, for tests; results do not depend on it.
    pub order_seed: Option<u64>,
    /// Reports triangulated samples.
    pub progress: &'a dyn Progress,
    /// Stops the run between two tasks.
    pub cancel: &'a Cancel,
}
