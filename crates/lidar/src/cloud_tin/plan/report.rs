//! Reports on the plan of a mesh of a cloud, and on a run of it.

use serde::Serialize;

use crate::cloud_tin::job::{CloudTinJob, CloudTinReport};
use terrane_engine::plan::{self, DescribesRun, StatusReport};

/// A mesh of a cloud to plan; a task has so many points at the most (`cut`).
pub type PlanCloudTinJob = plan::PlanJob<CloudTinJob>;
/// The plan of a mesh of a cloud, or how far the work on it has come.
pub type CloudTinStatus = StatusReport<PointStatus>;

/// What is told of the plan of a mesh of a cloud alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PointStatus {
    pub max_error: f64,
    /// Points of which the mesh is made.
    pub points: u64,
    pub regions: u64,
}

/// What is told of a run on a mesh of a cloud alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PointRun {
    /// Vertices that the tasks of this run chose.
    pub vertices: u64,
    /// The mesh, if this run came to it; its time is that of writing it.
    pub mesh: Option<CloudTinReport>,
}

impl DescribesRun for PointRun {
    fn written(&self) -> Option<&str> {
        self.mesh.as_ref().map(|mesh| mesh.output.as_str())
    }

    fn unmet(&self) -> Option<String> {
        self.mesh.as_ref().and_then(CloudTinReport::unmet)
    }
}
