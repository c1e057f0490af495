//! What a kind of plan has to say of itself: what its tasks are, and what one does.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::artifact::CheckDepth;
use super::digest::Digest;
use super::folder::TaskStates;
use super::plan_file::{PlanKind, PlanManifest};
use super::report::{DescribesRun, StatusReport};
use crate::{Cancel, Progress, Resources, Silent};
use terrane_base::error::Result;

/// A kind of plan. The value is what is asked for and what was found in the input, as the plan notes it.
pub trait PlannedWork: Clone + Sync + Serialize + DeserializeOwned {
    /// Which.
    const KIND: PlanKind;
    /// Kinds of tasks: the name that comes before the number, and the task of a number.
    const NAMES: &'static [Numbered<Self::Task>];
    /// The ending of objects.
    const ENDING: &'static str = "object";
    /// How the last task looks at objects: whole, unless they prove themselves as they are read.
    const LAST_LOOK: CheckDepth = CheckDepth::Whole;
    /// What a run of all tasks is called while it goes on, where the tasks have no stages of their own.
    const STAGE: Option<&'static str> = None;

    /// A task that makes an object.
    type Task: Copy + Ord + Send + Sync + fmt::Display + 'static;
    /// What an object tells of itself without being read through.
    type Facts: Clone + PartialEq + Send + Sync + Serialize + DeserializeOwned;
    /// What a run tells beside what all do.
    type Run: Default + DescribesRun;
    /// What is noted of what was written.
    type Note: Serialize + DeserializeOwned;
    /// What is told of the plan beside what is told of all.
    type Status: Default;
    /// The input, and how it is worked on.
    type Opened;

    /// Fails when there is nothing to make, or more than can be.
    fn check(&self) -> Result<()>;

    /// All tasks, in an order in which they can be done.
    fn tasks(&self) -> Vec<Self::Task>;

    /// The tasks whose objects one works on.
    fn before(&self, task: Self::Task) -> Vec<Self::Task>;

    /// Samples or cells of a task.
    fn size(&self, task: PlanStep<Self::Task>) -> u64;

    /// What is told of it: input, format, cells of a tile, and what only this kind has.
    fn status(&self) -> StatusReport<Self::Status>;

    /// The name in the folder of what is written at the end.
    fn output(&self, form: &OutputForm) -> Result<PathBuf>;

    /// Fails for a name that says another format than that of the plan; the input is not opened yet. What is no mesh is
    /// looked at with the output.
    fn check_name(&self, _output: &Path, _form: &OutputForm) -> Result<()> {
        Ok(())
    }

    /// Opens the input; fails when it is not what the plan was made for.
    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<Self::Opened>;

    /// Fails before the work where the output cannot be written.
    fn check_output(opened: &Self::Opened, at: RunControl<'_>) -> Result<()>;

    /// Does a task: writes its object, whole or not at all, and adds to what is told.
    fn make(
        opened: &Self::Opened,
        object: (Self::Task, &Path),
        survey: &TaskStates<'_, Self>,
        run: &mut Self::Run,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<Self::Facts>>;

    /// Writes what all objects are for.
    fn write(
        opened: &Self::Opened,
        survey: &TaskStates<'_, Self>,
        run: &mut Self::Run,
        at: RunControl<'_>,
    ) -> Result<Self::Note>;

    /// Tells of what is written already.
    fn written(note: Self::Note, output: &Path, run: &mut Self::Run);
}

/// Tasks of one name, by number.
pub type Numbered<T> = (&'static str, fn(u32) -> T);

/// Who is told of the work, and may stop it.
#[derive(Clone, Copy)]
pub struct RunControl<'a> {
    /// Who is told.
    pub progress: &'a dyn Progress,
    /// What may stop it.
    pub cancel: &'a Cancel,
}

impl RunControl<'_> {
    /// The same, without telling.
    pub fn silent(self) -> Self {
        RunControl { progress: &Silent, ..self }
    }
}

/// What is to be written, and what the work may use.
pub struct OutputRequest {
    /// The file or folder.
    pub output: PathBuf,
    /// Whether one that exists is replaced.
    pub overwrite: bool,
    /// How it is written.
    pub form: OutputForm,
    /// What the work may use.
    pub resources: Resources,
}

/// What else is asked of a mesh of a grid that is written at the end of a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OutputForm {
    /// Write a folder of meshes, each of so many by so many tiles.
    pub split: Option<u32>,
    /// STL and 3MF: close the surface down to this height.
    pub solid_base: Option<f64>,
}

/// A task as it is named: the last one, which writes the result, has no object.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PlanStep<T> {
    /// One with an object.
    Task(T),
    /// The last one.
    Finish,
}

impl<T: fmt::Display> fmt::Display for PlanStep<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Task(task) => task.fmt(f),
            Self::Finish => f.write_str("finish"),
        }
    }
}

/// An object that was made.
pub struct MadeArtifact<F> {
    /// What the object tells of itself.
    pub facts: F,
    /// The digest of its bytes as they were written, where that is known.
    pub digest: Option<Digest>,
    /// Bytes that went through a temporary file.
    pub spilled: u64,
}
