//! Work in units that many machines can share and that survive being killed: a plan in a folder, an
//! object by task, and the mesh at the end.

mod folder;
mod manifest;
mod object;
mod report;
mod run;
mod shelf;
mod tasks;

use std::path::{Path, PathBuf};
use std::time::Duration;

pub(super) use object::{ObjectWriter, Record};
pub use report::{RunReport, StatusReport};
pub use run::{RunJob, run_plan};

use super::cost::{nanoseconds, seconds};
use super::estimate::Estimator;
use super::job::{Goal, TinJob};
use super::make::{Maker, Opened, in_input};
use super::report::TinReport;
use super::worker::worker_bytes;
use crate::plan::{DiskCheck, Forecast, Look, PLAN, TaskReport, last_output};
use crate::sift::Skipped;
use crate::{Cancel, Progress, Resources, Silent, memory};
use folder::Folder;
use manifest::Manifest;
use tasks::TaskId;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_tin::Spec;

/// Share of the time that the writing of the mesh takes, about.
const WRITING: f64 = 0.1;

/// A plan to make.
#[derive(Clone, Debug)]
pub struct PlanJob {
    /// The mesh to make; its output gives the format and is not written.
    pub tin: TinJob,
    /// The folder for the plan: a new or empty one, or one with the same plan.
    pub folder: PathBuf,
    /// Rows of tiles that make a task; as many as make a fair one when `None`.
    pub strip_rows: Option<u32>,
    /// Files that are left out of the input because they are bad, to be noted in the plan.
    pub skipped: Vec<Skipped>,
}

/// Writes down what is to be made, from what, by which tasks, and what they need. A few tiles are
/// read to tell the size of the result.
///
/// # Errors
/// Those of opening the input; `Usage` for a goal other than a tolerance, and for a folder that holds
/// another plan or other files.
pub fn plan_work(job: &PlanJob, progress: &dyn Progress, cancel: &Cancel) -> Result<StatusReport> {
    plan_checked(job, |_| Ok(()), progress, cancel)
}

/// As [`plan_work`]; `check` may fail before the work.
fn plan_checked(
    job: &PlanJob,
    check: impl FnOnce(&Maker<'_>) -> Result<()>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<StatusReport> {
    job.tin.goal.check()?;
    let tin = TinJob { input: job.tin.input.resolve()?, ..job.tin.clone() };
    let opened = Opened::new(&tin)?;
    let maker = Maker { job: &tin, opened: &opened, progress, cancel };
    check(&maker)?;
    let in_input = |error| in_input(error, &tin.input);
    let (tolerance, _) = maker.tolerance().map_err(in_input)?;
    let spec = Spec { measure: false, ..maker.spec(tolerance) };
    let layout = maker.layout().map_err(in_input)?;
    let size = Estimator::thorough(&*opened.source, layout, cancel)
        .and_then(|mut estimator| estimator.size_at_most(&spec))
        .map_err(in_input)?;
    let worker = worker_bytes(layout.side(), tin.goal.keeps_all());
    let least = memory::least(worker, opened.source.block_bytes());
    let mut manifest = Manifest::new(&tin, &opened, size, least, job.strip_rows)?;
    manifest.skipped.clone_from(&job.skipped);
    Folder::create(&job.folder, &manifest).and_then(|folder| status(&folder, cancel))
}

/// How far the work in the folder `path` has come; objects are looked at, not read through.
pub fn status_of(path: &Path) -> Result<StatusReport> {
    Folder::open(path).and_then(|folder| status(&folder, &Cancel::default()))
}

fn status(folder: &Folder, cancel: &Cancel) -> Result<StatusReport> {
    let survey = folder.survey(Look::Quick, &Silent, cancel)?;
    let mesh = last_output(&folder.path, folder.id)?;
    let is_done = |task: TaskId| match task {
        TaskId::Finish => mesh.output.is_some(),
        _ => survey.done.contains_key(&task),
    };
    let tasks = || folder.strips.tasks().zip(&folder.plan.tasks);
    let report = |(task, needs): (TaskId, &manifest::Needs)| TaskReport {
        id: needs.id.clone(),
        after: tasks::before(task).iter().map(TaskId::to_string).collect(),
        work: needs.samples,
    };
    let left = |(task, _): &(TaskId, &manifest::Needs)| !is_done(*task);
    let method = &folder.plan.method;
    Ok(StatusReport {
        folder: folder.path.display().to_string(),
        plan_id: folder.id.to_string(),
        input: method.label.clone(),
        format: method.format.clone(),
        max_error: method.max_error,
        samples: folder.plan.samples(),
        work: folder.plan.samples(),
        tile_cells: folder.strips.layout().side(),
        to_do: tasks().filter(left).map(report).collect(),
        done: tasks().filter(|task| !left(task)).count() as u64,
        damaged: survey.damaged.iter().map(TaskId::to_string).collect(),
        object_bytes: survey.done.values().map(|done| done.bytes).sum(),
        forecast: forecast(folder, &tasks().filter(left).collect::<Vec<_>>()),
        mesh,
        skipped: folder.plan.skipped.clone(),
    })
}

/// What the tasks that are `left` take.
fn forecast(folder: &Folder, left: &[(TaskId, &manifest::Needs)]) -> Forecast {
    let plan = &folder.plan;
    let Resources { memory, threads, .. } = Resources::default();
    let goal = Goal::MaxError(plan.method.max_error);
    let worker = worker_bytes(folder.strips.layout().side(), goal.keeps_all());
    let threads = memory::divide(memory, threads, worker).map_or(1, |shares| shares.threads);
    let is_object = |(task, _): &&(TaskId, &manifest::Needs)| *task != TaskId::Finish;
    let is_strip = |(task, _): &&(TaskId, &manifest::Needs)| matches!(task, TaskId::Strip(_));
    // The rate is of the whole work by the samples of the grid, which are those of the strips.
    let strips: u64 = left.iter().filter(is_strip).map(|(_, needs)| needs.samples).sum();
    let writing = if left.iter().all(|task| is_object(&task)) { 0.0 } else { WRITING };
    let whole = seconds(plan.samples(), nanoseconds(plan.kept()), threads);
    let share = strips as f64 / plan.samples() as f64;
    Forecast {
        seconds: whole * (share * (1.0 - WRITING) + writing),
        threads,
        least_memory: plan.tasks.iter().map(|needs| needs.memory).max().unwrap_or(0),
        disk_needed: left.iter().filter(is_object).map(|(_, needs)| needs.disk).sum(),
        output_bytes: plan.mesh_bytes(),
    }
}

/// Plans and runs `job` in `folder`, so that a run that was killed goes on where it was when it is
/// started again. `skipped` are files that are left out of the input, to be noted in the plan.
///
/// # Errors
/// Those of [`plan_work`] and [`run_plan`].
pub fn run_in(
    folder: &Path,
    job: &TinJob,
    skipped: &[Skipped],
    disk: DiskCheck,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TinReport> {
    let plan = PlanJob {
        tin: job.clone(),
        folder: folder.to_path_buf(),
        strip_rows: None,
        skipped: skipped.to_vec(),
    };
    // Whether what an earlier run here wrote may be replaced is for the run to tell.
    let is_new = !folder.join(PLAN).exists();
    let check = |maker: &Maker<'_>| if is_new { maker.check_output() } else { Ok(()) };
    plan_checked(&plan, check, progress, cancel)?;
    let run = RunJob {
        folder: folder.to_path_buf(),
        task: None,
        output: Some(job.output.clone()),
        overwrite: job.overwrite,
        split: job.split,
        solid_base: job.solid_base,
        disk,
        resources: job.resources.clone(),
    };
    run_plan(&run, progress, cancel).and_then(whole)
}

/// The report on the mesh, with the time and work of the whole run.
fn whole(run: RunReport) -> Result<TinReport> {
    let lost = || Error::new(ErrorKind::Internal, "a run ended without its mesh");
    let mut mesh = run.mesh.ok_or_else(lost)?;
    mesh.took(Duration::from_secs_f64(run.wall_seconds));
    mesh.spilled_bytes += run.spilled_bytes;
    mesh.stages.extend(run.stages);
    Ok(mesh)
}
