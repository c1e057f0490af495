//! Report on a point cloud.

use serde::Serialize;

use super::bound_slack;
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
    /// Points declared by the headers, in the parts that the filters do not exclude.
    pub points: u64,
    pub parts: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
    /// Lowest and highest coordinates declared by the headers; absent without points.
    pub bounds: Option<[Point3; 2]>,
    /// Points per unit area, from the headers.
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
        // With filters the header's count does not describe the points read.
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
    let is_outside = (0..3).any(|i| {
        lowest[i] < low[i] - bound_slack(low[i]) || highest[i] > high[i] + bound_slack(high[i])
    });
    is_outside.then(|| "points lie outside the bounds in the header".to_owned())
}
