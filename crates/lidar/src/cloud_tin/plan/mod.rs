//! Meshes of point clouds by plan: blocks of regions select vertices, check the mesh of all vertices, and check
//! again where it has changed; the last task adds the remaining vertices and writes the mesh. The result is
//! that of a single run, byte for byte.
//!
//! ```text
//! choose-0 ─┐         ┌─ prove-0 ─┐         ┌─ again-0 ─┐
//! choose-1 ─┼─ all ───┼─ prove-1 ─┼─ all ───┼─ again-1 ─┼─ finish
//! choose-2 ─┘         └─ prove-2 ─┘         └─ again-2 ─┘
//! ```
//!
//! The points are read once when the plan is made: regions follow from their density, and the hull of all
//! points closes the mesh of each region. **Why rounds wait for all tasks before them:** a circle may reach
//! over the whole point cloud, so a region needs the vertices of all others. A task reads the vertices of the
//! few tiles it needs. **Why two rounds are tasks:** the first checks all regions, the second nearly all; a
//! third would have few left, which the last task checks.

mod needs;
mod report;
mod tasks;

use std::path::Path;

use super::job::{CloudTinJob, CloudTinReport};
use super::options::CloudTinOptions;
use super::regions::REGION_POINTS;
use crate::points::StagedPlace;
use tasks::{CloudMesh, CloudTinScan, OpenedCloudTin};
use terrane_base::error::{Error, Result};
use terrane_engine::operation::{Divisible, RunRequest};
use terrane_engine::plan::{
    self, DiskCheck, OutputForm, PlanKind, PlanManifest, RunControl, RunJob, StatusReport,
};
use terrane_engine::skip_bad::Skipped;
use terrane_engine::{Cancel, Progress};
use terrane_files::refuse_in_memory;
use terrane_mesh::by_path;

pub use report::{CloudTinStatus, PlanCloudTinJob, PointRun, PointStatus};

impl Divisible for CloudTinOptions {
    const TASK_SIZE: &'static str =
        "Maximum number of points in a task, at least 131,072 [default: about 17 million]";
    terrane_engine::planned_as!(CloudMesh, PointStatus, PointRun);

    /// The default format is PLY.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<PointStatus>> {
        let RunRequest { output: folder, skipped, progress, cancel, .. } = request;
        let format = by_path(Path::new(""), Some(self.file.format.as_deref().unwrap_or("PLY")))?;
        let output = folder.join("mesh").with_extension(format.extensions[0]);
        refuse_lines(&self.unread(request.inputs, &output)?)?;
        let (status, _) =
            self.with_job(request, &output, StagedPlace::of_plan(folder)?, |job| {
                let job =
                    CloudTinJob { format: Some(format.name.to_owned()), measure: false, ..job };
                let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
                let plan = PlanCloudTinJob { job, folder, cut: task_size, skipped };
                plan_cloud_tin(&plan, progress, cancel)
            })?;
        Ok(status)
    }
}

/// Writes a plan: the job, its input, its tasks and their resources. The points are read once, and vertices are
/// selected in a few tiles to estimate the size of the result.
///
/// # Errors
/// Those of [`run`](super::run) that are found before the work; `Usage` for points to keep and breaklines, and for a
/// folder that holds another plan or other files.
pub fn plan_cloud_tin(
    job: &PlanCloudTinJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudTinStatus> {
    plan_regions(job, REGION_POINTS, RunControl { progress, cancel })
}

/// As [`plan_cloud_tin`], with regions of at most `max_points` points.
pub(super) fn plan_regions(
    job: &PlanCloudTinJob,
    max_points: u64,
    at: RunControl<'_>,
) -> Result<CloudTinStatus> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    refuse_in_memory(job.inputs.names())?;
    refuse_lines(job)?;
    job.check()?;
    let opened = OpenedCloudTin::new(job.clone(), job.label())?;
    let (mesh, needs) = match PlanManifest::<CloudMesh>::existing(folder) {
        Some(plan) => (CloudMesh::of(&opened, *cut, plan.work.seen)?, plan.needs),
        None => {
            let (seen, share) =
                CloudTinScan::scan(&opened, *cut, max_points, &opened.ready()?, at)?;
            let mesh = CloudMesh::of(&opened, *cut, seen)?;
            let needs = needs::expect(&opened.ready()?, &mesh.seen.regions, share)?;
            (mesh, needs)
        }
    };
    let files = mesh.files(&opened);
    PlanManifest::new(mesh, (job.label(), files), needs, skipped)?.put(folder)?;
    plan::status::<CloudMesh>(folder)
}

/// Fails for options that need the whole point cloud.
fn refuse_lines(job: &CloudTinJob) -> Result<()> {
    let options = [("‹keep_points›", &job.keep_points), ("‹breaklines›", &job.breaklines)];
    match options.into_iter().find(|(_, file)| file.is_some()) {
        None => Ok(()),
        Some((option, _)) => Err(Error::usage(format!(
            "{option} is not supported by `plan tin` on point clouds (it needs global nearest neighbours)"
        ))
        .remedy(format!("leave {option} out, or run ‹terrane tin› without a plan"))),
    }
}

/// Plans and runs `job` in `folder`, so that a killed run resumes when it is started again. `skipped` are files
/// left out of the input, recorded in the plan.
///
/// # Errors
/// Those of [`plan_cloud_tin`] and of any [`RunJob`].
pub fn run_in(
    folder: &Path,
    job: &CloudTinJob,
    skipped: &[Skipped],
    disk: DiskCheck,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudTinReport> {
    let form = OutputForm::default();
    let all = RunJob::until(folder, &job.output, job.overwrite, form, disk, &job.resources);
    let job = PlanCloudTinJob::all(job, folder, skipped);
    let run = plan::run_in::<CloudMesh>(
        &all,
        || plan_cloud_tin(&job, progress, cancel).map(drop),
        RunControl { progress, cancel },
    )?;
    let mut mesh = PlanKind::Cloud.made(run.of.mesh)?;
    mesh.run.wall_seconds = run.wall_seconds;
    mesh.run.peak_memory = run.peak_memory;
    mesh.run.spilled_bytes = mesh.run.spilled_bytes.map(|bytes| bytes + run.spilled_bytes);
    mesh.points_per_second = mesh.run.rate(mesh.points.read);
    Ok(mesh)
}
