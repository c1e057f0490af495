//! Meshes of clouds by plan: blocks of regions choose vertices, look at the mesh of all of them, and look again where
//! that has changed; the last task settles what is left and writes the mesh. It is that of a single run, byte for byte.
//!
//! ```text
//! choose-0 ─┐         ┌─ prove-0 ─┐         ┌─ again-0 ─┐
//! choose-1 ─┼─ all ───┼─ prove-1 ─┼─ all ───┼─ again-1 ─┼─ finish
//! choose-2 ─┘         └─ prove-2 ─┘         └─ again-2 ─┘
//! ```
//!
//! The points are looked at once when the plan is made: regions follow from how many lie where, and the hull of all
//! closes the mesh of each. **Why rounds wait for all that is before them:** a circle may reach over the whole cloud, so
//! only the mesh of all vertices tells what a region sees. A task reads the vertices of the few squares that it comes to.
//! **Why two rounds are tasks:** in the first all regions look, in the second nearly all; a third has few left, and
//! those read once more what lies in them.

mod mesh;
mod needs;
mod report;

use std::path::Path;

use super::job::{CloudTinJob, CloudTinReport};
use super::options::CloudTinOptions;
use super::regions::REGION_POINTS;
use mesh::{CloudMesh, CloudTinSurvey, OpenedCloudTin};
use terrane_base::error::{Error, Result};
use terrane_engine::operation::{Divisible, RunRequest};
use terrane_engine::plan::{
    self, DiskCheck, OutputForm, PlanKind, PlanManifest, RunControl, RunJob, StatusReport,
};
use terrane_engine::sift::Skipped;
use terrane_engine::{Cancel, Progress};
use terrane_files::refuse_held;
use terrane_mesh::by_path;

pub use report::{CloudTinStatus, PlanCloudTinJob, PointRun, PointStatus};

impl Divisible for CloudTinOptions {
    const TASK_SIZE: &'static str =
        "Maximum number of points in a task, at least 131,072 [default: about 17 million]";
    terrane_engine::planned_as!(CloudMesh, PointStatus, PointRun);

    /// In PLY unless told otherwise.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<PointStatus>> {
        let RunRequest { inputs, output: folder, skipped, progress, cancel, .. } = request;
        let format = by_path(Path::new(""), Some(self.file.format.as_deref().unwrap_or("PLY")))?;
        let output = folder.join("mesh").with_extension(format.extensions[0]);
        let job = CloudTinJob {
            format: Some(format.name.to_owned()),
            measure: false,
            ..self.job(inputs, &output)?
        };
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_cloud_tin(&PlanCloudTinJob { job, folder, cut: task_size, skipped }, progress, cancel)
    }
}

/// Writes down what is to be made, from what, by which tasks, and what they need. The points are looked at once, and
/// a few squares choose vertices to tell the size of the result.
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

/// The same in regions of so many points at the most.
pub(super) fn plan_regions(
    job: &PlanCloudTinJob,
    most: u64,
    at: RunControl<'_>,
) -> Result<CloudTinStatus> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    refuse_held(job.inputs.names())?;
    refuse_lines(job)?;
    job.check()?;
    let opened = OpenedCloudTin::new(job.clone(), job.label())?;
    let (mesh, needs) = match PlanManifest::<CloudMesh>::there(folder) {
        Some(plan) => (CloudMesh::of(&opened, *cut, plan.work.seen)?, plan.needs),
        None => {
            let (seen, share) = CloudTinSurvey::look(&opened, (*cut, most), &opened.ready()?, at)?;
            let mesh = CloudMesh::of(&opened, *cut, seen)?;
            let needs = needs::expect(&opened.ready()?, &mesh.seen.regions, share)?;
            (mesh, needs)
        }
    };
    let files = mesh.files(&opened);
    PlanManifest::new(mesh, (job.label(), files), needs, skipped)?.put(folder)?;
    plan::status::<CloudMesh>(folder)
}

/// Fails for what the whole cloud has to be there for.
fn refuse_lines(job: &CloudTinJob) -> Result<()> {
    let options = [("‹keep_points›", &job.keep_points), ("‹breaklines›", &job.breaklines)];
    match options.into_iter().find(|(_, file)| file.is_some()) {
        None => Ok(()),
        Some((option, _)) => Err(Error::usage(format!(
            "{option} cannot act in the plan of a cloud's mesh: the nearest point may be however far away"
        ))
        .remedy(format!("leave {option} out, or run ‹terrane tin› without a plan"))),
    }
}

/// Plans and runs `job` in `folder`, so that a run that was killed goes on where it was when it is started again.
/// `skipped` are files that are left out of the input, to be noted in the plan.
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
    let (to, with) = ((folder, &*job.output), (disk, &job.resources));
    let all = RunJob::until(to, job.overwrite, OutputForm::default(), with);
    let plan =
        || plan_cloud_tin(&PlanCloudTinJob::all(job, folder, skipped), progress, cancel).map(drop);
    let run = plan::run_in::<CloudMesh>(&all, plan, RunControl { progress, cancel })?;
    let mut mesh = PlanKind::Cloud.made(run.of.mesh)?;
    mesh.run.wall_seconds = run.wall_seconds;
    mesh.run.peak_memory = run.peak_memory;
    mesh.run.spilled_bytes = mesh.run.spilled_bytes.map(|bytes| bytes + run.spilled_bytes);
    mesh.points_per_second = mesh.run.rate(mesh.points.read);
    Ok(mesh)
}
