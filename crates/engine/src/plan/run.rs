//! Runs a plan or a single task, and reports the progress.
//!
//! A task that finds a damaged input artifact remakes it and continues; it never uses bytes without a verified digest.
//! The plan records disk estimates for artifacts and output, from small samples and on the high side; a run compares
//! them with the free space before it starts.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::artifact::{CheckDepth, FinishedArtifact};
use super::folder::{PlanFolder, TaskStates};
use super::kind::{MadeArtifact, OutputForm, OutputRequest, PlanStep, PlannedWork, RunControl};
use super::output::{PlanOutput, last_output};
use super::plan_file::{PLAN, PlanKind};
use super::report::{RunReport, StatusReport};
use crate::disk::DiskCheck;
use crate::skip_bad::Skipped;
use crate::{Cancel, Progress, Resources, Silent, json, peak_memory};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::refuse_existing;

/// A plan to make from a job.
#[derive(Clone, Debug)]
pub struct PlanJob<J> {
    /// The job; its output sets the format and is not written.
    pub job: J,
    /// The plan folder: new, empty, or with the same plan.
    pub folder: PathBuf,
    /// Task size: rows of tiles of a mesh, or cells along a tile of a grid; `None` is a moderate size.
    pub cut: Option<u32>,
    /// Damaged files that are left out of the input, recorded in the plan.
    pub skipped: Vec<Skipped>,
}

impl<J> PlanJob<J> {
    /// Fails if tasks are smaller than `min`; `description` is the text for the message.
    pub fn check_size(&self, min: u32, description: &str) -> Result<()> {
        match self.cut.filter(|cut| *cut < min) {
            None => Ok(()),
            Some(cut) => {
                Err(Error::usage(format!("‹task_size› is {cut}: tasks have {description}"))
                    .remedy(format!("pass {min} or more, or leave ‹task_size› out")))
            }
        }
    }
}

impl<J: Clone> PlanJob<J> {
    /// A job in tasks of moderate size.
    pub fn all(job: &J, folder: &Path, skipped: &[Skipped]) -> Self {
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        Self { job: job.clone(), folder, cut: None, skipped }
    }
}

/// A run of a plan: checks every byte of finished artifacts, makes missing or damaged ones, and writes the output.
/// Finished tasks are kept however the run ends. A named task that is done is skipped; a task that reads a damaged
/// artifact remakes it.
///
/// Fails with `BadInput` if the input or program differs from the plan's, with `NotYet` if another process runs all
/// tasks or the inputs of a task are not done, and with `CannotWrite` if the disk has too little free space; also with
/// the errors of the work itself.
#[derive(Clone, Debug)]
pub struct RunJob {
    /// The plan folder.
    pub folder: PathBuf,
    /// Name of a single task; `None` for all pending tasks.
    pub task: Option<String>,
    /// Output path; `None` is `mesh` or `grid` with the extension of the format, in the folder.
    pub output: Option<PathBuf>,
    /// Overwrite existing output.
    pub overwrite: bool,
    /// Output options.
    pub form: OutputForm,
    /// Whether to check free disk space first.
    pub disk: DiskCheck,
    /// Resource limits.
    pub resources: Resources,
}

impl RunJob {
    /// A run of all pending tasks of a folder, up to the output.
    pub fn until(
        folder: &Path,
        output: &Path,
        overwrite: bool,
        form: OutputForm,
        disk: DiskCheck,
        resources: &Resources,
    ) -> Self {
        Self {
            folder: folder.to_path_buf(),
            task: None,
            output: Some(output.to_path_buf()),
            overwrite,
            form,
            disk,
            resources: resources.clone(),
        }
    }
}

/// Progress of the plan in the folder `path`; checks artifacts quickly, without reading them through.
pub fn status<W: PlannedWork>(path: &Path) -> Result<StatusReport<W::Status>> {
    let (folder, cancel) = (PlanFolder::<W>::open(path)?, Cancel::default());
    let states = TaskStates::of_all(
        &folder,
        CheckDepth::Quick,
        RunControl { progress: &Silent, cancel: &cancel },
    )?;
    let last_output = last_output(&folder.path, folder.id)?;
    let (work, tasks) = (&folder.plan.work, folder.tasks());
    let finish = last_output.output.is_none().then_some(PlanStep::Finish);
    let left = tasks.iter().copied().filter(|task| states.is_missing(*task)).map(PlanStep::Task);
    let left: Vec<PlanStep<W::Task>> = left.chain(finish).collect();
    Ok(StatusReport {
        folder: folder.path.display().to_string(),
        plan_id: folder.id.to_string(),
        input: folder.plan.label.clone(),
        work: work.size(PlanStep::Finish),
        to_do: left.iter().map(|task| folder.task_report(*task)).collect(),
        done: (tasks.len() + 1 - left.len()) as u64,
        damaged: states.damaged.iter().map(W::Task::to_string).collect(),
        object_bytes: states.done.values().map(|done| done.bytes).sum(),
        forecast: folder.plan.forecast(&left),
        last_output,
        skipped: folder.plan.skipped.clone(),
        ..work.status()
    })
}

/// Runs a plan; the name of the output must match the format of the plan.
pub fn run_named<W: PlannedWork>(
    job: &RunJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<RunReport<W::Run>> {
    run_checked(job, check_name::<W>, RunControl { progress, cancel })
}

/// Runs a plan.
pub fn run<W: PlannedWork>(
    job: &RunJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<RunReport<W::Run>> {
    run_checked(job, |_, _: &W| Ok(()), RunControl { progress, cancel })
}

fn check_name<W: PlannedWork>(job: &RunJob, work: &W) -> Result<()> {
    job.output.as_deref().map_or(Ok(()), |output| work.check_name(output, &job.form))
}

fn run_checked<W: PlannedWork>(
    job: &RunJob,
    check: impl FnOnce(&RunJob, &W) -> Result<()>,
    at: RunControl<'_>,
) -> Result<RunReport<W::Run>> {
    let started = Instant::now();
    if W::KIND != PlanKind::Tin && job.form != OutputForm::default() {
        let message = format!(
            "‹split› requires a plan for a mesh of a grid; this plan is for {}",
            W::KIND.what()
        );
        return Err(Error::usage(message).remedy("leave ‹split› out"));
    }
    let folder = PlanFolder::<W>::open(&job.folder)?;
    check(job, &folder.plan.work)?;
    let task = job.task.as_deref().map(|name| folder.named(name)).transpose()?;
    // A named binding lives to the end of the run; `let _` would unlock at once.
    let _lock = folder.enter(task.is_none())?;
    folder.plan.check_files(task.is_none())?;
    let done = match task {
        None => RunningPlan::new(&folder, job, true, at).and_then(RunningPlan::all),
        Some(PlanStep::Finish) => {
            RunningPlan::new(&folder, job, true, at).and_then(RunningPlan::finish)
        }
        Some(PlanStep::Task(task)) => {
            RunningPlan::new(&folder, job, false, at).and_then(|run| run.run_task(task))
        }
    };
    let mut report = done.map_err(keep_error)?;
    report.wall_seconds = started.elapsed().as_secs_f64();
    report.peak_memory = peak_memory();
    Ok(report)
}

/// Plans with `plan` and runs the pending tasks, so that an interrupted run resumes.
pub fn run_in<W: PlannedWork>(
    job: &RunJob,
    plan: impl FnOnce() -> Result<()>,
    RunControl { progress, cancel }: RunControl<'_>,
) -> Result<RunReport<W::Run>> {
    // With an existing plan, the run decides whether the output may be replaced.
    if let (Some(output), false) = (&job.output, job.folder.join(PLAN).exists()) {
        refuse_existing(output, job.overwrite)?;
    }
    plan()?;
    run::<W>(job, progress, cancel)
}

/// Adds to the error of an interrupted run that its work is kept.
fn keep_error(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Interrupted => {
            Error::new(ErrorKind::Interrupted, "interrupted; finished tasks are kept")
                .remedy("run again to continue")
        }
        _ => error,
    }
}

/// A run in progress.
struct RunningPlan<'a, W: PlannedWork> {
    folder: &'a PlanFolder<W>,
    opened: W::Opened,
    output: PlanOutput,
    /// The report of an output that is already written and unaltered.
    note: Option<W::Note>,
    disk: DiskCheck,
    at: RunControl<'a>,
    report: RunReport<W::Run>,
}

impl<'a, W: PlannedWork> RunningPlan<'a, W> {
    /// Opens the input; a run that `writes` the output checks the existing file first.
    fn new(
        folder: &'a PlanFolder<W>,
        job: &RunJob,
        writes: bool,
        at: RunControl<'a>,
    ) -> Result<Self> {
        let path = match &job.output {
            Some(path) => path.clone(),
            None => folder.path.join(folder.plan.work.output(&job.form)?),
        };
        let form = json::to_value(&job.form).unwrap_or_default();
        let output = PlanOutput::new(&folder.path, folder.id, &path, form)?;
        let (note, overwrite) = match writes {
            true => output.claim(job.overwrite, at.cancel)?,
            false => (None, job.overwrite),
        };
        let writes = writes && note.is_none();
        if writes {
            folder.refuse_own(&path)?;
        }
        let mut resources = job.resources.clone();
        resources.temp_dir.get_or_insert_with(|| folder.path.clone());
        let order = OutputRequest { output: path, overwrite, form: job.form, resources };
        let opened = W::open(&folder.plan, order)?;
        if writes {
            W::check_output(&opened, at)?;
        }
        let (disk, report) = (job.disk, Self::empty_report(folder));
        Ok(Self { folder, opened, output, note, disk, at, report })
    }

    /// The report at the start of a run.
    fn empty_report(folder: &PlanFolder<W>) -> RunReport<W::Run> {
        RunReport {
            folder: folder.path.display().to_string(),
            plan_id: folder.id.to_string(),
            tasks: folder.tasks().len() as u64 + 1,
            skipped: folder.plan.skipped.clone(),
            ..RunReport::default()
        }
    }

    /// Runs all pending tasks.
    fn all(mut self) -> Result<RunReport<W::Run>> {
        let mut states = self.check_done()?;
        let mut to_do = self.folder.tasks();
        to_do.retain(|task| states.is_missing(*task));
        self.check_disk(&to_do, self.note.is_none())?;
        self.staged(W::STAGE.unwrap_or_default(), &to_do, |run| {
            to_do.iter().try_for_each(|task| run.make_missing(*task, &mut states))
        })?;
        self.end(&states)
    }

    /// Runs one task that is not the last.
    fn run_task(mut self, task: W::Task) -> Result<RunReport<W::Run>> {
        let mut states = TaskStates::around(self.folder, task, CheckDepth::Quick, self.at)?;
        if states.is_missing(task) {
            self.check_disk(&[task], false)?;
            self.staged(&task.to_string(), &[task], |run| {
                run.mending(
                    &mut states,
                    |run| TaskStates::around(run.folder, task, CheckDepth::Whole, run.at),
                    |run, states| run.make_missing(task, states),
                )
            })?;
        }
        Ok(self.conclude(&states))
    }

    /// Runs the last task.
    fn finish(mut self) -> Result<RunReport<W::Run>> {
        if self.note.is_some() {
            let nothing = TaskStates::new(self.folder);
            return self.end(&nothing);
        }
        let mut states = match W::LAST_LOOK {
            CheckDepth::Quick => {
                TaskStates::of_all(self.folder, CheckDepth::Quick, self.at.silent())?
            }
            CheckDepth::Whole => self.check_done()?,
        };
        states.check_all()?;
        self.check_disk(&states.damaged, true)?;
        self.mending(&mut states, Self::check_done, |run, states| {
            states.check_all().and_then(|()| run.write(states))
        })?;
        Ok(self.conclude(&states))
    }

    /// Checks every byte of finished artifacts.
    fn check_done(&self) -> Result<TaskStates<'a, W>> {
        self.at.progress.begin("check finished tasks", self.folder.tasks().len() as u64);
        let states = TaskStates::of_all(self.folder, CheckDepth::Whole, self.at)?;
        self.at.progress.end();
        Ok(states)
    }

    /// Does `work` as a stage of that name, if tasks have no stages of their own.
    fn staged(
        &mut self,
        name: &str,
        tasks: &[W::Task],
        work: impl FnOnce(&mut Self) -> Result<()>,
    ) -> Result<()> {
        if W::STAGE.is_none() {
            return work(self);
        }
        let sizes = tasks.iter().map(|task| self.folder.plan.work.size(PlanStep::Task(*task)));
        self.at.progress.begin(name, sizes.sum());
        work(self)?;
        self.at.progress.end();
        Ok(())
    }

    /// Runs `work`. Remakes damaged artifacts first; if the work fails to read an artifact, checks every byte (`check`)
    /// and, if damage was found, does the work once more.
    fn mending(
        &mut self,
        states: &mut TaskStates<'a, W>,
        check: impl Fn(&Self) -> Result<TaskStates<'a, W>>,
        work: impl Fn(&mut Self, &mut TaskStates<'a, W>) -> Result<()>,
    ) -> Result<()> {
        self.mend(states)?;
        let error = match work(self, states) {
            // What cannot be written is no object that could be damaged.
            Err(error)
                if error.kind() == ErrorKind::Io
                    && error.path().is_none_or(|path| path.starts_with(&self.folder.path)) =>
            {
                error
            }
            other => return other,
        };
        *states = check(self)?;
        if states.damaged.is_empty() {
            return Err(error);
        }
        self.mend(states)?;
        work(self, states)
    }

    /// Remakes damaged artifacts.
    fn mend(&mut self, states: &mut TaskStates<'a, W>) -> Result<()> {
        if states.damaged.is_empty() {
            return Ok(());
        }
        for task in self.folder.tasks() {
            // Its key may not have been known before.
            states.inspect_again(task, self.at)?;
            if states.damaged.contains(&task) {
                self.make_missing(task, states)?;
            }
        }
        Ok(())
    }

    /// Makes a task's artifact unless it exists.
    fn make_missing(&mut self, task: W::Task, states: &mut TaskStates<'a, W>) -> Result<()> {
        states.inspect_again(task, self.at)?;
        if !states.is_missing(task) {
            return Ok(());
        }
        if states.damaged.contains(&task) {
            self.report.damaged.push(task.to_string());
        }
        let place = states.place(task)?;
        let (object, report) = ((task, &*place.file), &mut self.report.of);
        let MadeArtifact { facts, digest, spilled } =
            W::make(&self.opened, object, states, report, self.at)?;
        let done = FinishedArtifact::seal(&place, facts, digest)?;
        self.report.made.push(task.to_string());
        self.report.made_bytes += done.bytes;
        self.report.spilled_bytes += spilled;
        states.done.insert(task, done);
        Ok(())
    }

    /// Fails if the disks lack space for the artifacts of these tasks and, if it is written, the output.
    fn check_disk(&self, tasks: &[W::Task], writes: bool) -> Result<()> {
        let left: Vec<_> = tasks.iter().copied().map(PlanStep::Task).collect();
        let forecast = self.folder.plan.forecast(&left);
        let written = if writes { forecast.output_bytes } else { 0 };
        self.disk.check(&self.folder.path, &self.output.path, [forecast.disk_needed, written])
    }

    /// Writes the output from all artifacts.
    fn write(&mut self, states: &TaskStates<'a, W>) -> Result<()> {
        // Once more: the tasks may have taken days.
        W::check_output(&self.opened, self.at)?;
        // Noted first: what a killed run leaves in the output's place is then known as its own, and may be
        // replaced without being asked for.
        self.output.begin()?;
        let note = W::write(&self.opened, states, &mut self.report.of, self.at)?;
        self.output.finish(&note, self.at.cancel)?;
        self.report.finished = true;
        Ok(())
    }

    /// Ends with the output, which may exist already.
    fn end(mut self, states: &TaskStates<'a, W>) -> Result<RunReport<W::Run>> {
        match self.note.take() {
            Some(note) => W::written(note, &self.output.path, &mut self.report.of),
            None => self.write(states)?,
        }
        Ok(self.conclude(states))
    }

    fn conclude(mut self, states: &TaskStates<'a, W>) -> RunReport<W::Run> {
        let bytes: u64 = states.done.values().map(|done| done.bytes).sum();
        self.report.found = (states.done.len() - self.report.made.len()) as u64;
        self.report.found_bytes = bytes - self.report.made_bytes;
        self.report
    }
}
