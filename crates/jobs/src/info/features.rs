//! What a file of features is.

use serde::{Serialize, Serializer};

use crate::feature_stats::{FeatureStats, FieldStats};
use terrane_files::shown;
use terrane_vector::Kind;

/// What is known of a file of features.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct FeaturesInfoReport {
    pub file: String,
    pub format: &'static str,
    pub layer: Option<String>,
    pub crs: String,
    pub epsg: Option<u32>,
    pub horizontal_unit: &'static str,
    pub features: u64,
    /// Features with an id apart from their fields.
    pub ids: u64,
    /// Features by the kind of their geometry.
    #[serde(serialize_with = "by_name")]
    pub geometries: Vec<(Kind, u64)>,
    pub lines: u64,
    pub outer_rings: u64,
    pub holes: u64,
    pub vertices: u64,
    /// West, south, east, north.
    pub bounds: Option<[f64; 4]>,
    /// Lowest and highest height.
    pub heights: Option<[f64; 2]>,
    /// Lowest and highest measure.
    pub measures: Option<[f64; 2]>,
    /// True where measures are seconds since the start of 1970 (UTC).
    pub measures_are_times: bool,
    pub fields: Vec<FieldStats>,
    pub notes: Vec<String>,
}

/// Counts as an object.
fn by_name<S: Serializer>(kinds: &[(Kind, u64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(kinds.iter().map(|(kind, count)| (kind.name(), count)))
}

impl FeaturesInfoReport {
    pub(super) fn new(file: &str, stats: FeatureStats) -> Self {
        Self {
            file: shown(file),
            format: stats.format,
            layer: stats.layer,
            crs: stats.crs.label(),
            epsg: stats.crs.epsg,
            horizontal_unit: stats.crs.horizontal_unit(),
            features: stats.features,
            ids: stats.ids,
            geometries: stats.kinds,
            lines: stats.lines,
            outer_rings: stats.outer_rings,
            holes: stats.holes,
            vertices: stats.vertices,
            bounds: stats.bounds,
            heights: stats.heights,
            measures: stats.measures,
            measures_are_times: stats.m_is_time,
            fields: stats.fields,
            notes: stats.notes,
        }
    }

    /// True where there is more than positions.
    pub fn is_more_than_positions(&self) -> bool {
        self.ids > 0 || !self.fields.is_empty()
    }
}
