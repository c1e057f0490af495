//! Report on a point cloud.

use serde::Serialize;

use crate::cloud_picture::PictureReport;
use crate::cloud_stats::CloudStats;
use terrane_base::geom::Point3;
use terrane_cloud::{PointCloud, PointSource};

/// Report on a point cloud.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct CloudInfoReport {
    pub file: String,
    pub format: &'static str,
    pub files: usize,
    /// Points that the headers claim, of the parts that may be wanted.
    pub points: u64,
    pub parts: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
    /// Lowest and highest coordinates that the headers claim; absent without points.
    pub bounds: Option<[Point3; 2]>,
    /// Points to a unit of area, by what the headers claim.
    pub density: Option<f64>,
    pub crs: String,
    pub epsg: Option<u32>,
    pub vertical_epsg: Option<u32>,
    pub horizontal_unit: &'static str,
    pub vertical_unit: Option<String>,
    pub details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stats: Option<CloudStats>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureReport>,
    pub notes: Vec<String>,
}

impl CloudInfoReport {
    pub(super) fn new(file: &str, cloud: &PointCloud, stats: Option<CloudStats>) -> Self {
        let info = cloud.info();
        let bounds = info.bounds.map(|ends| ends.map(|point| info.frame.world(point)));
        let area = bounds.map(|[low, high]| (high[0] - low[0]) * (high[1] - low[1]));
        // Of points that were chosen only these count.
        let count = stats.as_ref().map_or(info.count, |stats| stats.census.kept);
        let mut notes = cloud.notes().to_vec();
        notes.extend(outside(bounds, stats.as_ref()));
        Self {
            file: file.to_owned(),
            format: cloud.format(),
            files: cloud.files().len(),
            points: info.count,
            parts: cloud.parts(),
            scale: info.frame.scale,
            offset: info.frame.offset,
            bounds,
            density: area.filter(|area| *area > 0.0).map(|area| count as f64 / area),
            crs: info.crs.label(),
            epsg: info.crs.epsg,
            vertical_epsg: info.crs.vertical_epsg,
            horizontal_unit: info.crs.horizontal_unit(),
            vertical_unit: info.crs.vertical_unit.clone(),
            details: cloud.details().into_iter().map(|(k, v)| (k, v.into())).collect(),
            stats,
            picture: None,
            notes,
        }
    }
}

/// A note on points outside the bounds in the header.
fn outside(claimed: Option<[Point3; 2]>, stats: Option<&CloudStats>) -> Option<String> {
    let ([low, high], [lowest, highest]) = (claimed?, stats?.bounds?);
    // Coordinates have errors; a step is far more.
    let slack = |v: f64| 1e-9 * v.abs().max(1.0);
    let is_out =
        (0..3).any(|i| lowest[i] < low[i] - slack(low[i]) || highest[i] > high[i] + slack(high[i]));
    is_out.then(|| "points lie outside the bounds in the header".to_owned())
}
