//! Resources of a proof: its mesh, its threads, and their memory.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use bytemuck::Pod;

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::memory::{PROGRAM, beside_program, short};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources, workers};
use terrane_files::{Buckets, lock, unlocked};
use terrane_mesh::MeshSource;
use terrane_proof::DomainLayout;

/// Minimum memory of a verification, and of each of its threads.
pub(super) const MIN_MEMORY: u64 = 1 << 20;

/// Resources of a proof, for any kind of original.
pub(super) struct ProofResources<'a> {
    pub(super) mesh: &'a dyn MeshSource,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: Cancel,
    pub(super) threads: usize,
    /// Bytes for all data of the proof.
    pub(super) memory: u64,
    /// Bytes for one thread.
    pub(super) share: u64,
    /// Bytes set aside from these.
    aside: u64,
    /// Where spills go.
    pub(super) folder: PathBuf,
}

impl<'a> ProofResources<'a> {
    /// Statistics of a proof that ends now.
    pub(super) fn statistics(
        &self,
        started: Instant,
        resources: &Resources,
        spilled: u64,
    ) -> RunStatistics {
        RunStatistics::since(started, resources).with_threads(self.threads).with_spilled(spilled)
    }

    pub(super) fn new(
        mesh: &'a dyn MeshSource,
        tolerance: Option<f64>,
        resources: &Resources,
        progress: &'a dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self> {
        check_arguments(tolerance, resources)?;
        let max_threads = usize::try_from(resources.memory / MIN_MEMORY).unwrap_or(usize::MAX);
        let threads = resources.threads.clamp(1, max_threads);
        // Enough for a domain whose samples are all vertices.
        let min_memory = resources.memory.min(MIN_MEMORY) / 8 * 5;
        // An eighth is left to the allocator.
        let half = beside_program(resources.memory) / 2;
        let memory = (half - half / 8).max(min_memory);
        let folder = resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
        let (cancel, share) = (cancel.clone(), memory / threads as u64);
        Ok(Self { mesh, progress, cancel, threads, memory, share, aside: 0, folder })
    }

    /// Sets bytes aside for the rest of the run.
    pub(super) fn set_aside(&mut self, bytes: u64) {
        self.aside += bytes;
        self.memory = self.memory.saturating_sub(bytes);
        // Fewer threads, so that each still has the minimum.
        let max_threads = usize::try_from(self.memory / MIN_MEMORY).unwrap_or(usize::MAX).max(1);
        self.threads = self.threads.min(max_threads);
        self.share = self.memory / self.threads as u64;
    }

    /// The error for an allocation of `need` bytes beyond the budget.
    pub(super) fn short(&self, what: &str, need: u64) -> Error {
        let message = format!("{what}: {} MiB needed", need.div_ceil(1 << 20));
        // The inverse of the shares that `new` takes of the budget.
        let half = (need + self.aside).div_ceil(7) * 8;
        short(message, PROGRAM + 2 * half)
    }

    /// Runs `judge` on every unit below `units`, each thread with findings of its own, and merges these.
    #[track_caller]
    pub(super) fn findings<T: Default + Send>(
        &self,
        units: u64,
        judge: impl Fn(&mut T, u64) -> Result<()> + Sync,
        merge: impl Fn(&mut T, &T) + Sync,
    ) -> Result<T> {
        let all = Mutex::new(T::default());
        workers::run(self.threads, units, &self.cancel, T::default, judge, |findings| {
            merge(&mut lock(&all), &findings);
            Ok(())
        })?;
        Ok(unlocked(all))
    }

    /// A bucket for each domain, which together hold about `bytes` until they are settled.
    pub(super) fn buckets<T: Pod>(&self, layout: DomainLayout, bytes: u64) -> Buckets<T> {
        Buckets::new(&self.folder, layout.len() as usize, bytes)
    }
}

fn check_arguments(tolerance: Option<f64>, resources: &Resources) -> Result<()> {
    if tolerance.is_some_and(|t| !(t >= 0.0 && t.is_finite())) {
        return Err(Error::usage("the tolerance is not a number of 0 or more"));
    }
    if resources.memory < MIN_MEMORY {
        let message =
            format!("memory of {} bytes is below the minimum of {MIN_MEMORY}", resources.memory);
        return Err(Error::new(ErrorKind::Resource, message).remedy("pass ‹memory› 1M or more"));
    }
    Ok(())
}
