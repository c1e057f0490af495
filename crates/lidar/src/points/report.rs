//! Report on written points.

use serde::Serialize;

use terrane_cloud::ReturnCounts;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;

/// Report of a points-to-points job.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct TranslateReport {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    /// Statistics of the points read; unknown for resumed work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub census: Option<ReturnCounts>,
    /// Files written.
    pub files: u64,
    /// Points written; points of buffers are counted in each file.
    pub points: u64,
    pub crs: String,
    /// The reprojection, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    /// Points that were read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points_per_second: Option<f64>,
    pub notes: Vec<String>,
}
