//! Work that may be killed, or done by many machines: plans in folders.

use std::path::{Path, PathBuf};

use super::run::{Run, overwrite_setting, run_settings};
use terrane_base::{Error, Result};
use terrane_jobs::cloud_tin::plan::{cloud_tin_status, run_cloud_tin};
use terrane_jobs::grid::plan::{grid_status, run_grid};
use terrane_jobs::plan::{
    DiskCheck, Kind, RunJob, RunReport, StatusReport, TaskReport, Written, kind,
};
use terrane_jobs::tiles::{run_tiles, tiles_status};
use terrane_jobs::tin::{Form, run_plan, status_of};
use terrane_jobs::translate::plan::{points_status, run_points};

/// A plan in a folder: what is to be made, of what, by which tasks. [`TinBuilder::plan`],
/// [`CloudTinBuilder::plan`], [`GridBuilder::plan`], [`TilesBuilder::plan`] and [`PointsBuilder::plan_squares`] write one; any number of processes and
/// machines that see the folder may [`run`](Self::run) it, or its tasks, at the same time and as often as they like. What comes out is, byte
/// for byte, what the builder's `write` gives.
///
/// [`TinBuilder::plan`]: crate::TinBuilder::plan
/// [`CloudTinBuilder::plan`]: crate::CloudTinBuilder::plan
/// [`GridBuilder::plan`]: crate::GridBuilder::plan
/// [`TilesBuilder::plan`]: crate::TilesBuilder::plan
/// [`PointsBuilder::plan_squares`]: crate::PointsBuilder::plan_squares
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let (work, mesh) = (folder.path().join("work"), folder.path().join("mesh.ply"));
/// # let file = folder.path().join("dem.tif");
/// # terrane::open("synth:rough,size=300,seed=7")?.convert().write(&file)?;
/// let dem = terrane::open(&file)?;
/// let plan = dem.tin().max_error(2.0).tile(64).plan(&work, 1)?;
/// for task in plan.status()?.to_do.iter().filter(|task| task.after.is_empty() && task.id != "finish") {
///     plan.run().task(&task.id).run()?; // anywhere, in any order
/// }
/// let done = plan.run().output(&mesh).run()?; // what is left, and the mesh
/// assert_eq!(done.written.as_deref(), Some(mesh.as_path()));
/// assert!(dem.verify(&mesh).run()?.verdict.passed);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Plan {
    folder: PathBuf,
    kind: Kind,
}

/// How far the work on a [`Plan`] has come.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlanStatus {
    /// Tasks that are not done, in an order in which they can be; the last one, `finish`, writes the result.
    pub to_do: Vec<TaskReport>,
    /// Tasks that are done.
    pub done: u64,
    /// Tasks whose results are damaged; they are among those not done.
    pub damaged: Vec<String>,
    /// Seconds that the rest takes on this machine, about.
    pub seconds: f64,
    /// Least bytes of memory for a task.
    pub least_memory: u64,
    /// Bytes on disk that the rest takes, the result included.
    pub disk_needed: u64,
    /// Where the result is, once it is written and as long as it is as it was written.
    pub written: Option<PathBuf>,
    /// What is wrong with the result if it was written and is not as it was: it is missing, or altered.
    pub fault: Option<String>,
}

/// What a run of a [`Plan`] did.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlanRun {
    /// Tasks of the plan.
    pub tasks: u64,
    /// Tasks that were done before.
    pub found: u64,
    /// Tasks that were done before and whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks done by this run.
    pub made: Vec<String>,
    /// Where the result is, if it is written.
    pub written: Option<PathBuf>,
}

impl Plan {
    /// Opens the plan in a folder.
    ///
    /// # Errors
    /// A folder without a plan, or with one of no known kind. What else is wrong with it is told when it is
    /// looked at or run.
    pub fn open(folder: impl Into<PathBuf>) -> Result<Self> {
        let folder = folder.into();
        Ok(Self { kind: kind(&folder)?, folder })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How far the work has come. Results are looked at, not read through.
    ///
    /// # Errors
    /// A damaged plan, or one of another version.
    pub fn status(&self) -> Result<PlanStatus> {
        match self.kind {
            Kind::Tin => status_of(&self.folder).map(PlanStatus::of),
            Kind::Cloud => cloud_tin_status(&self.folder).map(PlanStatus::of),
            Kind::Grid => grid_status(&self.folder).map(PlanStatus::of),
            Kind::Tiles => tiles_status(&self.folder).map(PlanStatus::of),
            Kind::Points => points_status(&self.folder).map(PlanStatus::of),
        }
    }

    /// Work on it.
    pub fn run(&self) -> PlanBuilder<'_> {
        PlanBuilder { plan: self, task: None, output: None, check_disk: true, run: Run::default() }
    }
}

impl PlanStatus {
    fn of<S>(report: StatusReport<S>) -> Self {
        let output = if report.to_do.is_empty() { 0 } else { report.forecast.output_bytes };
        Self {
            to_do: report.to_do,
            done: report.done,
            damaged: report.damaged,
            seconds: report.forecast.seconds,
            least_memory: report.forecast.least_memory,
            disk_needed: report.forecast.disk_needed + output,
            fault: report.told.output_fault,
            written: report.told.output.map(PathBuf::from),
        }
    }
}

/// A run of a [`Plan`] to be done.
pub struct PlanBuilder<'a> {
    plan: &'a Plan,
    task: Option<String>,
    output: Option<PathBuf>,
    check_disk: bool,
    run: Run,
}

run_settings!([] PlanBuilder<'_>);
overwrite_setting!([] PlanBuilder<'_>);

impl PlanBuilder<'_> {
    /// Only this task, instead of all that is not done.
    pub fn task(mut self, name: impl Into<String>) -> Self {
        self.task = Some(name.into());
        self
    }

    /// Where the result is written; into the folder unless told otherwise.
    pub fn output(mut self, path: impl Into<PathBuf>) -> Self {
        self.output = Some(path.into());
        self
    }

    /// Fail before the work where the disk seems to have too little room (so it is unless told otherwise).
    pub fn check_disk(mut self, check: bool) -> Self {
        self.check_disk = check;
        self
    }

    /// Does the work. Tasks that are done and sound are left alone, damaged ones done again; what is done
    /// stays done however this ends.
    ///
    /// # Errors
    /// An input that is not what it was; a task there is not, or whose inputs are not done
    /// ([`ErrorKind::NotYet`](crate::ErrorKind::NotYet)), or one that writes nothing and is given an output; too little memory or disk; an output that exists;
    /// cancelled.
    pub fn run(self) -> Result<PlanRun> {
        let is_part = self.task.as_deref().is_some_and(|task| task != "finish");
        if is_part && (self.output.is_some() || self.run.overwrite) {
            return Err(Error::usage("only the last task writes a result")
                .remedy("leave output and overwrite out, or run the task \"finish\""));
        }
        let resources = self.run.resources()?;
        let disk = if self.check_disk { DiskCheck::On } else { DiskCheck::Off };
        let Run { overwrite, progress, cancel, .. } = self.run;
        let (folder, task, output) = (self.plan.folder.clone(), self.task, self.output);
        let job = RunJob { folder, task, output, overwrite, form: (), disk, resources };
        match self.plan.kind {
            Kind::Tin => {
                run_plan(&job.formed(Form::default()), &*progress, &cancel).map(PlanRun::of)
            }
            Kind::Cloud => run_cloud_tin(&job, &*progress, &cancel).map(PlanRun::of),
            Kind::Grid => run_grid(&job, &*progress, &cancel).map(PlanRun::of),
            Kind::Tiles => run_tiles(&job, &*progress, &cancel).map(PlanRun::of),
            Kind::Points => run_points(&job, &*progress, &cancel).map(PlanRun::of),
        }
    }
}

impl PlanRun {
    fn of<R: Written>(report: RunReport<R>) -> Self {
        Self {
            written: report.of.written().map(PathBuf::from),
            tasks: report.tasks,
            found: report.found,
            damaged: report.damaged,
            made: report.made,
        }
    }
}
