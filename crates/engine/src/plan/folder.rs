//! The folder of a plan, and the states of its tasks.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::artifact::{ArtifactLocation, CheckDepth, FinishedArtifact, OBJECTS};
use super::digest::Digest;
use super::kind::{PlanStep, PlannedWork, RunControl};
use super::output::FINISHED;
use super::plan_file::{PLAN, PlanManifest};
use super::report::TaskReport;
use terrane_base::error::{Error, ErrorKind, Result};

const LOCK: &str = "lock";

/// A folder with a plan file, the artifacts of its tasks, and a lock.
pub struct PlanFolder<W: PlannedWork> {
    pub path: PathBuf,
    /// The content of the plan file.
    pub plan: PlanManifest<W>,
    /// Digest of the plan; part of the key of every artifact.
    pub id: Digest,
}

/// Which tasks are done. A task that is neither `done` nor `damaged` has no artifact, or was not checked.
pub struct TaskStates<'a, W: PlannedWork> {
    /// The folder of the plan.
    pub folder: &'a PlanFolder<W>,
    /// Tasks whose artifact was checked and is intact.
    pub done: BTreeMap<W::Task, FinishedArtifact<W::Facts>>,
    /// Tasks whose artifact was checked and is damaged.
    pub damaged: Vec<W::Task>,
}

impl<W: PlannedWork> PlanFolder<W> {
    /// Reads the plan file of the folder `path`.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let (plan, id) = PlanManifest::read(path)?;
        Ok(Self { path: path.to_path_buf(), plan, id })
    }

    /// All tasks, each after the tasks whose artifacts it reads.
    pub(super) fn tasks(&self) -> Vec<W::Task> {
        self.plan.work.tasks()
    }

    /// The tasks whose artifacts a task reads.
    pub(super) fn before(&self, task: W::Task) -> Vec<W::Task> {
        self.plan.work.before(task)
    }

    /// The task of a name such as `strip-3`, or the last step for `finish`.
    pub(super) fn named(&self, name: &str) -> Result<PlanStep<W::Task>> {
        if name == "finish" {
            return Ok(PlanStep::Finish);
        }
        let task = W::NAMES.iter().find_map(|(kind, task)| {
            let number = name.strip_prefix(kind)?.strip_prefix('-')?;
            number.parse().ok().map(task)
        });
        let task = task.ok_or_else(|| unknown_task::<W>(name))?;
        match self.tasks().contains(&task) {
            true => Ok(PlanStep::Task(task)),
            false => Err(Error::usage(format!("the plan has no task {task}"))
                .in_file(&self.path)
                .remedy("see ‹terrane plan status›")),
        }
    }

    /// The entry of a pending task in the status report.
    pub(super) fn task_report(&self, task: PlanStep<W::Task>) -> TaskReport {
        let after = match task {
            PlanStep::Task(task) => self.before(task),
            PlanStep::Finish => self.tasks(),
        };
        let after = after.iter().map(W::Task::to_string).collect();
        TaskReport { id: task.to_string(), after, work: self.plan.work.size(task) }
    }

    /// Creates the folder of artifacts and, for a run of all pending tasks (`alone`), locks the plan until the returned
    /// file is closed. Does not block: fails with `NotYet` if another process holds the lock.
    ///
    /// The lock only avoids that two such runs do the same work twice. A run of a single task takes none: artifacts
    /// appear atomically, with the same bytes whoever makes them. File systems without locks are not locked.
    pub(super) fn enter(&self, alone: bool) -> Result<Option<File>> {
        // The user may have deleted all artifacts together with their folder.
        let objects = self.path.join(OBJECTS);
        std::fs::create_dir_all(&objects).map_err(|e| Error::write(&objects, e))?;
        if !alone {
            return Ok(None);
        }
        let path = self.path.join(LOCK);
        let file = File::options().create(true).append(true).open(&path);
        let file = file.map_err(|e| Error::write(&path, e))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                Err(Error::new(ErrorKind::NotYet, "the folder is locked by another run")
                    .in_file(&self.path)
                    .remedy("retry when that run ends, or run single tasks (‹task›)"))
            }
            // Also if the file system has no locks.
            _ => Ok(Some(file)),
        }
    }

    /// Fails if `output` is an input of the plan, its plan file, record of the output or lock, or an artifact.
    pub(super) fn refuse_own(&self, output: &Path) -> Result<()> {
        // A file that does not exist yet is none of these.
        let Ok(resolved) = std::fs::canonicalize(output) else { return Ok(()) };
        let objects = std::fs::canonicalize(self.path.join(OBJECTS));
        let is_object = objects.is_ok_and(|objects| resolved.starts_with(objects));
        let own = [PLAN, FINISHED, LOCK].map(|name| self.path.join(name));
        let mut files = own.into_iter().chain(self.plan.files().map(Cow::into_owned));
        if is_object
            || files.any(|file| std::fs::canonicalize(file).is_ok_and(|file| file == resolved))
        {
            return Err(Error::usage("output is an input or a file of the plan")
                .in_file(output)
                .remedy("choose another name"));
        }
        Ok(())
    }

    /// The error for work that waits for `task`.
    fn not_done(&self, task: W::Task) -> Error {
        Error::new(ErrorKind::NotYet, format!("task {task} is not done"))
            .in_file(&self.path)
            .remedy(format!("run it first: ‹task› {task}"))
    }
}

impl<'a, W: PlannedWork> TaskStates<'a, W> {
    /// States before any artifact is checked.
    pub(super) fn new(folder: &'a PlanFolder<W>) -> Self {
        Self { folder, done: BTreeMap::new(), damaged: Vec::new() }
    }

    /// Checks the artifacts of all tasks, in parallel, and reports progress.
    ///
    /// # Errors
    /// `Interrupted`. A damaged artifact is not an error: its task is listed in [`damaged`](Self::damaged).
    pub(super) fn of_all(
        folder: &'a PlanFolder<W>,
        depth: CheckDepth,
        at: RunControl<'_>,
    ) -> Result<Self> {
        let mut states = Self::new(folder);
        states.inspect_in_order(folder.tasks(), depth, at)?;
        Ok(states)
    }

    /// Checks the artifacts that `task` reads, at `depth`, and every byte of its own.
    pub(super) fn around(
        folder: &'a PlanFolder<W>,
        task: W::Task,
        depth: CheckDepth,
        at: RunControl<'_>,
    ) -> Result<Self> {
        let mut states = Self::new(folder);
        states.inspect_in_order(folder.before(task), depth, at.silent())?;
        states.inspect_tasks(&[task], CheckDepth::Whole, at.silent())?;
        Ok(states)
    }

    /// Checks the artifact of a task whose state is unknown, after its inputs are done.
    pub(super) fn inspect_again(&mut self, task: W::Task, at: RunControl<'_>) -> Result<()> {
        let is_known = !self.is_missing(task) || self.damaged.contains(&task);
        // Without inputs the key was known from the start, so the artifact was looked for and does not exist.
        if is_known || self.folder.before(task).is_empty() {
            return Ok(());
        }
        self.inspect_tasks(&[task], CheckDepth::Whole, at.silent())
    }

    /// Checks the artifacts of `tasks` in the order of their dependencies. Inputs outside `tasks` are not checked.
    fn inspect_in_order(
        &mut self,
        tasks: Vec<W::Task>,
        depth: CheckDepth,
        at: RunControl<'_>,
    ) -> Result<()> {
        let mut left: BTreeSet<W::Task> = tasks.into_iter().collect();
        while !left.is_empty() {
            // The name of an artifact contains the checksums of the artifacts that its task reads. Until these are
            // checked it cannot even be looked for.
            let (blocked, ready) = left.iter().copied().partition::<Vec<_>, _>(|task| {
                self.folder.before(*task).iter().any(|input| left.contains(input))
            });
            self.inspect_tasks(&ready, depth, at)?;
            left = blocked.into_iter().collect();
        }
        Ok(())
    }

    /// Checks the artifacts of `tasks` in parallel, and records their states.
    fn inspect_tasks(
        &mut self,
        tasks: &[W::Task],
        depth: CheckDepth,
        at: RunControl<'_>,
    ) -> Result<()> {
        let inspected: Vec<_> = tasks
            .par_iter()
            .filter_map(|&task| Some((task, self.inspect(task, depth, at)?)))
            .collect();
        // A check that was cancelled ends with an error, too. It must not be recorded as damage.
        at.cancel.check()?;
        for (task, artifact) in inspected {
            match artifact {
                Ok(Some(done)) => drop(self.done.insert(task, done)),
                Ok(None) => {}
                Err(_) => self.damaged.push(task),
            }
        }
        Ok(())
    }

    /// The artifact of a task: `None` if its location is unknown, `Ok(None)` if it does not exist, an error if it is
    /// damaged or the run is cancelled.
    fn inspect(
        &self,
        task: W::Task,
        depth: CheckDepth,
        at: RunControl<'_>,
    ) -> Option<Result<Option<FinishedArtifact<W::Facts>>>> {
        at.progress.advance(1);
        let place = self.place(task).ok()?;
        Some(at.cancel.check().and_then(|()| FinishedArtifact::inspect(&place, depth, at.cancel)))
    }

    /// The location of a task's artifact, from the plan, the task, and the checksums of the artifacts it reads. Fails
    /// with `NotYet` if one of these is not done.
    pub(super) fn place(&self, task: W::Task) -> Result<ArtifactLocation> {
        let before = self.folder.before(task).into_iter();
        let seals: Vec<Digest> =
            before.map(|before| Ok(self.finished(before)?.seal)).collect::<Result<_>>()?;
        let PlanFolder { path, id, .. } = self.folder;
        Ok(ArtifactLocation::new(&path.join(OBJECTS), *id, &task.to_string(), &seals, W::ENDING))
    }

    /// The artifact of a task; fails with `NotYet` if it is not done.
    fn finished(&self, task: W::Task) -> Result<&FinishedArtifact<W::Facts>> {
        self.done.get(&task).ok_or_else(|| self.folder.not_done(task))
    }

    /// The path and the sidecar of a finished task's artifact; fails with `NotYet` if it is not done.
    pub fn object(&self, task: W::Task) -> Result<(PathBuf, &FinishedArtifact<W::Facts>)> {
        let done = self.finished(task)?;
        Ok((self.place(task)?.file, done))
    }

    /// True if no intact artifact of `task` is known.
    pub(super) fn is_missing(&self, task: W::Task) -> bool {
        !self.done.contains_key(&task)
    }

    /// Fails with `NotYet` if a task still has to be run, apart from damaged artifacts, which the last step makes again.
    pub(super) fn check_all(&self) -> Result<()> {
        // A task whose inputs are not done has no location, and is not reported: its first missing input is, unless
        // that is damaged.
        let undone = self.folder.tasks().into_iter().find(|task| {
            let is_known = self.place(*task).is_ok();
            is_known && self.is_missing(*task) && !self.damaged.contains(task)
        });
        undone.map_or(Ok(()), |task| Err(self.folder.not_done(task)))
    }
}

/// The error for an unknown task name.
fn unknown_task<W: PlannedWork>(name: &str) -> Error {
    let names = W::NAMES.iter().enumerate().map(|(i, (kind, _))| match i {
        0 => format!("{kind}-0, {kind}-1, ..., "),
        _ => format!("{kind}-0, ..., "),
    });
    let names: String = names.collect();
    Error::usage(format!("\"{name}\" is not a task"))
        .remedy(format!("tasks are {names}finish: see ‹terrane plan status›"))
}
