//! What is told of points that were written.

use serde::Serialize;

use terrane_cloud::PointCensus;
use terrane_engine::figures::RunStatistics;
use terrane_engine::transform::Transformed;

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct TranslateReport {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    /// What became of the points that were read; of work that was kept it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub census: Option<PointCensus>,
    /// Files written.
    pub files: u64,
    /// Points written; those of buffers are so in several files.
    pub points: u64,
    pub crs: String,
    /// What was done to places.
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
