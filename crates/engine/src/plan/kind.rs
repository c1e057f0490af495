//! The interface of a kind of plan: its tasks and their work.

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

/// A kind of plan. The value holds the request and the properties of the input, as stored in the plan file.
pub trait PlannedWork: Clone + Sync + Serialize + DeserializeOwned {
    /// Kind of plan.
    const KIND: PlanKind;
    /// Task names: the prefix before the number, and the task of a number.
    const NAMES: &'static [Numbered<Self::Task>];
    /// File extension of artifacts.
    const ENDING: &'static str = "object";
    /// How the last task checks artifacts: whole, unless they are verified as they are read.
    const LAST_LOOK: CheckDepth = CheckDepth::Whole;
    /// Name of the progress stage of a run of all tasks, if the tasks have no stages of their own.
    const STAGE: Option<&'static str> = None;

    /// A task that makes an artifact.
    type Task: Copy + Ord + Send + Sync + fmt::Display + 'static;
    /// Facts of an artifact, known without reading its file.
    type Facts: Clone + PartialEq + Send + Sync + Serialize + DeserializeOwned;
    /// Run report fields of this kind.
    type Run: Default + DescribesRun;
    /// Record of the output.
    type Note: Serialize + DeserializeOwned;
    /// Status report fields of this kind.
    type Status: Default;
    /// The opened input and options.
    type Opened;

    /// Fails if there is nothing to make, or more than the limit.
    fn check(&self) -> Result<()>;

    /// All tasks, in a valid order.
    fn tasks(&self) -> Vec<Self::Task>;

    /// The tasks whose artifacts a task reads.
    fn before(&self, task: Self::Task) -> Vec<Self::Task>;

    /// Samples or cells of a task.
    fn size(&self, task: PlanStep<Self::Task>) -> u64;

    /// The status report: input, format, cells of a tile, and the fields of this kind.
    fn status(&self) -> StatusReport<Self::Status>;

    /// Default file name of the output in the folder.
    fn output(&self, form: &OutputForm) -> Result<PathBuf>;

    /// Fails if the extension of the output differs from the plan's format, before the input is opened. Kinds other
    /// than meshes check it with the output.
    fn check_name(&self, _output: &Path, _form: &OutputForm) -> Result<()> {
        Ok(())
    }

    /// Opens the input; fails if it differs from the plan's.
    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<Self::Opened>;

    /// Fails early if the output cannot be written.
    fn check_output(opened: &Self::Opened, at: RunControl<'_>) -> Result<()>;

    /// Does a task: writes its artifact atomically and adds to the report.
    fn make(
        opened: &Self::Opened,
        object: (Self::Task, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut Self::Run,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<Self::Facts>>;

    /// Writes the output from all artifacts.
    fn write(
        opened: &Self::Opened,
        states: &TaskStates<'_, Self>,
        run: &mut Self::Run,
        at: RunControl<'_>,
    ) -> Result<Self::Note>;

    /// Reports an output that is already written.
    fn written(note: Self::Note, output: &Path, run: &mut Self::Run);
}

/// Tasks of one name, by number.
pub type Numbered<T> = (&'static str, fn(u32) -> T);

/// Progress watcher and cancellation of a run.
#[derive(Clone, Copy)]
pub struct RunControl<'a> {
    /// Progress watcher.
    pub progress: &'a dyn Progress,
    /// Cancellation.
    pub cancel: &'a Cancel,
}

impl RunControl<'_> {
    /// The same without progress reports.
    pub fn silent(self) -> Self {
        RunControl { progress: &Silent, ..self }
    }
}

/// Output and resource limits of a run.
pub struct OutputRequest {
    /// The file or folder.
    pub output: PathBuf,
    /// Overwrite existing output.
    pub overwrite: bool,
    /// Output options.
    pub form: OutputForm,
    /// Resource limits.
    pub resources: Resources,
}

/// Output options for the mesh of a grid at the end of a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OutputForm {
    /// Write a folder of meshes, one for every N x N tiles.
    pub split: Option<u32>,
    /// STL and 3MF: close the surface down to this height.
    pub solid_base: Option<f64>,
}

/// A task by name: the last one, which writes the output, has no artifact.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PlanStep<T> {
    /// A task with an artifact.
    Task(T),
    /// The last task.
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

/// An artifact that was made.
pub struct MadeArtifact<F> {
    /// Its facts.
    pub facts: F,
    /// Digest of its bytes as written, if known.
    pub digest: Option<Digest>,
    /// Bytes that went through a temporary file.
    pub spilled: u64,
}
