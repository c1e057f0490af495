//! What was planned, what is done, and what a run did.

use serde::Serialize;

use crate::plan::{Forecast, TaskReport, Told};
use crate::sift::Skipped;
use crate::tin::report::{StageReport, TinReport};

/// A plan, or how far the work on it has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct StatusReport {
    pub folder: String,
    pub plan_id: String,
    pub input: String,
    pub format: String,
    pub max_error: f64,
    pub samples: u64,
    /// The same, by the name that all kinds of plans have for it.
    pub work: u64,
    pub tile_cells: u32,
    /// Tasks that are not done, in an order in which they can be; the last one is "finish".
    pub to_do: Vec<TaskReport>,
    /// Tasks that are done.
    pub done: u64,
    /// Tasks whose results are damaged; they are among those not done.
    pub damaged: Vec<String>,
    /// Bytes of all results so far.
    pub object_bytes: u64,
    /// What the rest takes.
    #[serde(flatten)]
    pub forecast: Forecast,
    /// The mesh, once it is written.
    #[serde(flatten)]
    pub mesh: Told,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct RunReport {
    pub folder: String,
    pub plan_id: String,
    /// Tasks of the plan.
    pub tasks: u64,
    /// Tasks that were done before, and
    pub found: u64,
    /// the bytes of their results, all read and found sound.
    pub found_bytes: u64,
    /// Tasks that were done before and whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks done by this run.
    pub made: Vec<String>,
    pub made_bytes: u64,
    pub made_samples: u64,
    pub spilled_bytes: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    /// Time by stage, without that of writing the mesh.
    pub stages: Vec<StageReport>,
    /// The mesh, if this run came to it; its time is that of writing it.
    pub mesh: Option<TinReport>,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}
