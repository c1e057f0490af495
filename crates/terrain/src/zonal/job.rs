//! Options and report of statistics of zones.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::statistics::{ZoneStatistic, ZoneStatisticList, ZoneStatistics};
use crate::annotate;
use terrane_base::error::Result;
use terrane_engine::Resources;
use terrane_engine::options::{FeatureInput, FileName, FileOutput, GridInput};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;
use terrane_options::{Choice, Options};
use terrane_vector::{FieldKind, GeometryType, VectorFormat};
use terrane_window::coverage::CellRule;

/// Which cells belong to a zone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum ZoneCells {
    /// all cells that the polygon covers a part of, weighted with the exact share
    #[default]
    Exact,
    /// cells whose centre is within the polygon, with weight 1
    Center,
    /// all cells that the polygon covers a part of, with weight 1
    Touched,
}

impl ZoneCells {
    pub(super) fn rule(self) -> CellRule {
        match self {
            Self::Exact => CellRule::Exact,
            Self::Center => CellRule::Center,
            Self::Touched => CellRule::Touched,
        }
    }
}

/// Statistics of a grid within polygons
///
/// Writes the polygons with a property for each statistic. Each sample counts with the share of its cell that the polygon
/// covers; voids count for none but ‹stat› voids. Polygons in another CRS than the grid are reprojected, with straight
/// edges in the CRS of the grid. The output does not depend on threads or memory.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct ZonalOptions {
    /// File of polygons
    #[option(value = "ZONES", with = FileName, role = Reads, positional)]
    pub zones: PathBuf,
    /// Statistics: count (cells), voids, sum, mean, min, max, range, stdev, variance, median, percentiles such as p95
    /// (the least height with 95 % of the weight at it and below), majority, minority, variety
    #[option(value = "LIST", with = ZoneStatisticList, default = ZoneStatistics::default())]
    pub stat: ZoneStatistics,
    /// Which cells belong to a zone
    #[option(value = "RULE")]
    pub cells: ZoneCells,
    /// Prefix of the names of the properties, such as dem_
    #[option(value = "TEXT", heading = "Output")]
    pub prefix: Option<String>,
    /// How the zones are read.
    #[option(flatten)]
    pub features: FeatureInput,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

impl ZonalOptions {
    /// The format to write.
    pub(super) fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        annotate::format(output, &self.file, GeometryType::Polygon)
    }

    /// The new properties.
    pub(super) fn fields(&self) -> Vec<(String, FieldKind)> {
        let named = |statistic: &ZoneStatistic| {
            let prefix = self.prefix.as_deref().unwrap_or_default();
            (format!("{prefix}{}", statistic.name()), statistic.kind())
        };
        self.stat.0.iter().map(named).collect()
    }
}

/// What was computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct ZonalReport {
    pub input: String,
    /// File of the polygons.
    pub zones_file: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    /// CRS of the grid.
    pub crs: String,
    /// Transformation of the polygons to the CRS of the grid, if theirs differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Features written.
    pub zones: u64,
    /// Features without a sample that is no void.
    pub empty_zones: u64,
    /// Features that reach beyond the grid.
    pub zones_beyond: u64,
    /// Samples read, those of several zones counted for each.
    pub samples: u64,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub samples_per_second: f64,
}

impl ZonalReport {
    pub(super) fn own_notes(&self) -> Vec<String> {
        let counted = [
            (
                self.zones_beyond,
                "reach beyond the grid: their statistics are those of the part within",
            ),
            (self.empty_zones, "have no sample"),
        ];
        let counted = counted.iter().filter(|(count, _)| *count > 0);
        counted.map(|(count, what)| format!("{count} of {} zones {what}", self.zones)).collect()
    }
}
