//! Meshes by plan: work in units that many machines can share and that survive being killed.

mod artifact_store;
mod mesh_tasks;
mod report;
mod tasks;

use std::path::Path;
use std::time::Duration;

use super::estimate::SizeEstimator;
use super::goal::TinGoal;
use super::job::TinJob;
use super::layout::TileLayout;
use super::make::{OpenedTinJob, TinMaker, in_input};
use super::options::TinOptions;
use super::refinement::TinMethod;
use super::report::TinReport;
use mesh_tasks::PlannedMesh;
use terrane_base::error::{Error, Result};
use terrane_engine::operation::{Divisible, RunRequest};
use terrane_engine::plan::{self, DiskCheck, OutputForm, PLAN, PlanManifest, PlanNeeds, RunJob};
use terrane_engine::skip_bad::Skipped;
use terrane_engine::transform::TargetCrs;
use terrane_engine::{Cancel, Progress};
use terrane_files::refuse_in_memory;
use terrane_mesh::by_path;
use terrane_tin::TinSpec;

pub use report::{MeshRun, MeshStatus, PlanJob, RunReport, StatusReport};

impl Divisible for TinOptions {
    const TASK_SIZE: &'static str =
        "Rows of tiles in a task, 2 or more [default: about 134 million samples]";
    terrane_engine::planned_as!(PlannedMesh, MeshStatus, MeshRun);

    /// The default format is PLY.
    fn plan(&self, request: RunRequest<'_>, task_size: Option<u32>) -> Result<StatusReport> {
        let RunRequest { inputs, output: folder, skipped, progress, cancel, .. } = request;
        self.textbook()?;
        let format = by_path(Path::new(""), Some(self.file.format.as_deref().unwrap_or("PLY")))?;
        let job = self.job(inputs, &folder.join("mesh").with_extension(format.extensions[0]))?;
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_work(&PlanJob { job, folder, cut: task_size, skipped }, progress, cancel)
    }
}

/// Writes a plan: the job, its input, its tasks and their resources. A few tiles are read to estimate the size
/// of the result.
///
/// # Errors
/// Those of opening the input; `Usage` for a goal other than a tolerance, and for a folder that holds
/// another plan or other files.
pub fn plan_work(job: &PlanJob, progress: &dyn Progress, cancel: &Cancel) -> Result<StatusReport> {
    job.check_size(2, "at least two rows of tiles")?;
    plan_checked(job, |_| Ok(()), progress, cancel)
}

/// As [`plan_work`]; `check` may fail before the work.
fn plan_checked(
    job: &PlanJob,
    check: impl FnOnce(&TinMaker<'_>) -> Result<()>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<StatusReport> {
    job.job.goal.check()?;
    if !matches!(job.job.goal, TinGoal::MaxError(_)) {
        return Err(budget());
    }
    refuse_in_memory(job.job.input.names())?;
    let reading = job.job.reading.absolute()?;
    let constraints = job.job.refinement.constraints.absolute()?;
    let refinement = TinMethod { constraints, ..job.job.refinement.clone() };
    let transform = job.job.transform.as_ref().map(TargetCrs::absolute).transpose()?;
    let input = job.job.input.resolve()?;
    let tin = TinJob { input, reading, refinement, transform, ..job.job.clone() };
    let opened = OpenedTinJob::new(&tin)?;
    let maker = TinMaker { job: &tin, opened: &opened, progress, cancel };
    check(&maker)?;
    let (tolerance, _) = maker.tolerance().map_err(|error| in_input(error, &tin.input))?;
    let layout = maker.layout().map_err(|error| in_input(error, &tin.input))?;
    let mesh = PlannedMesh::new(&tin, &opened, job.cut)?;
    let needs = match PlanManifest::<PlannedMesh>::existing(&job.folder) {
        Some(plan) => plan.needs,
        None => estimated_needs(&maker, &mesh, tolerance, layout)?,
    };
    let files = mesh_tasks::files(&tin, &*opened.source);
    PlanManifest::new(mesh, (tin.input.to_string(), files), needs, &job.skipped)?
        .put(&job.folder)?;
    plan::status::<PlannedMesh>(&job.folder)
}

/// Resources of the work, from an estimate of the size of the mesh.
fn estimated_needs(
    maker: &TinMaker<'_>,
    mesh: &PlannedMesh,
    tolerance: f64,
    layout: TileLayout,
) -> Result<PlanNeeds> {
    let opened = maker.opened;
    let spec = TinSpec { measure: false, ..maker.spec(tolerance) };
    let size =
        SizeEstimator::thorough(&*opened.source, layout, opened.shares.threads, maker.cancel)
            .and_then(|mut estimator| estimator.size_at_most(&spec))
            .map_err(|error| in_input(error, &maker.job.input))?;
    let on_lines = opened.constraints.lines().vertices_in(size.vertices, layout.samples());
    mesh.needs(size.with(opened.constraints.count() + on_lines), opened)
}

fn budget() -> Error {
    Error::usage("plans do not support a budget of vertices or triangles (it needs trials on the whole grid)")
        .remedy("pass ‹max_error›")
}

/// Plans and runs `job` in `folder`, so that a killed run resumes when it is started again. `skipped` are files
/// left out of the input, recorded in the plan.
///
/// # Errors
/// Those of [`plan_work`] and of any [`RunJob`].
pub fn run_in(
    folder: &Path,
    job: &TinJob,
    skipped: &[Skipped],
    disk: DiskCheck,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TinReport> {
    // With an existing plan, the run decides whether the output may be replaced.
    let is_new = !folder.join(PLAN).exists();
    let plan = PlanJob::all(job, folder, skipped);
    plan_checked(
        &plan,
        |maker| if is_new { maker.check_output() } else { Ok(()) },
        progress,
        cancel,
    )?;
    let form = OutputForm { split: job.split, solid_base: job.solid_base };
    let run = RunJob::until(folder, &job.output, job.overwrite, form, disk, &job.resources);
    plan::run::<PlannedMesh>(&run, progress, cancel).and_then(mesh_report)
}

/// The report on the mesh, with the time and work of the whole run.
fn mesh_report(run: RunReport) -> Result<TinReport> {
    let mut mesh = plan::PlanKind::Tin.made(run.of.mesh)?;
    mesh.took(Duration::from_secs_f64(run.wall_seconds));
    mesh.spilled(run.spilled_bytes);
    mesh.stages.extend(run.of.stages);
    Ok(mesh)
}
