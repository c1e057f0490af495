//! Reports on the plan of squares of points, on a run of it, and on the written files.

use serde::{Deserialize, Serialize};

use crate::translate::job::TranslateJob;
use crate::translate::report::TranslateReport;
use terrane_engine::plan::{self, DescribesRun, StatusReport};

/// Squares of points to plan; a task has so many squares along its side (`cut`).
pub type PlanPointsJob = plan::PlanJob<TranslateJob>;
/// The plan of points, or how far the work on it has come.
pub type PointsStatus = StatusReport<SquareStatus>;

/// What is told of the plan of points alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct SquareStatus {
    /// Columns and rows of squares.
    pub squares: [u64; 2],
    /// Side of a square, in units of x and y.
    pub side: f64,
    /// Points that the headers claim.
    pub points: u64,
}

/// What is told of a run on points alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SquareRun {
    /// Points written by the tasks it did.
    pub points: u64,
    /// What is written, once it is.
    pub written: Option<PointsWritten>,
}

impl DescribesRun for SquareRun {
    fn written(&self) -> Option<&str> {
        self.written.as_ref().map(|points| points.output.as_str())
    }
}

/// Files of squares that were written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PointsWritten {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    pub files: u64,
    /// Points in them; those of buffers are in several.
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
