//! The report on the quality of a point cloud.

use serde::Serialize;
use serde_json::{Map, Value};

use super::tally::QaRange;
use crate::cloud_stats::CloudStats;
use terrane_base::geom::Point3;
use terrane_engine::run_statistics::RunStatistics;

/// Report on the quality of a point cloud.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct QaReport {
    pub input: String,
    pub output: String,
    pub format: &'static str,
    pub files: u64,
    pub crs: String,
    pub epsg: Option<u32>,
    pub vertical_epsg: Option<u32>,
    pub horizontal_unit: &'static str,
    pub vertical_unit: Option<String>,
    /// Filters and other options of reading that were given.
    pub filters: Map<String, Value>,
    /// Side of a cell in units of x and y, and its area in square `area_unit`; absent without points.
    pub cell: Option<f64>,
    pub cell_area: Option<f64>,
    pub area_unit: &'static str,
    /// Cells of the footprint: occupied cells, and empty ones that they enclose.
    pub occupied_cells: u64,
    pub enclosed_cells: u64,
    pub footprint_area: f64,
    /// Densities of points, and of pulses: last returns.
    pub density: Option<QaDensity>,
    pub pulse_density: Option<QaDensity>,
    /// The requested density of pulses.
    pub min_density: Option<QaRequirement>,
    pub voids: Option<QaVoids>,
    pub lines: Vec<QaLine>,
    /// Pairs of lines that overlap, at most 4096; and how often others overlap, counted by cell.
    pub overlaps: Vec<QaOverlap>,
    pub overlaps_left_out: u64,
    pub comparison: Option<QaComparison>,
    /// All points that pass the filters, with withheld ones.
    pub contents: QaContents,
    /// True if all points were compared with the headers: filters leave none out.
    pub headers_compared: bool,
    /// Disagreements of headers and contents, by file.
    pub findings: Vec<QaFinding>,
    pub file_list: Vec<QaFile>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub index: Option<String>,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// Densities of the cells of the footprint, in points per unit of area.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaDensity {
    pub points: u64,
    pub mean: f64,
    pub median: f64,
    pub lowest: f64,
    pub highest: f64,
    /// Pairs of a percentage and its percentile.
    pub percentiles: Vec<(u64, f64)>,
    /// Share of cells below the requested density, from 0 to 1.
    pub below: Option<f64>,
}

/// A requested density of pulses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QaRequirement {
    /// Pulses per unit of area.
    pub required: f64,
    /// Whether the mean density of pulses in the footprint reaches it; absent if cells are smaller than the point spacing.
    pub is_met: Option<bool>,
    /// Share of the cells of the footprint below it, from 0 to 1.
    pub below: f64,
}

impl QaRequirement {
    /// "met", "not met" or "not judged".
    pub fn verdict(&self) -> &'static str {
        match self.is_met {
            Some(true) => "met",
            Some(false) => "not met",
            None => "not judged",
        }
    }
}

/// Groups of empty cells, connected by sides, that occupied cells enclose.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaVoids {
    /// Smaller ones are not counted.
    pub min_area: f64,
    pub count: u64,
    pub cells: u64,
    pub area: f64,
    pub largest: Vec<QaVoid>,
}

/// A void.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QaVoid {
    /// Its area.
    pub area: f64,
    /// Its cells.
    pub cells: u64,
    /// West, south, east, north.
    pub bounds: [f64; 4],
    /// The centre of one of its cells.
    pub inside: [f64; 2],
}

/// A flight line: points of one point source id.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaLine {
    pub line: u16,
    pub points: u64,
    pub last_returns: u64,
    /// Area of its cells, and its points and last returns per unit of it.
    pub area: f64,
    pub density: f64,
    pub pulse_density: f64,
    pub gps_time: Option<QaRange>,
    pub scan_angle: Option<QaRange>,
}

/// The overlap of two flight lines, and the differences of their heights: first minus second.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct QaOverlap {
    /// Point source ids.
    pub lines: [u16; 2],
    /// Area of cells with points of both.
    pub area: f64,
    /// Number of these cells.
    pub cells: u64,
    /// Cells in which heights are compared.
    pub compared: u64,
    /// Mean difference.
    pub mean: Option<f64>,
    /// Median difference.
    pub median: Option<f64>,
    /// Root mean square difference.
    pub rmse: Option<f64>,
    /// Absolute difference that 95 % of the cells do not exceed.
    pub p95: Option<f64>,
    /// Largest absolute difference.
    pub largest: Option<f64>,
}

/// The rule by which cells are compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QaComparison {
    /// Minimum last returns of each line in a cell.
    pub min_returns: u64,
    /// Maximum range of their heights.
    pub max_range: f64,
}

/// Counts and ranges of points.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaContents {
    #[serde(flatten)]
    pub stats: CloudStats,
    pub intensity: Option<QaRange>,
    pub scan_angle: Option<QaRange>,
    pub gps_time: Option<QaRange>,
}

/// A disagreement of a header with the contents of its file, or with other files.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaFinding {
    pub file: String,
    pub finding: String,
}

/// A file of the cloud.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct QaFile {
    pub file: String,
    /// Points that pass the filters.
    pub points: u64,
    /// Area of the cells with points, and points per unit of it.
    pub area: f64,
    pub density: f64,
    pub bounds: Option<[Point3; 2]>,
    pub gps_time: Option<QaRange>,
    /// LAS version and point format; absent for text files.
    pub version: Option<String>,
    pub point_format: Option<u8>,
    pub created: Option<String>,
    pub crs: String,
}
