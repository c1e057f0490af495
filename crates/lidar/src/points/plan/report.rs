//! Reports on the plan of tiles of points, on a run of it, and on the written files.

use serde::{Deserialize, Serialize};

use crate::points::job::TranslateJob;
use crate::points::report::TranslateReport;
use terrane_engine::plan::{self, DescribesRun, StatusReport};

/// Tiles of points to plan; `cut` is the number of tiles along the side of a task.
pub type PlanPointsJob = plan::PlanJob<TranslateJob>;
/// The plan of points and its progress.
pub type PointsStatus = StatusReport<PointTileStatus>;

/// Part of the status that is specific to points.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PointTileStatus {
    /// Columns and rows of tiles.
    pub squares: [u64; 2],
    /// Side of a tile, in units of x and y.
    pub side: f64,
    /// Points that the headers claim.
    pub points: u64,
}

/// Part of the run report that is specific to points.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PointTileRun {
    /// Points written by the tasks of this run.
    pub points: u64,
    /// The written files, once finished.
    pub written: Option<PointsWritten>,
}

impl DescribesRun for PointTileRun {
    fn written(&self) -> Option<&str> {
        self.written.as_ref().map(|points| points.output.as_str())
    }
}

/// Written files of tiles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PointsWritten {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    pub files: u64,
    /// Points in them; points of buffers are counted in each file.
    pub points: u64,
    pub crs: String,
    pub output_bytes: u64,
    pub notes: Vec<String>,
}

impl From<PointsWritten> for TranslateReport {
    fn from(written: PointsWritten) -> Self {
        let PointsWritten { input, output, point_format, files, points, crs, output_bytes, notes } =
            written;
        let usual = Self::default();
        Self { input, output, point_format, files, points, crs, output_bytes, notes, ..usual }
    }
}
