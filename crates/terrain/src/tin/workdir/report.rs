//! Reports on the plan of a mesh, and on a run of it.

use serde::Serialize;

use crate::tin::job::TinJob;
use crate::tin::report::{StageClock, StageReport, TinReport};
use terrane_engine::plan::{self, DescribesRun};

/// A mesh to plan.
pub type PlanJob = plan::PlanJob<TinJob>;
/// The plan of a mesh and its progress.
pub type StatusReport = plan::StatusReport<MeshStatus>;
/// What a run of the plan of a mesh did.
pub type RunReport = plan::RunReport<MeshRun>;

/// Part of the status that is specific to meshes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct MeshStatus {
    pub max_error: f64,
    pub samples: u64,
}

/// Part of the run report that is specific to meshes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshRun {
    /// Samples of the strips done by this run.
    pub made_samples: u64,
    /// Time by stage, without that of writing the mesh.
    pub stages: Vec<StageReport>,
    /// The mesh, if this run wrote it; its time is that of writing.
    pub mesh: Option<TinReport>,
}

impl DescribesRun for MeshRun {
    fn written(&self) -> Option<&str> {
        self.mesh.as_ref().map(|mesh| mesh.output.as_str())
    }

    fn shortfall(&self) -> Option<String> {
        self.mesh.as_ref().and_then(TinReport::shortfall)
    }
}

impl Default for MeshRun {
    fn default() -> Self {
        Self { made_samples: 0, stages: StageClock::default().report(), mesh: None }
    }
}

impl MeshRun {
    /// Adds the time of a task.
    pub(super) fn add(&mut self, stages: Vec<StageReport>) {
        for more in stages {
            match self.stages.iter_mut().find(|stage| stage.name == more.name) {
                Some(stage) => {
                    stage.thread_seconds += more.thread_seconds;
                    stage.samples += more.samples;
                }
                None => self.stages.push(more),
            }
        }
    }
}
