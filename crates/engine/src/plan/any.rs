//! Operations and plans of any kind, as a program has them.

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

/// A plan in a folder: what is to be made, of what, by which tasks. [`Job::plan`] and the builders of meshes write one; any
/// number of processes and machines that see the folder may [`run`](Self::run) it, or its tasks, at the same time and as
/// often as they like. What comes out is, byte for byte, what `write` gives.
#[derive(Clone, Debug)]
pub struct Plan {
    folder: PathBuf,
    division: PlanOperations,
}

/// What is done with the plans of an operation that can be divided.
#[derive(Clone, Copy, Debug)]
pub struct PlanOperations {
    /// Their kind.
    pub kind: PlanKind,
    /// What a task has so many of, for people.
    pub task_size: &'static str,
    /// Writes one down, with tasks of a size.
    pub plan: fn(&OperationCall<'_>, Option<u32>) -> Result<()>,
    status: fn(&Path) -> Result<PlanStatus>,
    run: fn(&RunJob, &dyn Progress, &Cancel) -> Result<PlanRun>,
}

impl PlanOperations {
    /// Of an operation.
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

/// An operation whose type does not matter any more.
pub struct AnyOperation {
    /// Its name, with dashes.
    pub name: &'static str,
    /// Its options.
    pub table: &'static OptionTable,
    /// What it reads.
    pub reads: Reads,
    /// What it writes.
    pub writes: Writes,
    /// The defaults of its options.
    pub defaults: fn() -> Map<String, Json>,
    /// What can be known of options by name before anything is opened.
    pub check: fn(&Map<String, Json>, &Path) -> Result<()>,
    /// Runs it with options by name, where how the grid is read is said already.
    pub run: fn(&OperationCall<'_>) -> Result<Json>,
    /// What its plans do, where it can be divided.
    pub division: Option<PlanOperations>,
}

impl AnyOperation {
    /// The operation of these options.
    pub const fn of<O: Operation>() -> Self {
        let defaults = || to_map(&O::default());
        let (reads, writes) = (<O::Input as InputOptions>::READS, O::WRITES);
        let (name, table, division) = (O::NAME, O::TABLE, None);
        let (check, run) = (operation::check_options::<O>, operation::run::<O>);
        Self { name, table, reads, writes, defaults, check, run, division }
    }

    /// The same of options whose work can be divided.
    pub const fn divisible<O: Divisible>() -> Self {
        Self { division: Some(PlanOperations::of::<O>()), ..Self::of::<O>() }
    }

    /// What a task of its plan has so many of, for people, where it can be divided.
    pub fn task_size(&self) -> Option<&'static str> {
        self.division.map(|division| division.task_size)
    }

    /// Writes down the work in a folder, which is the output of the call.
    ///
    /// # Errors
    /// An operation that cannot be divided; those of [`Job::plan`].
    pub fn plan(&self, call: &OperationCall<'_>, task_size: Option<u32>) -> Result<Plan> {
        let Some(division) = self.division else {
            return Err(Error::usage(format!("{} cannot be planned", self.name))
                .remedy("run it without a plan"));
        };
        (division.plan)(call, task_size)?;
        Plan::divided(call.request.output, division)
    }
}

/// How far the work on an [`Plan`] has come.
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

/// What a run of an [`Plan`] did.
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
    /// Opens the plan in a folder, which is of one of these operations.
    ///
    /// # Errors
    /// A folder without a plan, or with one of another operation. What else is wrong with it is told when it is
    /// looked at or run.
    pub fn open(folder: impl Into<PathBuf>, operations: &[AnyOperation]) -> Result<Self> {
        let folder = folder.into();
        let kind = kind(&folder)?;
        let mut divisions = operations.iter().filter_map(|operation| operation.division);
        match divisions.find(|division| division.kind == kind) {
            Some(division) => Ok(Self { folder, division }),
            None => Err(another(&folder, kind)),
        }
    }

    /// The plan in a folder, of an operation.
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

    /// How far the work has come. Results are looked at, not read through.
    ///
    /// # Errors
    /// A damaged plan, or one of another version.
    pub fn status(&self) -> Result<PlanStatus> {
        (self.division.status)(&self.folder)
    }

    /// Work on it.
    pub fn run(&self) -> Job<'_, RunOptions, Self> {
        Job::new(self.clone(), RunOptions::default())
    }
}

/// The error of a folder whose plan is of an operation that is not meant.
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
            fault: report.told.output_fault,
            written: report.told.output.map(PathBuf::from),
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
    /// The work on the plan in a folder.
    ///
    /// # Errors
    /// Usage: an output of a task that writes none.
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
    /// Does the work. Tasks that are done and sound are left alone, damaged ones done again; what is done
    /// stays done however this ends.
    ///
    /// # Errors
    /// An input that is not what it was; a task there is not, or whose inputs are not done
    /// ([`ErrorKind::NotYet`](terrane_base::ErrorKind::NotYet)), or one that writes nothing and is given an output; too
    /// little memory or disk; an output that exists; cancelled.
    pub fn run(self) -> Result<PlanRun> {
        self.act(|plan, options, progress, cancel| {
            (plan.division.run)(&options.job(plan.folder)?, progress, cancel)
        })
    }
}

impl<O: Divisible> Job<'_, O> {
    /// Writes down in a folder what is to be made and by which tasks, so that it can be done by pieces and by many
    /// machines. What `task_size` counts is said by [`Divisible::TASK_SIZE`]; tasks are as large as makes a fair piece of
    /// work unless told otherwise.
    ///
    /// # Errors
    /// Those of [`write`](Self::write) that are found before the work; options that cannot act in pieces; a folder that
    /// holds something else.
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
