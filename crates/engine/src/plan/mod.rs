//! Plans: work stored in a folder, done in tasks by any number of processes, and resumable. One engine runs every kind
//! of plan; `PlannedWork` defines the tasks of a kind.
//!
//! | name | what |
//! |---|---|
//! | `plan.json` | the plan |
//! | `objects/` | the result of each task that is done |
//! | `points/` | the points after stages, if any, which the tasks read |
//! | `finished.json` | where the result is written, and its digest once it is there |
//! | `lock` | held by a run of all pending tasks |

mod any;
mod artifact;
mod difference;
mod digest;
mod files;
mod folder;
mod kind;
mod manifest;
mod output;
mod plan_file;
mod planned;
mod report;
mod run;

pub use crate::disk::DiskCheck;
pub use any::{AnyOperation, Plan, PlanOperations, PlanRun, PlanStatus, RunOptions, RunSetters};
pub use artifact::{CheckDepth, damaged_object};
pub use difference::refuse_another;
pub use digest::{Digest, digest_of};
pub use files::with_companions;
pub(crate) use files::{InputFile, stat};
pub use folder::TaskStates;
pub use kind::{
    MadeArtifact, Numbered, OutputForm, OutputRequest, PlanStep, PlannedWork, RunControl,
};
pub use manifest::{noted_path, write_json};
pub use plan_file::{PLAN, POINTS, PlanManifest, refuse_file, refuse_others};
pub use plan_file::{PlanKind, kind};
pub use planned::{PlannedGrid, grid_files};
pub use report::{DescribesRun, Forecast, LastOutput, RunReport, StatusReport, TaskReport};
pub use report::{PlanNeeds, shared};
pub use run::{PlanJob, RunJob};
pub use run::{run, run_in, run_named, status};

/// Implements the plan methods of [`Divisible`](crate::operation::Divisible) for an operation whose plans are of this
/// kind.
#[macro_export]
macro_rules! planned_as {
    ($work:ty, $status:ty, $done:ty) => {
        const KIND: $crate::plan::PlanKind = <$work as $crate::plan::PlannedWork>::KIND;
        type Status = $status;
        type Done = $done;

        fn status(folder: &Path) -> Result<$crate::plan::StatusReport<$status>> {
            $crate::plan::status::<$work>(folder)
        }

        fn run_plan(
            job: &$crate::plan::RunJob,
            progress: &dyn $crate::Progress,
            cancel: &$crate::Cancel,
        ) -> Result<$crate::plan::RunReport<$done>> {
            $crate::plan::run_named::<$work>(job, progress, cancel)
        }
    };
}

/// Most tasks of a plan.
pub const MAX_TASKS: u64 = 1 << 22;
