//! Reports on the plan of a mesh of a cloud, and on a run of it.

use serde::Serialize;

use crate::cloud_tin::job::{CloudTinJob, CloudTinReport};
use terrane_engine::plan::{self, DescribesRun, StatusReport};

/// A mesh of a point cloud to plan; `cut` is the largest number of points of a task.
pub type PlanCloudTinJob = plan::PlanJob<CloudTinJob>;
/// The plan of a mesh of a point cloud and its progress.
pub type CloudTinStatus = StatusReport<PointStatus>;

/// Part of the status that is specific to meshes of point clouds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PointStatus {
    pub max_error: f64,
    /// Points of the mesh.
    pub points: u64,
    pub regions: u64,
}

/// Part of the run report that is specific to meshes of point clouds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PointRun {
    /// Vertices selected by the tasks of this run.
    pub vertices: u64,
    /// The mesh, if this run wrote it; its time is that of writing.
    pub mesh: Option<CloudTinReport>,
}

impl DescribesRun for PointRun {
    fn written(&self) -> Option<&str> {
        self.mesh.as_ref().map(|mesh| mesh.output.as_str())
    }

    fn shortfall(&self) -> Option<String> {
        self.mesh.as_ref().and_then(CloudTinReport::shortfall)
    }
}
