//! Tiles of points by plan: tiles are grouped into blocks, each a task that reads the points near it; the last
//! task moves their files into one folder. The files are those of a single run, byte for byte.
//!
//! A task opens all headers, so that frame, format and tiles are those of the whole. Options that need more
//! than the surroundings of a tile are refused, or computed once when the plan is made: ground statistics and
//! noise.

mod manifest;
mod probe;
mod report;
mod tasks;

use std::path::Path;

use super::job::TranslateJob;
use super::options::PointsOptions;
use manifest::PointTilesPlan;
use terrane_base::error::Result;
use terrane_engine::operation::{Divisible, RunRequest};
use terrane_engine::plan::{
    self, DiskCheck, OutputForm, PlanKind, PlanManifest, RunControl, RunJob, StatusReport,
};
use terrane_engine::skip_bad::Skipped;
use terrane_engine::{Cancel, Progress};
use terrane_files::{refuse_in_memory, shown_all};

pub use report::{PlanPointsJob, PointTileRun, PointTileStatus, PointsStatus, PointsWritten};

impl Divisible for PointsOptions {
    const TASK_SIZE: &'static str =
        "Tiles along the side of a task [default: about 67 million points]";
    terrane_engine::planned_as!(PointTilesPlan, PointTileStatus, PointTileRun);

    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<PointTileStatus>> {
        let RunRequest { inputs, output: folder, skipped, progress, cancel, .. } = request;
        let job = self.job(inputs.names(), &folder.join("points"))?;
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_points(&PlanPointsJob { job, folder, cut: task_size, skipped }, progress, cancel)
    }
}

/// Writes a plan: the job, its input, its tasks and their resources. If the ground is needed, or noise depends
/// on all points, the points are read once. A few tiles are made to estimate the size of the results, and
/// discarded.
///
/// # Errors
/// Those of [`run`](super::run) that are found before the work; `Usage` for one file instead of tiles, for
/// options that need more than the surroundings of a tile, and for a folder that holds another plan or other
/// files.
pub fn plan_points(
    job: &PlanPointsJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PointsStatus> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    let at = RunControl { progress, cancel };
    refuse_in_memory(&job.input)?;
    let existing = PlanManifest::<PointTilesPlan>::existing(folder);
    let known = existing.as_ref().map(|plan| &plan.work.knowledge);
    let (work, opened) = PointTilesPlan::new(job, *cut, known, at)?;
    let files = work.files(&opened);
    let needs = match existing {
        Some(plan) => plan.needs,
        None => probe::expect(&opened, &work, at)?,
    };
    PlanManifest::new(work, (shown_all(&job.input), files), needs, skipped)?.put(folder)?;
    plan::status::<PointTilesPlan>(folder)
}

/// Plans and runs `job` in `folder`, so that a killed run resumes when it is started again. `skipped` are files
/// left out of the input, recorded in the plan.
///
/// # Errors
/// Those of [`plan_points`] and of any [`RunJob`].
pub fn run_in(
    folder: &Path,
    job: &TranslateJob,
    skipped: &[Skipped],
    disk: DiskCheck,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PointsWritten> {
    let form = OutputForm::default();
    let all = RunJob::until(folder, &job.output, job.overwrite, form, disk, &job.resources);
    let job = PlanPointsJob::all(job, folder, skipped);
    let run = plan::run_in::<PointTilesPlan>(
        &all,
        || plan_points(&job, progress, cancel).map(drop),
        RunControl { progress, cancel },
    )?;
    PlanKind::Points.made(run.of.written)
}
