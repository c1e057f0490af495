//! Type-erased operations and plans, for programs that handle any kind.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json};
use terrane_options::{OptionRange, OptionTable, Options, check, to_map};

use super::kind::OutputForm;
use super::plan_file::{PlanKind, kind};
use super::report::{DescribesRun, RunReport, StatusReport, TaskReport};
use super::run::RunJob;
use crate::disk::DiskCheck;
use crate::operation::{
    self, Divisible, InputOptions, Job, Operation, OperationCall, Reads, Writes, divide, plan_of,
};
use crate::options::{FileName, Replacing};
use crate::{Cancel, Progress, Resources};
use terrane_base::error::{Error, Result};

/// A plan folder: input, options and tasks. [`Job::plan`] and the mesh builders write one; any number of processes and
/// machines that share the folder may [`run`](Self::run) the plan or single tasks of it, concurrently and repeatedly.
/// The result is byte for byte that of `write`.
#[derive(Clone, Debug)]
pub struct Plan {
    folder: PathBuf,
    division: PlanOperations,
}

/// Plan functions of a divisible operation.
#[derive(Clone, Copy, Debug)]
pub struct PlanOperations {
    /// Kind of its plans.
    pub kind: PlanKind,
    /// Unit of the task size, such as rows of tiles.
    pub task_size: &'static str,
    /// Writes a plan with tasks of the given size.
    pub plan: fn(&OperationCall<'_>, Option<u32>) -> Result<()>,
    status: fn(&Path) -> Result<PlanStatus>,
    run: fn(&RunJob, &dyn Progress, &Cancel) -> Result<PlanRun>,
}

impl PlanOperations {
    /// Functions of operation `O`.
    pub const fn of<O: Divisible>() -> Self {
        Self {
            kind: O::KIND,
            task_size: O::TASK_SIZE,
            plan: divide::<O>,
            status: |folder| O::status(folder).map(PlanStatus::of),
            run: |job, progress, cancel| O::run_plan(job, progress, cancel).map(PlanRun::of),
        }
    }
}

/// Type-erased operation.
pub struct AnyOperation {
    /// Name, with dashes.
    pub name: &'static str,
    /// Options.
    pub table: &'static OptionTable,
    /// Kind of input.
    pub reads: Reads,
    /// Kind of output.
    pub writes: Writes,
    /// Defaults of the options.
    pub defaults: fn() -> Map<String, Json>,
    /// Checks options given by name, before the input is opened.
    pub check: fn(&Map<String, Json>, &Path) -> Result<()>,
    /// Runs the operation with options by name; the reading options are already set.
    pub run: fn(&OperationCall<'_>) -> Result<Json>,
    /// Plan functions, if the operation is divisible.
    pub division: Option<PlanOperations>,
}

impl AnyOperation {
    /// Operation `O`.
    pub const fn of<O: Operation>() -> Self {
        let (reads, writes) = (<O::Input as InputOptions>::READS, O::WRITES);
        let (name, table, division) = (O::NAME, O::TABLE, None);
        let (check, run) = (operation::check_options::<O>, operation::run::<O>);
        let defaults = defaults::<O>;
        Self { name, table, reads, writes, defaults, check, run, division }
    }

    /// Divisible operation `O`.
    pub const fn divisible<O: Divisible>() -> Self {
        Self { division: Some(PlanOperations::of::<O>()), ..Self::of::<O>() }
    }

    /// Unit of the task size of its plans, if the operation is divisible.
    pub fn task_size(&self) -> Option<&'static str> {
        self.division.map(|division| division.task_size)
    }

    /// Writes a plan into a folder, the output of the call.
    ///
    /// # Errors
    /// The operation is not divisible; the errors of [`Job::plan`].
    pub fn plan(&self, call: &OperationCall<'_>, task_size: Option<u32>) -> Result<Plan> {
        let Some(division) = self.division else {
            return Err(Error::usage(format!("{} cannot be planned", self.name))
                .remedy("run it without a plan"));
        };
        (division.plan)(call, task_size)?;
        Plan::divided(call.request.output, division)
    }
}

fn defaults<O: Operation>() -> Map<String, Json> {
    to_map(&O::default())
}

/// Progress of a [`Plan`].
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlanStatus {
    /// Pending tasks in a valid order; the last one, `finish`, writes the result.
    pub to_do: Vec<TaskReport>,
    /// Number of finished tasks.
    pub done: u64,
    /// Tasks with damaged results; they are pending as well.
    pub damaged: Vec<String>,
    /// Estimated seconds for the pending tasks on this machine.
    pub seconds: f64,
    /// Minimum memory per task, in bytes.
    pub least_memory: u64,
    /// Disk space for the pending tasks, including the result, in bytes.
    pub disk_needed: u64,
    /// Path of the result, if it is written and unaltered.
    pub written: Option<PathBuf>,
    /// Fault of a written result: missing or altered.
    pub fault: Option<String>,
}

/// Report of a run of a [`Plan`].
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlanRun {
    /// Number of tasks of the plan.
    pub tasks: u64,
    /// Number of tasks finished before this run.
    pub found: u64,
    /// Tasks finished before this run whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks finished by this run.
    pub made: Vec<String>,
    /// Path of the result, if it is written.
    pub written: Option<PathBuf>,
}

impl Plan {
    /// Opens the plan in a folder; its operation is one of `operations`.
    ///
    /// # Errors
    /// The folder has no plan, or a plan of another operation. Other faults are reported by `status` and `run`.
    pub fn open(folder: impl Into<PathBuf>, operations: &[AnyOperation]) -> Result<Self> {
        let folder = folder.into();
        let kind = kind(&folder)?;
        let mut divisions = operations.iter().filter_map(|operation| operation.division);
        match divisions.find(|division| division.kind == kind) {
            Some(division) => Ok(Self { folder, division }),
            None => Err(another(&folder, kind)),
        }
    }

    /// Opens the plan of an operation in a folder.
    pub(crate) fn divided(folder: impl Into<PathBuf>, division: PlanOperations) -> Result<Self> {
        let folder = folder.into();
        let kind = kind(&folder)?;
        if kind != division.kind {
            return Err(another(&folder, kind));
        }
        Ok(Self { folder, division })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Reports the progress. Checks results quickly, without reading them through.
    ///
    /// # Errors
    /// A damaged plan, or a plan of another version.
    pub fn status(&self) -> Result<PlanStatus> {
        (self.division.status)(&self.folder)
    }

    /// Prepares a run of the plan.
    pub fn run(&self) -> Job<'_, RunOptions, Self> {
        Job::new(self.clone(), RunOptions::default())
    }
}

/// The error for a plan of an operation that is not listed.
fn another(folder: &Path, kind: PlanKind) -> Error {
    Error::usage(format!("holds a plan for {}", kind.what()))
        .in_file(folder)
        .remedy("name the folder of another plan")
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
            fault: report.last_output.output_fault,
            written: report.last_output.output.map(PathBuf::from),
        }
    }
}

/// Run a plan
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(setters = own)]
pub struct RunOptions {
    /// Single task to run, such as strip-0, seam-0, choose-0, tile-0, near-0, squares-0 or finish. Tasks may run in
    /// parallel on all machines that share the folder and the input
    #[option(value = "ID")]
    pub task: Option<String>,
    /// Output file, or output folder for tiles or points
    #[option(short = 'o', value = "FILE", with = FileName, default_text = "in the plan folder", heading = "Output")]
    pub output: Option<PathBuf>,
    /// Write a mesh of a grid as a folder: one mesh for every N x N tiles and an index (GeoJSON)
    #[option(value = "N", range = OptionRange::new(1.0, 65_536.0), heading = "Output")]
    pub split: Option<u32>,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Check free disk space for task results and output before starting
    #[option(
        default = true,
        off = "Start even if disk space seems insufficient for task results and the output",
        heading = "Resources"
    )]
    pub disk_check: bool,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

impl RunOptions {
    /// The run of the plan in a folder.
    ///
    /// # Errors
    /// Usage: an output for a task that does not write one.
    pub fn job(&self, folder: PathBuf) -> Result<RunJob> {
        check(self)?;
        let Self { task, output, split, replacing, disk_check, resources } = self.clone();
        let overwrite = replacing.overwrite;
        let is_part = task.as_deref().is_some_and(|task| task != "finish");
        let given =
            [("output", output.is_some()), ("overwrite", overwrite), ("split", split.is_some())];
        if let Some((name, _)) = given.into_iter().find(|(_, is)| is_part && *is) {
            return Err(Error::usage("only the last task writes a result")
                .remedy(format!("leave ‹{name}› out, or pass it with the task finish")));
        }
        let disk = if disk_check { DiskCheck::On } else { DiskCheck::Off };
        let form = OutputForm { split, ..OutputForm::default() };
        Ok(RunJob { folder, task, output, overwrite, form, disk, resources })
    }
}

impl Job<'_, RunOptions, Plan> {
    /// Runs the pending tasks. Skips intact finished tasks and repeats damaged ones; finished tasks are kept however
    /// the run ends.
    ///
    /// # Errors
    /// The input has changed; the task is unknown or its inputs are not done
    /// ([`ErrorKind::NotYet`](terrane_base::ErrorKind::NotYet)); an output is given for a task that does not write one;
    /// too little memory or disk space; the output exists; cancelled.
    pub fn run(self) -> Result<PlanRun> {
        self.act(|plan, options, progress, cancel| {
            (plan.division.run)(&options.job(plan.folder)?, progress, cancel)
        })
    }
}

impl<O: Divisible> Job<'_, O> {
    /// Writes a plan into a folder, so that the work can be done in pieces and by many machines.
    /// [`Divisible::TASK_SIZE`] names the unit of `task_size`; the default is a task of moderate size.
    ///
    /// # Errors
    /// The errors of [`write`](Self::write) that are found before the work; options that plans do not support; a folder
    /// with other contents.
    pub fn plan(
        self,
        folder: impl Into<PathBuf>,
        task_size: impl Into<Option<u32>>,
    ) -> Result<Plan> {
        let (folder, task_size) = (folder.into(), task_size.into());
        self.with_request(&folder, |options, request| {
            plan_of(options, request, task_size).map(drop)
        })?;
        Plan::divided(folder, PlanOperations::of::<O>())
    }
}

impl PlanRun {
    fn of<R: DescribesRun>(report: RunReport<R>) -> Self {
        Self {
            written: report.of.written().map(PathBuf::from),
            tasks: report.tasks,
            found: report.found,
            damaged: report.damaged,
            made: report.made,
        }
    }
}
