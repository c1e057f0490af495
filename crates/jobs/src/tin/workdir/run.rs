//! Doing what a plan says: all of it, or one task.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::json;

use super::folder::{Done, Folder, Survey};
use super::report::RunReport;
use super::shelf::Shelf;
use super::tasks::TaskId;
use crate::plan::{self, DiskCheck, Look, Output, State};
use crate::tin::job::TinJob;
use crate::tin::make::{Maker, Opened, in_input};
use crate::tin::report::{Clock, TinReport};
use crate::tin::run::{save, write};
use crate::tin::tally::Tally;
use crate::tin::worker::Stock;
use crate::{Cancel, Progress, Resources, Silent, peak_memory};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_mesh as mesh;

/// Work on a plan.
#[derive(Clone, Debug)]
pub struct RunJob {
    /// The folder of the plan.
    pub folder: PathBuf,
    /// One task by name; all that is not done when `None`.
    pub task: Option<String>,
    /// The mesh file; `mesh` with the format's ending in the folder when `None`.
    pub output: Option<PathBuf>,
    /// Replace an existing mesh.
    pub overwrite: bool,
    /// Write a folder of meshes, each of so many by so many tiles.
    pub split: Option<u32>,
    /// STL: close the surface down to this height.
    pub solid_base: Option<f64>,
    /// Whether to begin where the disk seems to have too little room.
    pub disk: DiskCheck,
    /// What the work may use.
    pub resources: Resources,
}

/// Works on a plan: looks at every byte of what is done already, does what is not or is damaged, and
/// writes the mesh. What is done stays done however the run ends. A named task that is done is left
/// alone; one that reads a damaged result makes that anew, too.
///
/// The mesh is the same as that of [`run`](crate::tin::run) on the same request, byte for
/// byte, whoever did which task how often.
///
/// # Errors
/// Those of a grid-to-TIN job, and `BadInput` for an input or program that is not what the plan was
/// made with, `NotYet` while another does all that is left and for a task whose inputs are not done,
/// `CannotWrite` when the disk has too little room.
pub fn run_plan(job: &RunJob, progress: &dyn Progress, cancel: &Cancel) -> Result<RunReport> {
    let started = Instant::now();
    let folder = Folder::open(&job.folder)?;
    let task = job.task.as_deref().map(str::parse).transpose()?;
    let mut report = match task {
        Some(task) if !folder.strips.has(task) => return Err(no_such(task, &folder)),
        Some(TaskId::Finish) => Run::new(job, folder, false, progress, cancel)?.finish(),
        Some(task) => Run::new(job, folder, false, progress, cancel)?.one(task),
        None => Run::new(job, folder, true, progress, cancel)?.all(),
    }
    .map_err(plan::kept)?;
    report.wall_seconds = started.elapsed().as_secs_f64();
    report.peak_memory = peak_memory();
    Ok(report)
}

fn no_such(task: TaskId, folder: &Folder) -> Error {
    Error::usage(format!("the plan has no task {task}"))
        .in_file(&folder.path)
        .remedy("see terrane status")
}

/// A run in progress.
struct Run<'a> {
    folder: Folder,
    tin: TinJob,
    opened: Opened,
    output: Output,
    disk: DiskCheck,
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
    report: RunReport,
    clock: Clock,
    _lock: Option<File>,
}

impl<'a> Run<'a> {
    fn new(
        job: &RunJob,
        folder: Folder,
        alone: bool,
        progress: &'a dyn Progress,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let lock = plan::enter(&folder.path, alone)?;
        folder.plan.check_files(alone)?;
        let ending = if job.split.is_some() { "blocks" } else { ending(&folder) };
        let default = || folder.path.join("mesh").with_extension(ending);
        let path = job.output.clone().unwrap_or_else(default);
        let form = json!({ "split": job.split, "solid_base": job.solid_base });
        let output = Output::new(&folder.path, folder.id, &path, form)?;
        let mut resources = job.resources.clone();
        resources.temp_dir.get_or_insert_with(|| folder.path.clone());
        let mut tin = folder.plan.job(path, job.overwrite, resources);
        (tin.solid_base, tin.split) = (job.solid_base, job.split);
        let mut opened = Opened::new(&tin)?;
        opened.height_origin = folder.plan.method.height_origin;
        folder.plan.check_source(&*opened.source)?;
        let report = RunReport {
            folder: folder.path.display().to_string(),
            plan_id: folder.id.to_string(),
            tasks: folder.plan.tasks.len() as u64,
            skipped: folder.plan.skipped.clone(),
            ..RunReport::default()
        };
        let (clock, disk) = (Clock::default(), job.disk);
        Ok(Self { folder, tin, opened, output, disk, progress, cancel, report, clock, _lock: lock })
    }

    /// All that is not done.
    fn all(mut self) -> Result<RunReport> {
        let written = self.written()?;
        self.progress.begin("check what is done", self.folder.plan.tasks.len() as u64);
        let mut survey = self.folder.survey(Look::Whole, self.progress, self.cancel)?;
        self.progress.end();
        let to_do: Vec<TaskId> =
            self.folder.strips.tasks().filter(|task| survey.is_missing(*task)).collect();
        self.check_disk(&to_do, written.is_some())?;
        let work = |task: &TaskId| self.folder.strips.work(*task).samples();
        self.progress.begin("triangulate", to_do.iter().map(work).sum());
        for task in to_do {
            self.make_missing(task, &mut survey)?;
        }
        self.progress.end();
        self.report.mesh = Some(match written {
            Some(report) => report,
            None => self.write_mesh(&survey)?,
        });
        Ok(self.conclude(&survey))
    }

    /// One task that is not the last.
    fn one(mut self, task: TaskId) -> Result<RunReport> {
        let mut survey = self.folder.survey_around(task, Look::Quick, self.cancel)?;
        if survey.is_missing(task) {
            self.check_disk(&[task], true)?;
            let around = |run: &Self, look| run.folder.survey_around(task, look, run.cancel);
            self.progress.begin(&task.to_string(), self.folder.strips.work(task).samples());
            self.mending(&mut survey, &around, |run, survey| run.make_missing(task, survey))?;
            self.progress.end();
        }
        Ok(self.conclude(&survey))
    }

    /// The last task.
    fn finish(mut self) -> Result<RunReport> {
        if let Some(report) = self.written()? {
            self.report.mesh = Some(report);
            return Ok(self.conclude(&Survey::default()));
        }
        self.check_disk(&[], false)?;
        let all = |run: &Self, look| run.folder.survey(look, &Silent, run.cancel);
        let mut survey = all(&self, Look::Quick)?;
        let mesh = self.mending(&mut survey, &all, |run, survey| {
            match run.folder.strips.tasks().find(|task| survey.is_missing(*task)) {
                Some(missing) => Err(run.folder.not_done(missing)),
                None => run.write_mesh(survey),
            }
        })?;
        self.report.mesh = Some(mesh);
        Ok(self.conclude(&survey))
    }

    /// Does `work` on what a quick `survey` found. What that found damaged is made anew first; where the
    /// work fails to read something, every byte is looked at (`look`), and the work done once more if
    /// damage was found.
    fn mending<T>(
        &mut self,
        survey: &mut Survey,
        look: &dyn Fn(&Self, Look) -> Result<Survey>,
        work: impl Fn(&mut Self, &mut Survey) -> Result<T>,
    ) -> Result<T> {
        self.mend(survey)?;
        let error = match work(self, survey) {
            Err(error) if error.kind() == ErrorKind::Io => error,
            other => return other,
        };
        *survey = look(self, Look::Whole)?;
        if survey.damaged.is_empty() {
            return Err(error);
        }
        self.mend(survey)?;
        work(self, survey)
    }

    /// Makes anew what is damaged.
    fn mend(&mut self, survey: &mut Survey) -> Result<()> {
        if survey.damaged.is_empty() {
            return Ok(());
        }
        for task in self.folder.strips.tasks() {
            // Its key may not have been known before.
            self.folder.look_again(task, survey, self.cancel)?;
            if survey.damaged.contains(&task) {
                self.make_missing(task, survey)?;
            }
        }
        Ok(())
    }

    /// Makes a task's object unless it is there.
    fn make_missing(&mut self, task: TaskId, survey: &mut Survey) -> Result<()> {
        self.folder.look_again(task, survey, self.cancel)?;
        if !survey.is_missing(task) {
            return Ok(());
        }
        if survey.damaged.contains(&task) {
            self.report.damaged.push(task.to_string());
        }
        self.make(task, survey)
    }

    /// Fails when the disks will not hold the objects of these tasks and, unless it is written, the mesh.
    fn check_disk(&self, to_do: &[TaskId], is_written: bool) -> Result<()> {
        let to_do: HashSet<&TaskId> = to_do.iter().collect();
        let needs = self.folder.strips.tasks().zip(&self.folder.plan.tasks);
        let left = needs.filter(|(task, _)| to_do.contains(task));
        let objects = left.map(|(_, needs)| needs.disk).sum();
        let mesh = if is_written { 0 } else { self.folder.plan.mesh_bytes() };
        self.disk.check(&self.folder.path, &self.tin.output, [objects, mesh])
    }

    /// Carries out a task and notes its object.
    fn make(&mut self, task: TaskId, survey: &mut Survey) -> Result<()> {
        let (done, spilled, clock) = self.carry_out(task, survey)?;
        self.report.made.push(task.to_string());
        self.report.made_bytes += done.bytes;
        self.report.made_samples += match task {
            TaskId::Strip(_) => self.folder.strips.work(task).samples(),
            _ => 0,
        };
        self.report.spilled_bytes += spilled;
        self.clock.merge(&clock);
        survey.done.insert(task, done);
        Ok(())
    }

    fn carry_out(&self, task: TaskId, survey: &Survey) -> Result<(Done, u64, Clock)> {
        let seals = survey.seals(task).ok_or_else(|| self.waits(task, survey))?;
        let (path, key) = self.folder.object(task, &seals);
        let object = super::object::ObjectWriter::create(&path, key)?;
        let work = self.folder.strips.work(task);
        let shelf = Shelf::of_strips(&self.folder, survey);
        let stock = work.loads().then_some(&shelf as &dyn Stock);
        let maker = self.maker();
        let temp_dir = self.tin.resources.temp_dir.clone().unwrap_or_default();
        let settings = maker.settings(maker.spec(self.folder.plan.method.max_error), &temp_dir);
        let saved = save(&*self.opened.source, work.scope, stock, object, &settings)
            .map_err(|error| in_input(error, &self.tin.input))?;
        let (seal, bytes) = saved.object.finish(saved.tally)?;
        Ok((Done { seal, bytes, tally: saved.tally }, saved.spilled_bytes, saved.clock))
    }

    /// The error of a task that cannot be done yet.
    fn waits(&self, task: TaskId, survey: &Survey) -> Error {
        let missing = super::tasks::before(task).into_iter().find(|b| survey.is_missing(*b));
        self.folder.not_done(missing.unwrap_or(task))
    }

    /// Writes the mesh from all objects.
    fn write_mesh(&self, survey: &Survey) -> Result<TinReport> {
        let started = Instant::now();
        let maker = self.maker();
        // Once more: the tasks may have taken days.
        maker.check_output()?;
        self.output.begin()?;
        let mut tally = Tally::default();
        survey.done.values().for_each(|done| tally.add(done.tally));
        let shelf = Shelf::of_all(&self.folder, survey);
        let temp_dir = self.tin.resources.temp_dir.clone().unwrap_or_default();
        self.progress.begin("write", self.folder.plan.samples());
        let mut report = maker
            .complete(self.folder.plan.method.max_error, 0, |sink, spec| {
                let settings = maker.settings(spec, &temp_dir);
                write(&*self.opened.source, &shelf, tally, sink, &settings)
            })
            .map_err(|error| in_input(error, &self.tin.input))?;
        self.progress.end();
        report.took(started.elapsed());
        self.output.finish(&report, self.cancel)?;
        Ok(report)
    }

    /// The report on the mesh, if it is written already and as it was. Fails when something else is
    /// there that may not be replaced.
    fn written(&mut self) -> Result<Option<TinReport>> {
        let state = self.output.state(Look::Whole, self.cancel)?;
        if let State::Whole(report) = state {
            let output = self.tin.output.display().to_string();
            return Ok(Some(TinReport { output, ..report }));
        }
        self.tin.overwrite = self.output.claim(&state, self.tin.overwrite)?;
        self.folder.refuse_own(&self.tin.output)?;
        self.maker().check_output()?;
        Ok(None)
    }

    fn maker(&self) -> Maker<'_> {
        let Self { tin, opened, progress, cancel, .. } = self;
        Maker { job: tin, opened, progress: *progress, cancel }
    }

    fn conclude(mut self, survey: &Survey) -> RunReport {
        let bytes: u64 = survey.done.values().map(|done| done.bytes).sum();
        self.report.found = (survey.done.len() - self.report.made.len()) as u64;
        self.report.found_bytes = bytes - self.report.made_bytes;
        self.report.stages = self.clock.report();
        self.report
    }
}

/// The usual ending of mesh files of the plan's format.
fn ending(folder: &Folder) -> &'static str {
    let format = mesh::by_path(Path::new(""), Some(&folder.plan.method.format));
    format.map_or("mesh", |format| format.extensions[0])
}
