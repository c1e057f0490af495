//! Report of a cloud-to-grid job.

use std::time::Instant;

use serde::Serialize;

use terrane_cloud::ReturnCounts;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_raster::WaterReport;

/// Report of a cloud-to-grid job.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct GridReport {
    pub input: String,
    pub output: String,
    pub files: usize,
    pub format: String,
    pub width: u32,
    pub height: u32,
    pub cells: u64,
    /// Size of a cell in x and y.
    pub cell: [f64; 2],
    /// North-western corner of the grid.
    pub corner: [f64; 2],
    pub crs: String,
    pub vertical_unit: Option<String>,
    pub sample_type: String,
    pub nodata: f64,
    /// Radius of statistics; absent if none uses it.
    pub radius: Option<f64>,
    /// Statistics of the points.
    pub points: ReturnCounts,
    /// For a plan: number of points of the point cloud by its headers; `points` counts them for each tile that
    /// reads them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloud_points: Option<u64>,
    /// Points outside of all cells of the grid.
    pub outside_grid: u64,
    pub bands: Vec<GridBandReport>,
    /// Report on flattened water.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water: Option<WaterReport>,
    /// Files with skipped damage; also in the notes.
    #[serde(skip)]
    pub losses: LostPoints,
    /// Notes on the point cloud, and on metadata that the format does not hold.
    pub notes: Vec<String>,
    pub output_bytes: u64,
    pub stages: Vec<GridStage>,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub points_per_second: f64,
}

/// A band and its number of valid cells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridBandReport {
    pub name: String,
    /// Valid cells; a count of 0 is not valid.
    pub valid: u64,
}

/// A stage of the job.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridStage {
    pub name: String,
    pub seconds: f64,
}

impl GridStage {
    pub(super) fn since(name: &str, start: Instant) -> Self {
        Self { name: name.to_owned(), seconds: start.elapsed().as_secs_f64() }
    }
}
