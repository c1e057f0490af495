//! Options and report of statistics of zones.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::statistics::{ZoneStatisticList, ZoneStatistics};
use crate::annotate::{self, AnnotationOptions, AnnotationReport};
use terrane_base::error::Result;
use terrane_engine::options::FileName;
use terrane_options::Options;
use terrane_raster::GridInfo;
use terrane_vector::{FieldKind, GeometryType, VectorFormat};
use terrane_window::coverage::CellRule;

/// Statistics of a grid within polygons
///
/// Writes the polygons with a property for each statistic. Samples are weighted by the fraction of their cell that the
/// polygon covers. Void samples are ignored, except by the statistic voids. Polygons in another CRS than the grid are
/// reprojected to it for the statistics, and written as they are. The output does not depend on threads or memory.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct ZonalOptions {
    /// File of polygons
    #[option(value = "ZONES", with = FileName, role = Reads, positional)]
    pub zones: PathBuf,
    /// Statistics, one property each, such as mean,stdev,p95
    #[option(value = "STATISTICS", with = ZoneStatisticList, default = ZoneStatistics::default())]
    pub stat: ZoneStatistics,
    /// Which samples belong to a zone
    #[option(value = "RULE")]
    pub cells: CellRule,
    /// Prefix of the names of the properties, such as dem_
    #[option(value = "TEXT", heading = "Output")]
    pub prefix: Option<String>,
    /// Grid, features and output.
    #[option(flatten)]
    pub common: AnnotationOptions,
}

impl ZonalOptions {
    /// The format to write.
    pub(super) fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        annotate::format(output, &self.common.file, GeometryType::Polygon)
    }

    /// The new properties.
    pub(super) fn fields(&self, info: &GridInfo) -> Vec<(String, FieldKind)> {
        let prefix = self.prefix.as_deref().unwrap_or_default();
        let is_whole = annotate::is_whole(info);
        let all = self.stat.0.iter();
        all.map(|own| (format!("{prefix}{}", own.name()), own.kind(is_whole))).collect()
    }
}

/// What was computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct ZonalReport {
    #[serde(flatten)]
    pub common: AnnotationReport,
    /// Zones without a valid sample.
    pub empty_zones: u64,
    /// Zones that reach beyond the grid.
    pub zones_beyond: u64,
    /// Samples read, those of several zones counted for each.
    pub samples: u64,
    pub samples_per_second: f64,
}

impl ZonalReport {
    pub(super) fn own_notes(&self) -> Vec<String> {
        let counted = [
            (self.zones_beyond, "reach beyond the grid; statistics cover only the part inside"),
            (self.empty_zones, "have no valid sample"),
        ];
        let counted = counted.iter().filter(|(count, _)| *count > 0);
        counted
            .map(|(count, what)| format!("{count} of {} zones {what}", self.common.features))
            .collect()
    }
}
