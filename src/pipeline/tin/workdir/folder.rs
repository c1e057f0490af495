//! The folder of a plan: what lies where, who may work in it, and which tasks are done.
//!
//! | name | what |
//! |---|---|
//! | `plan.json` | the plan |
//! | `objects/` | the result of each task that is done |
//! | `finished.json` | where the mesh is written, and its digest once it is there |
//! | `lock` | held by whoever works in the folder |

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::digest::Digest;
use super::manifest::Manifest;
use super::object::Object;
use super::tasks::{Strips, TaskId, before, key, object_path};
use crate::atomic::{AtomicFile, is_temporary};
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::tin::report::TinReport;
use crate::pipeline::tin::tally::Tally;
use crate::pipeline::{Cancel, Progress, Silent};

const PLAN: &str = "plan.json";
const OBJECTS: &str = "objects";
const FINISHED: &str = "finished.json";
const LOCK: &str = "lock";

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

/// How thoroughly objects are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// The index and what stands for the rest.
    Quick,
    /// Every byte.
    Whole,
}

/// A mesh that is being written, to a name that was free or may be replaced, or is finished.
#[derive(Serialize, Deserialize)]
pub(super) struct Mesh {
    pub(super) plan_id: Digest,
    /// Absolute.
    pub(super) path: PathBuf,
    pub(super) split: Option<u32>,
    pub(super) solid_base: Option<f64>,
    pub(super) finished: Option<Finished>,
}

/// A finished mesh.
#[derive(Serialize, Deserialize)]
pub(super) struct Finished {
    pub(super) digest: Digest,
    pub(super) report: TinReport,
}

impl Folder {
    /// Puts `plan` into the folder `path`, made if it is not there; one that holds the very same plan
    /// is taken as it is. Fails with `Usage` when it holds anything else.
    pub(super) fn create(path: &Path, plan: Manifest) -> Result<Self> {
        if path.join(PLAN).exists() {
            let there = Self::open(path)?;
            return match there.plan.difference(&plan) {
                None => Ok(there),
                Some(how) => Err(Error::usage(format!("holds another plan: {how}"))
                    .in_file(path)
                    .remedy("choose another folder, or remove this one")),
            };
        }
        let fail = |e| Error::write(path, e);
        std::fs::create_dir_all(path).map_err(fail)?;
        // What an earlier attempt to plan here left is no reason to refuse.
        let is_own = |name: &OsStr| name == OBJECTS || name.to_str().is_some_and(is_temporary);
        let mut entries = std::fs::read_dir(path).map_err(fail)?.flatten();
        if entries.any(|entry| !is_own(&entry.file_name())) {
            return Err(Error::usage("is not empty and holds no plan")
                .in_file(path)
                .remedy("choose another folder, or a name that is not there yet"));
        }
        std::fs::create_dir_all(path.join(OBJECTS)).map_err(fail)?;
        let mut file = AtomicFile::create(&path.join(PLAN), false)?;
        file.write_all(&plan.to_text()?).map_err(|e| Error::write(&path.join(PLAN), e))?;
        file.commit()?;
        Self::open(path)
    }

    /// Opens the folder `path`.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = path.join(PLAN);
        if !file.exists() {
            return Err(Error::bad_input("holds no plan")
                .in_file(path)
                .remedy("make one: terrane plan tin INPUT... -o FOLDER --max-error E"));
        }
        let (plan, id) = Manifest::read(&file)?;
        Ok(Self { path: path.to_path_buf(), strips: plan.strips()?, plan, id })
    }

    /// Waits for nobody: fails when others work here, or, unless `alone`, when one who wants to be
    /// alone does. Where the file system has no locks nothing is locked; results would not be harmed
    /// by two who do the same.
    pub(super) fn lock(&self, alone: bool) -> Result<File> {
        // Results may be thrown away, all at once too.
        let objects = self.path.join(OBJECTS);
        std::fs::create_dir_all(&objects).map_err(|e| Error::write(&objects, e))?;
        let path = self.path.join(LOCK);
        let file = File::options().create(true).append(true).open(&path);
        let file = file.map_err(|e| Error::write(&path, e))?;
        let locked = if alone { file.try_lock() } else { file.try_lock_shared() };
        match locked {
            Err(TryLockError::WouldBlock) => {
                Err(Error::new(ErrorKind::Resource, "others are at work in this folder")
                    .in_file(&self.path)
                    .remedy("try again when they are done"))
            }
            _ => Ok(file),
        }
    }

    /// Fails when `output` is a file of the input, or one that this folder is made of.
    pub(super) fn refuse_own(&self, output: &Path) -> Result<()> {
        let place = |path: &Path| std::fs::canonicalize(path);
        let Ok(output_place) = place(output) else { return Ok(()) };
        let is_it = |path: &Path| place(path).is_ok_and(|path| path == output_place);
        let own = [PLAN, FINISHED, LOCK].map(|name| self.path.join(name));
        let is_object =
            place(&self.path.join(OBJECTS)).is_ok_and(|objects| output_place.starts_with(objects));
        if is_object || own.iter().any(|path| is_it(path)) || self.plan.files().any(is_it) {
            return Err(Error::usage("output is the input itself, or belongs to the plan")
                .in_file(output)
                .remedy("choose another name"));
        }
        Ok(())
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

    /// Looks for the objects that `task` works on, and for its own.
    pub(super) fn survey_around(&self, task: TaskId, cancel: &Cancel) -> Result<Survey> {
        let mut survey = Survey::default();
        let watch = Watch { progress: &Silent, cancel };
        self.look_for(before(task), Look::Quick, watch, &mut survey)?;
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
        if before(task).is_empty() || survey.damaged.contains(&task) {
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
        Error::new(ErrorKind::Resource, format!("{task} is not done"))
            .in_file(&self.path)
            .remedy(format!("run it first: --task {task}"))
    }

    /// The mesh that was written last, if it is from this plan.
    pub(super) fn mesh(&self) -> Option<Mesh> {
        let text = std::fs::read(self.path.join(FINISHED)).ok()?;
        serde_json::from_slice(&text).ok().filter(|mesh: &Mesh| mesh.plan_id == self.id)
    }

    /// Notes a mesh.
    pub(super) fn note_mesh(&self, mesh: &Mesh) -> Result<()> {
        let path = self.path.join(FINISHED);
        let mut file = AtomicFile::create(&path, true)?;
        let written = serde_json::to_writer_pretty(&mut file, mesh).map_err(io::Error::from);
        written.map_err(|e| Error::write(&path, e))?;
        file.commit().map(drop)
    }
}

impl Survey {
    /// The seals of what `task` works on; `None` when not all of it is done.
    pub(super) fn seals(&self, task: TaskId) -> Option<Vec<Digest>> {
        before(task).iter().map(|before| Some(self.done.get(before)?.seal)).collect()
    }
}
