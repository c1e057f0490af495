//! Meshes by plan: work in units that many machines can share and that survive being killed.

mod mesh;
mod object;
mod shelf;
mod tasks;

use std::path::Path;
use std::time::Duration;

use serde::Serialize;

pub(super) use object::{ObjectWriter, Record};

use super::estimate::Estimator;
use super::job::{Goal, TinJob};
use super::make::{Maker, Opened, in_input};
use super::refinement::Refinement;
use super::report::{Clock, StageReport, TinReport};
use crate::plan::{self, DiskCheck, PLAN, Plan, Written};
use crate::sift::Skipped;
use crate::transform::Transform;
use crate::{Cancel, Progress};
use mesh::Mesh;
use terrane_base::error::{Error, Result};
use terrane_files::refuse_held;
use terrane_tin::Spec;

/// A mesh to plan.
pub type PlanJob = plan::PlanJob<TinJob>;
/// Work on the plan of a mesh.
pub type RunJob = plan::RunJob<Form>;
/// The plan of a mesh, or how far the work on it has come.
pub type StatusReport = plan::StatusReport<MeshStatus>;
/// What a run of the plan of a mesh did.
pub type RunReport = plan::RunReport<MeshRun>;

/// What is asked of a mesh beside what its plan says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Form {
    /// Write a folder of meshes, each of so many by so many tiles.
    pub split: Option<u32>,
    /// STL and 3MF: close the surface down to this height.
    pub solid_base: Option<f64>,
}

/// What is told of the plan of a mesh alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct MeshStatus {
    pub max_error: f64,
    pub samples: u64,
}

/// What is told of a run on a mesh alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshRun {
    /// Samples of the strips done by this run.
    pub made_samples: u64,
    /// Time by stage, without that of writing the mesh.
    pub stages: Vec<StageReport>,
    /// The mesh, if this run came to it; its time is that of writing it.
    pub mesh: Option<TinReport>,
}

impl Written for MeshRun {
    fn written(&self) -> Option<&str> {
        self.mesh.as_ref().map(|mesh| mesh.output.as_str())
    }
}

impl Default for MeshRun {
    fn default() -> Self {
        Self { made_samples: 0, stages: Clock::default().report(), mesh: None }
    }
}

impl MeshRun {
    /// Adds the time of a task.
    fn add(&mut self, stages: Vec<StageReport>) {
        for more in stages {
            match self.stages.iter_mut().find(|stage| stage.name == more.name) {
                Some(stage) => {
                    stage.thread_seconds += more.thread_seconds;
                    stage.samples += more.samples;
                }
                None => self.stages.push(more),
            }
        }
    }
}

/// Writes down what is to be made, from what, by which tasks, and what they need. A few tiles are
/// read to tell the size of the result.
///
/// # Errors
/// Those of opening the input; `Usage` for a goal other than a tolerance, and for a folder that holds
/// another plan or other files.
pub fn plan_work(job: &PlanJob, progress: &dyn Progress, cancel: &Cancel) -> Result<StatusReport> {
    job.check_size(2, "two rows of tiles at least")?;
    plan_checked(job, |_| Ok(()), progress, cancel)
}

/// As [`plan_work`]; `check` may fail before the work.
fn plan_checked(
    job: &PlanJob,
    check: impl FnOnce(&Maker<'_>) -> Result<()>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<StatusReport> {
    job.job.goal.check()?;
    if !matches!(job.job.goal, Goal::MaxError(_)) {
        return Err(budget());
    }
    refuse_held(job.job.input.names())?;
    let reading = job.job.reading.absolute()?;
    let constraints = job.job.refinement.constraints.absolute()?;
    let refinement = Refinement { constraints, ..job.job.refinement.clone() };
    let transform = job.job.transform.as_ref().map(Transform::absolute).transpose()?;
    let input = job.job.input.resolve()?;
    let tin = TinJob { input, reading, refinement, transform, ..job.job.clone() };
    let opened = Opened::new(&tin)?;
    let maker = Maker { job: &tin, opened: &opened, progress, cancel };
    check(&maker)?;
    let in_input = |error| in_input(error, &tin.input);
    let (tolerance, _) = maker.tolerance().map_err(in_input)?;
    let layout = maker.layout().map_err(in_input)?;
    let mesh = Mesh::new(&tin, &opened, job.cut)?;
    let expect = || {
        let spec = Spec { measure: false, ..maker.spec(tolerance) };
        let size = Estimator::thorough(&*opened.source, layout, opened.shares.threads, cancel)
            .and_then(|mut estimator| estimator.size_at_most(&spec))
            .map_err(in_input)?;
        let on_lines = opened.kept.lines().vertices_in(size.vertices, layout.samples());
        mesh.needs(size.with(opened.kept.count() + on_lines), &opened)
    };
    let there = Plan::<Mesh>::there(&job.folder);
    let needs = there.map_or_else(expect, |plan| Ok(plan.needs))?;
    let files = mesh::files(&tin, &*opened.source);
    Plan::new(mesh, files, needs, &job.skipped)?.put(&job.folder)?;
    status_of(&job.folder)
}

fn budget() -> Error {
    Error::usage("a plan needs a tolerance: no task alone can tell which one meets a budget")
        .remedy("pass ‹max_error›")
}

/// How far the work in the folder `path` has come; objects are looked at, not read through.
///
/// # Errors
/// A folder without the plan of a mesh.
pub fn status_of(path: &Path) -> Result<StatusReport> {
    plan::status::<Mesh>(path)
}

/// Works on the plan of a mesh, which is that of [`run`](crate::tin::run) on the same request, byte for
/// byte, whoever did which task how often.
///
/// # Errors
/// Those of a grid-to-TIN job, and of any [`RunJob`].
pub fn run_plan(job: &RunJob, progress: &dyn Progress, cancel: &Cancel) -> Result<RunReport> {
    plan::run::<Mesh>(job, progress, cancel)
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
    // Whether what an earlier run here wrote may be replaced is for the run to tell.
    let is_new = !folder.join(PLAN).exists();
    let check = |maker: &Maker<'_>| if is_new { maker.check_output() } else { Ok(()) };
    plan_checked(&PlanJob::all(job, folder, skipped), check, progress, cancel)?;
    let form = Form { split: job.split, solid_base: job.solid_base };
    let (to, with) = ((folder, &*job.output), (disk, &job.resources));
    let run = RunJob::until(to, job.overwrite, form, with);
    run_plan(&run, progress, cancel).and_then(whole)
}

/// The report on the mesh, with the time and work of the whole run.
fn whole(run: RunReport) -> Result<TinReport> {
    let mut mesh = plan::Kind::Tin.made(run.of.mesh)?;
    mesh.took(Duration::from_secs_f64(run.wall_seconds));
    mesh.spilled(run.spilled_bytes);
    mesh.stages.extend(run.of.stages);
    Ok(mesh)
}
