//! What is told of the plans of meshes and of grids alike.

use std::path::Path;

use serde::Serialize;

use super::parent;
use crate::disk;
use terrane_base::error::Result;

/// A task that is not done.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TaskReport {
    /// Its name.
    pub id: String,
    /// The tasks it waits for; "finish" waits for all others and names none.
    pub after: Vec<String>,
    /// Samples it works on, or cells it computes.
    pub work: u64,
}

/// What is left to do will take about so much.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// Seconds on this machine, by the rates measured on another.
    pub seconds: f64,
    /// Threads of this machine that find room in the memory a run takes unless told otherwise.
    pub threads: usize,
    /// Least bytes of memory for a task.
    pub least_memory: u64,
    /// Bytes of the results that are not there yet.
    pub disk_needed: u64,
    /// Bytes of what is written at the end.
    pub output_bytes: u64,
}

/// How much faster each further thread makes it, as measured on one machine; see benches/RESULTS.md.
const SPEED_UP: f64 = 0.85;

/// Seconds that so many threads take, about, for what takes one of them `seconds`.
pub(crate) fn shared(seconds: f64, threads: usize) -> f64 {
    seconds / (1.0 + SPEED_UP * (threads.max(1) - 1) as f64)
}

/// What a plan wrote.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Told {
    /// Where it is, if it is there as it was written.
    pub output: Option<String>,
    /// What is wrong with it if it was written and is not: it is missing, or altered.
    pub output_fault: Option<String>,
}

/// Whether a run is to begin at all where the disk seems to have too little room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiskCheck {
    /// Fail before the work.
    #[default]
    On,
    /// Begin all the same: the user knows better.
    Off,
}

impl DiskCheck {
    /// Fails when the disks of the plan's `folder` and of `output` will not hold the results that are
    /// not there yet and the output.
    pub(crate) fn check(
        self,
        folder: &Path,
        output: &Path,
        [objects, written]: [u64; 2],
    ) -> Result<()> {
        if self == Self::Off {
            return Ok(());
        }
        let beside = parent(output);
        let checked = match disk::are_one(folder, beside) {
            true => disk::check(folder, objects + written),
            false => disk::check(folder, objects).and_then(|()| disk::check(beside, written)),
        };
        checked.map_err(|error| {
            error.remedy("free some space, choose another folder, or pass --no-disk-check")
        })
    }
}
