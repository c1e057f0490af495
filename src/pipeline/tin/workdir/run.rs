//! Doing what a plan says: all of it, or one task.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::folder::{Done, Finished, Folder, Look, Mesh, Survey};
use super::report::RunReport;
use super::shelf::Shelf;
use super::tasks::TaskId;
use crate::atomic::refuse_existing;
use crate::error::{Error, ErrorKind, Result};
use crate::output;
use crate::pipeline::plan::{self, Digest};
use crate::pipeline::tin::job::TinJob;
use crate::pipeline::tin::make::{Maker, Opened, in_input};
use crate::pipeline::tin::report::{Clock, TinReport};
use crate::pipeline::tin::run::{save, write};
use crate::pipeline::tin::tally::Tally;
use crate::pipeline::tin::worker::Stock;
use crate::pipeline::{Cancel, Progress, Resources, Silent, disk, peak_memory};

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
    /// What the work may use.
    pub resources: Resources,
}

/// Works on a plan: looks at every byte of what is done already, does what is not or is damaged, and
/// writes the mesh. What is done stays done however the run ends. A named task that is done is left
/// alone.
///
/// The mesh is the same as that of [`run`](crate::pipeline::tin::run) on the same request, byte for
/// byte, whoever did which task how often.
///
/// # Errors
/// Those of a grid-to-TIN job, and `BadInput` for an input or program that is not what the plan was
/// made with, `Resource` while others work in the folder and for a task whose inputs are not done,
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
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
    report: RunReport,
    clock: Clock,
    _lock: File,
}

impl<'a> Run<'a> {
    fn new(
        job: &RunJob,
        folder: Folder,
        alone: bool,
        progress: &'a dyn Progress,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let lock = folder.lock(alone)?;
        folder.plan.check_files(alone)?;
        let ending = if job.split.is_some() { "blocks" } else { ending(&folder) };
        let default = || folder.path.join("mesh").with_extension(ending);
        let output = job.output.clone().unwrap_or_else(default);
        let mut resources = job.resources.clone();
        resources.temp_dir.get_or_insert_with(|| folder.path.clone());
        let mut tin = folder.plan.job(output, job.overwrite, resources);
        (tin.solid_base, tin.split) = (job.solid_base, job.split);
        let mut opened = Opened::new(&tin)?;
        opened.height_origin = folder.plan.method.height_origin;
        folder.plan.check_source(&*opened.source)?;
        let report = RunReport {
            folder: folder.path.display().to_string(),
            plan_id: folder.id.to_string(),
            tasks: folder.plan.tasks.len() as u64,
            ..RunReport::default()
        };
        let clock = Clock::default();
        Ok(Self { folder, tin, opened, progress, cancel, report, clock, _lock: lock })
    }

    /// All that is not done.
    fn all(mut self) -> Result<RunReport> {
        let finished = self.finished()?;
        if finished.is_none() {
            self.claim_output()?;
        }
        self.progress.begin("check what is done", self.folder.plan.tasks.len() as u64);
        let mut survey = self.folder.survey(Look::Whole, self.progress, self.cancel)?;
        self.progress.end();
        let to_do: Vec<TaskId> =
            self.folder.strips.tasks().filter(|task| is_missing(*task, &survey)).collect();
        self.check_disk(&to_do)?;
        let work = |task: &TaskId| self.folder.strips.work(*task).samples();
        self.progress.begin("triangulate", to_do.iter().map(work).sum());
        for task in to_do {
            // Its key may not have been known before.
            self.folder.look_again(task, &mut survey, self.cancel)?;
            if is_missing(task, &survey) {
                self.make(task, &mut survey)?;
            }
        }
        self.progress.end();
        self.note_found(&survey);
        self.report.mesh = Some(match finished {
            Some(finished) => finished.report,
            None => self.write_mesh(&survey)?,
        });
        Ok(self.conclude())
    }

    /// One task that is not the last.
    fn one(mut self, task: TaskId) -> Result<RunReport> {
        let mut survey = self.folder.survey_around(task, self.cancel)?;
        if is_missing(task, &survey) {
            self.progress.begin(&task.to_string(), self.folder.strips.work(task).samples());
            self.make(task, &mut survey)?;
            self.progress.end();
        }
        self.note_found(&survey);
        Ok(self.conclude())
    }

    /// The last task.
    fn finish(mut self) -> Result<RunReport> {
        if let Some(finished) = self.finished()? {
            self.report.mesh = Some(finished.report);
            return Ok(self.conclude());
        }
        self.claim_output()?;
        let survey = self.folder.survey(Look::Quick, &Silent, self.cancel)?;
        if let Some(missing) = self.folder.strips.tasks().find(|task| is_missing(*task, &survey)) {
            return Err(self.folder.not_done(missing));
        }
        self.note_found(&survey);
        self.report.mesh = Some(self.write_mesh(&survey)?);
        Ok(self.conclude())
    }

    fn note_found(&mut self, survey: &Survey) {
        let bytes: u64 = survey.done.values().map(|done| done.bytes).sum();
        self.report.found = (survey.done.len() - self.report.made.len()) as u64;
        self.report.found_bytes = bytes - self.report.made_bytes;
        self.report.damaged = survey.damaged.iter().map(TaskId::to_string).collect();
    }

    /// Fails when the disks will not hold what is left to do.
    fn check_disk(&self, to_do: &[TaskId]) -> Result<()> {
        let names: HashSet<String> = to_do.iter().map(TaskId::to_string).collect();
        let needs = self.folder.plan.tasks.iter();
        let objects = needs.clone().filter(|task| names.contains(&task.id)).map(|task| task.disk);
        disk::check(&self.folder.path, objects.sum())?;
        let mesh = needs.last().map_or(0, |task| task.disk);
        disk::check(plan::parent(&self.tin.output), mesh)
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
        let missing = super::tasks::before(task).into_iter().find(|b| is_missing(*b, survey));
        self.folder.not_done(missing.unwrap_or(task))
    }

    /// Writes the mesh from all objects.
    fn write_mesh(&self, survey: &Survey) -> Result<TinReport> {
        let started = Instant::now();
        let maker = self.maker();
        maker.check_output()?;
        let mut mesh = self.mesh()?;
        self.folder.note_mesh(&mesh)?;
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
        let digest = digest_of(&mesh.path, self.cancel)?;
        mesh.finished = Some(Finished { digest, report: report.clone() });
        self.folder.note_mesh(&mesh)?;
        Ok(report)
    }

    /// The mesh, if it is written already and as it was.
    fn finished(&self) -> Result<Option<Finished>> {
        let Some(mesh) = self.mesh_there()? else { return Ok(None) };
        let Some(finished) = mesh.finished else { return Ok(None) };
        match digest_of(&mesh.path, self.cancel) {
            Err(error) if error.kind() == ErrorKind::Interrupted => Err(error),
            // What cannot be read is not what was written.
            found => Ok(found.is_ok_and(|digest| digest == finished.digest).then_some(finished)),
        }
    }

    /// The note on a mesh like this run's, where it belongs.
    fn mesh_there(&self) -> Result<Option<Mesh>> {
        let own = self.mesh()?;
        let is_own = |mesh: &Mesh| {
            (&mesh.path, mesh.split, mesh.solid_base) == (&own.path, own.split, own.solid_base)
        };
        Ok(self.folder.mesh().filter(is_own))
    }

    /// The mesh of this run, not finished.
    fn mesh(&self) -> Result<Mesh> {
        let TinJob { output, split, solid_base, .. } = &self.tin;
        let path = plan::noted_path(output)?;
        let (split, solid_base) = (*split, *solid_base);
        Ok(Mesh { plan_id: self.folder.id, path, split, solid_base, finished: None })
    }

    /// Fails when something is where the mesh belongs, unless a run that did not come to its end was
    /// writing there.
    fn claim_output(&mut self) -> Result<()> {
        self.tin.overwrite |= self.mesh_there()?.is_some_and(|mesh| mesh.finished.is_none());
        refuse_existing(&self.tin.output, self.tin.overwrite)?;
        self.folder.refuse_own(&self.tin.output)
    }

    fn maker(&self) -> Maker<'_> {
        let Self { tin, opened, progress, cancel, .. } = self;
        Maker { job: tin, opened, progress: *progress, cancel }
    }

    fn conclude(mut self) -> RunReport {
        self.report.stages = self.clock.report();
        self.report
    }
}

fn is_missing(task: TaskId, survey: &Survey) -> bool {
    task != TaskId::Finish && !survey.done.contains_key(&task)
}

/// The usual ending of mesh files of the plan's format.
fn ending(folder: &Folder) -> &'static str {
    let format = output::by_path(Path::new(""), Some(&folder.plan.method.format));
    format.map_or("mesh", |format| format.extensions[0])
}

/// Of a mesh, in one file or in many.
fn digest_of(path: &Path, cancel: &Cancel) -> Result<Digest> {
    let files = if path.is_dir() { output::split::files(path)? } else { vec![path.to_path_buf()] };
    plan::digest_of(&files, cancel)
}
