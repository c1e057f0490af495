//! The folder of a plan, and which of its tasks are done.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::manifest::Manifest;
use super::object::Object;
use super::tasks::{Strips, TaskId, before, key, object_path};
use crate::plan::{self, Digest, Look, OBJECTS};
use crate::tin::tally::Tally;
use crate::{Cancel, Progress, Silent};
use terrane_base::error::{Error, Result};

/// A folder with a plan in it.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) plan: Manifest,
    pub(super) id: Digest,
    pub(super) strips: Strips,
}

/// A finished object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Done {
    pub(super) seal: Digest,
    pub(super) bytes: u64,
    pub(super) tally: Tally,
}

/// Which tasks are done.
#[derive(Debug, Default)]
pub(super) struct Survey {
    pub(super) done: BTreeMap<TaskId, Done>,
    /// Tasks whose object is there and not sound.
    pub(super) damaged: Vec<TaskId>,
}

/// Who is told of a search, and may stop it.
#[derive(Clone, Copy)]
struct Watch<'a> {
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
}

impl Folder {
    /// Puts `plan` into the folder `path`, made if it is not there; one that holds the very same plan
    /// is taken as it is. Fails with `Usage` when it holds anything else.
    pub(super) fn create(path: &Path, plan: &Manifest) -> Result<Self> {
        plan::put(path, plan)?;
        Self::open(path)
    }

    /// Opens the folder `path`.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let (plan, id) = plan::read::<Manifest>(path)?;
        Ok(Self { path: path.to_path_buf(), strips: plan.strips()?, plan, id })
    }

    /// As [`plan::refuse_own`].
    pub(super) fn refuse_own(&self, output: &Path) -> Result<()> {
        plan::refuse_own(&self.path, &self.plan, output)
    }

    /// Where the object of a task lies, and its key.
    pub(super) fn object(&self, task: TaskId, seals: &[Digest]) -> (PathBuf, Digest) {
        let key = key(self.id, task, seals);
        (object_path(&self.path.join(OBJECTS), task, key), key)
    }

    /// Opens the object of a task.
    pub(super) fn open_object(&self, task: TaskId, survey: &Survey) -> Result<Object> {
        let seals = survey.seals(task).ok_or_else(|| self.not_done(task))?;
        let (path, key) = self.object(task, &seals);
        Object::open(&path, key, self.strips.work(task).tiles())
    }

    /// Looks for all objects, in parallel; tells `progress` of each task. Fails when it is to stop.
    pub(super) fn survey(
        &self,
        look: Look,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Survey> {
        let mut survey = Survey::default();
        let watch = Watch { progress, cancel };
        let is_strip = |task: &TaskId| matches!(task, TaskId::Strip(_));
        let is_seam = |task: &TaskId| matches!(task, TaskId::Seam(_));
        self.look_for(self.strips.tasks().filter(is_strip).collect(), look, watch, &mut survey)?;
        self.look_for(self.strips.tasks().filter(is_seam).collect(), look, watch, &mut survey)?;
        Ok(survey)
    }

    /// Looks for the objects that `task` works on, and at every byte of its own.
    pub(super) fn survey_around(
        &self,
        task: TaskId,
        look: Look,
        cancel: &Cancel,
    ) -> Result<Survey> {
        let mut survey = Survey::default();
        let watch = Watch { progress: &Silent, cancel };
        self.look_for(before(task), look, watch, &mut survey)?;
        self.look_for(vec![task], Look::Whole, watch, &mut survey)?;
        Ok(survey)
    }

    /// Looks for the object of a task that was not found before what it works on was done.
    pub(super) fn look_again(
        &self,
        task: TaskId,
        survey: &mut Survey,
        cancel: &Cancel,
    ) -> Result<()> {
        if before(task).is_empty() || !survey.is_missing(task) || survey.damaged.contains(&task) {
            return Ok(());
        }
        self.look_for(vec![task], Look::Whole, Watch { progress: &Silent, cancel }, survey)
    }

    fn look_for(
        &self,
        tasks: Vec<TaskId>,
        look: Look,
        watch: Watch<'_>,
        survey: &mut Survey,
    ) -> Result<()> {
        let find = |&task: &TaskId| {
            watch.progress.advance(1);
            let (path, key) = self.object(task, &survey.seals(task)?);
            path.exists().then(|| (task, self.inspect(task, &path, key, look, watch.cancel)))
        };
        let found: Vec<_> = tasks.par_iter().filter_map(find).collect();
        // What was not read to its end is not known to be damaged.
        watch.cancel.check()?;
        for (task, inspected) in found {
            match inspected {
                Ok(done) => drop(survey.done.insert(task, done)),
                Err(_) => survey.damaged.push(task),
            }
        }
        Ok(())
    }

    fn inspect(
        &self,
        task: TaskId,
        path: &Path,
        key: Digest,
        look: Look,
        cancel: &Cancel,
    ) -> Result<Done> {
        cancel.check()?;
        let object = Object::open(path, key, self.strips.work(task).tiles())?;
        if look == Look::Whole {
            object.check(cancel)?;
        }
        Ok(Done { seal: object.seal, bytes: object.bytes, tally: object.tally })
    }

    /// The error of a task that waits for `task`.
    pub(super) fn not_done(&self, task: TaskId) -> Error {
        plan::not_done(&self.path, task)
    }
}

impl Survey {
    /// True when `task` has an object, and none that is sound was found.
    pub(super) fn is_missing(&self, task: TaskId) -> bool {
        task != TaskId::Finish && !self.done.contains_key(&task)
    }

    /// The seals of what `task` works on; `None` when not all of it is done.
    pub(super) fn seals(&self, task: TaskId) -> Option<Vec<Digest>> {
        before(task).iter().map(|before| Some(self.done.get(before)?.seal)).collect()
    }
}
