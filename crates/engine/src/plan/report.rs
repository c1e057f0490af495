//! What is told of plans and of the work on them.

use serde::{Deserialize, Serialize};

use crate::Resources;
use crate::skip_bad::Skipped;

/// A task that is not done.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TaskReport {
    /// Its name.
    pub id: String,
    /// The tasks it waits for: "finish" for all others.
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

/// What the work takes, about, as a plan notes it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanNeeds {
    /// Least bytes of memory for a task.
    pub memory: u64,
    /// Bytes that a further thread takes.
    pub thread_memory: u64,
    /// Bytes of all objects.
    pub objects: u64,
    /// Bytes of what is written at the end.
    pub output: u64,
    /// Seconds of one thread for all tasks, and for what is written at the end.
    pub seconds: [f64; 2],
}

impl PlanNeeds {
    /// What a `share` of the tasks takes and, where it is to be written, the result.
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

    /// Threads that find room.
    fn threads(&self, resources: &Resources) -> usize {
        let further = resources.memory.saturating_sub(self.memory) / self.thread_memory.max(1);
        let fitting = usize::try_from(further).unwrap_or(usize::MAX).saturating_add(1);
        resources.threads.clamp(1, fitting)
    }
}

/// How much faster each further thread makes it, as measured on one machine; see benches/history/2026.md, 3 and 6.
const SPEED_UP: f64 = 0.85;

/// Seconds that so many threads take, about, for what takes one of them `seconds`.
pub fn shared(seconds: f64, threads: usize) -> f64 {
    seconds / (1.0 + SPEED_UP * (threads.max(1) - 1) as f64)
}

/// What a plan wrote.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LastOutput {
    /// Where it is, if it is there as it was written.
    pub output: Option<String>,
    /// What is wrong with it if it was written and is not: it is missing, or altered.
    pub output_fault: Option<String>,
}

/// A plan, or how far the work on it has come; `S` is what only its kind tells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct StatusReport<S> {
    pub folder: String,
    pub plan_id: String,
    pub input: String,
    pub format: String,
    /// Samples or cells of the whole.
    pub work: u64,
    /// Cells along a tile.
    pub tile_cells: u32,
    #[serde(flatten)]
    pub of: S,
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
    /// What is written at the end, once it is.
    #[serde(flatten)]
    pub told: LastOutput,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// What a kind of plan tells of a run.
pub trait DescribesRun {
    /// Where what it is for is, if it is written.
    fn written(&self) -> Option<&str>;

    /// What was asked for and is not so.
    fn shortfall(&self) -> Option<String> {
        None
    }
}

/// What a run of a plan did; `R` is what only its kind tells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct RunReport<R> {
    pub folder: String,
    pub plan_id: String,
    /// Tasks of the plan.
    pub tasks: u64,
    /// Tasks that were done before this run.
    pub found: u64,
    /// Bytes of the results of these tasks.
    pub found_bytes: u64,
    /// Tasks that were done before and whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks done by this run.
    pub made: Vec<String>,
    pub made_bytes: u64,
    /// Whether this run did the last task, which writes the result.
    pub finished: bool,
    pub spilled_bytes: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    #[serde(flatten)]
    pub of: R,
    /// Files that were left out of the input when it was planned.
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
