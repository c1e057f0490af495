//! What a cloud-to-grid job did.

use std::time::Instant;

use serde::Serialize;

use terrane_cloud::PointCensus;
use terrane_engine::figures::RunStatistics;
use terrane_engine::sift::LostPoints;
use terrane_raster::WaterReport;

/// What a cloud-to-grid job did.
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
    /// Radius that cells look around in; absent when no statistic does.
    pub radius: Option<f64>,
    /// What became of the points.
    pub points: PointCensus,
    /// Of a plan: points that the cloud has, by its headers; `points` counts them for each tile that
    /// reads them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloud_points: Option<u64>,
    /// Points kept that lie in no cell of the grid.
    pub outside_grid: u64,
    pub bands: Vec<GridBandReport>,
    /// Report on flattened water.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water: Option<WaterReport>,
    /// Files whose damage was passed over; the notes tell of them.
    #[serde(skip)]
    pub losses: LostPoints,
    /// What is odd about the cloud, or what the format could not say.
    pub notes: Vec<String>,
    pub output_bytes: u64,
    pub stages: Vec<GridStage>,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub points_per_second: f64,
}

/// A band and how many of its cells have a value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridBandReport {
    pub name: String,
    /// Cells with a value; a count of 0 is none.
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
