//! Reports on plans and their runs.

use serde::{Deserialize, Serialize};

use crate::Resources;
use crate::skip_bad::Skipped;

/// A pending task.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TaskReport {
    /// Its name.
    pub id: String,
    /// Tasks it depends on; "finish" depends on all others.
    pub after: Vec<String>,
    /// Samples it reads, or cells it computes.
    pub work: u64,
}

/// Estimated resources of the pending tasks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// Seconds on this machine, from rates measured on another.
    pub seconds: f64,
    /// Threads of this machine that fit into the default memory limit.
    pub threads: usize,
    /// Minimum memory per task, in bytes.
    pub least_memory: u64,
    /// Bytes of the pending results.
    pub disk_needed: u64,
    /// Bytes of the output.
    pub output_bytes: u64,
}

/// Estimated resources of the whole plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanNeeds {
    /// Minimum memory per task, in bytes.
    pub memory: u64,
    /// Bytes per further thread.
    pub thread_memory: u64,
    /// Bytes of all artifacts.
    pub objects: u64,
    /// Bytes of the output.
    pub output: u64,
    /// Seconds on one thread, for all tasks and for the output.
    pub seconds: [f64; 2],
}

impl PlanNeeds {
    /// Resources of a `share` of the tasks and, if `writes` is set, of the output.
    pub(super) fn forecast(&self, share: f64, writes: bool) -> Forecast {
        let threads = self.threads(&Resources::default());
        let [tasks, writing] = self.seconds;
        let writing = if writes { writing } else { 0.0 };
        Forecast {
            seconds: shared(tasks * share + writing, threads),
            threads,
            least_memory: self.memory,
            disk_needed: (self.objects as f64 * share) as u64,
            output_bytes: self.output,
        }
    }

    /// Threads that fit into memory.
    fn threads(&self, resources: &Resources) -> usize {
        let further = resources.memory.saturating_sub(self.memory) / self.thread_memory.max(1);
        let fitting = usize::try_from(further).unwrap_or(usize::MAX).saturating_add(1);
        resources.threads.clamp(1, fitting)
    }
}

/// Speed-up per further thread, as measured on one machine; see benches/history/2026.md, 3 and 6.
const SPEED_UP: f64 = 0.85;

/// Estimated seconds on `threads` threads for work that takes `seconds` on one.
pub fn shared(seconds: f64, threads: usize) -> f64 {
    seconds / (1.0 + SPEED_UP * (threads.max(1) - 1) as f64)
}

/// Output of a plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LastOutput {
    /// Path, if the output is written and unaltered.
    pub output: Option<String>,
    /// Fault of a written output: missing or altered.
    pub output_fault: Option<String>,
}

/// A plan or its progress; `S` holds the fields of its kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct StatusReport<S> {
    pub folder: String,
    pub plan_id: String,
    pub input: String,
    pub format: String,
    /// Total samples or cells.
    pub work: u64,
    /// Cells along a tile side.
    pub tile_cells: u32,
    #[serde(flatten)]
    pub of: S,
    /// Pending tasks in a valid order; the last one is "finish".
    pub to_do: Vec<TaskReport>,
    /// Number of finished tasks.
    pub done: u64,
    /// Tasks with damaged results; they are pending as well.
    pub damaged: Vec<String>,
    /// Bytes of all results so far.
    pub object_bytes: u64,
    /// Estimated resources of the pending tasks.
    #[serde(flatten)]
    pub forecast: Forecast,
    /// Output, once it is written.
    #[serde(flatten)]
    pub last_output: LastOutput,
    /// Files that were left out of the input when the plan was made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// Run report of a kind of plan.
pub trait DescribesRun {
    /// Path of the output, if it is written.
    fn written(&self) -> Option<&str>;

    /// Requested target that was not reached.
    fn shortfall(&self) -> Option<String> {
        None
    }
}

/// Report of a run of a plan; `R` holds the fields of its kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct RunReport<R> {
    pub folder: String,
    pub plan_id: String,
    /// Number of tasks of the plan.
    pub tasks: u64,
    /// Number of tasks finished before this run.
    pub found: u64,
    /// Bytes of the results of these tasks.
    pub found_bytes: u64,
    /// Tasks finished before this run whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks finished by this run.
    pub made: Vec<String>,
    pub made_bytes: u64,
    /// Whether this run did the last task, which writes the output.
    pub finished: bool,
    pub spilled_bytes: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    #[serde(flatten)]
    pub of: R,
    /// Files that were left out of the input when the plan was made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_find_room_in_memory() {
        let needs =
            PlanNeeds { memory: 100 << 20, thread_memory: 100 << 20, ..PlanNeeds::default() };
        let of = |threads, memory| needs.threads(&Resources { threads, memory, temp_dir: None });
        assert_eq!([of(8, 1 << 30), of(16, 1 << 30), of(16, 1)], [8, 10, 1]);
    }
}
