//! `terrane info` of files of features.

use serde::{Serialize, Serializer};

use crate::cli::shared::text;
use crate::error::Result;
use crate::files::{path_of, shown};
use crate::jobs::feature_stats::{FeatureStats, FieldStats, feature_stats};
use crate::jobs::{Cancel, Progress};
use crate::vector::{Kind, OpenOptions};

/// What is known of a file of features.
#[derive(Serialize)]
pub(crate) struct Facts {
    file: String,
    format: &'static str,
    layer: Option<String>,
    crs: String,
    epsg: Option<u32>,
    horizontal_unit: &'static str,
    features: u64,
    /// Features with an id apart from their fields.
    ids: u64,
    /// Features by the kind of their geometry.
    #[serde(serialize_with = "by_name")]
    geometries: Vec<(Kind, u64)>,
    lines: u64,
    outer_rings: u64,
    holes: u64,
    vertices: u64,
    /// West, south, east, north.
    bounds: Option<[f64; 4]>,
    /// Lowest and highest height.
    heights: Option<[f64; 2]>,
    /// Lowest and highest measure.
    measures: Option<[f64; 2]>,
    /// True where measures are seconds since the start of 1970 (UTC).
    measures_are_times: bool,
    fields: Vec<FieldStats>,
    notes: Vec<String>,
}

/// Counts as an object.
fn by_name<S: Serializer>(
    kinds: &[(Kind, u64)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(kinds.iter().map(|(kind, count)| (kind.name(), count)))
}

/// Reads a file to its end and tells what it is.
pub(crate) fn describe(
    file: &str,
    layer: Option<&String>,
    (progress, cancel): (&dyn Progress, &Cancel),
) -> Result<Facts> {
    let options = OpenOptions { layer: layer.cloned() };
    let stats = feature_stats(&path_of(file), &options, progress, cancel)?;
    Ok(Facts::new(file, stats))
}

impl Facts {
    fn new(file: &str, stats: FeatureStats) -> Self {
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
    pub(crate) fn is_more_than_positions(&self) -> bool {
        self.ids > 0 || !self.fields.is_empty()
    }

    /// Adds a note.
    pub(crate) fn noted(mut self, note: String) -> Self {
        self.notes.push(note);
        self
    }

    /// Names and values for people.
    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let join = |values: &[f64]| {
            values.iter().map(|value| text::position(*value)).collect::<Vec<_>>().join(", ")
        };
        let kinds = self.geometries.iter();
        let kinds = kinds.map(|(kind, n)| format!("{}: {}", kind.name(), text::count(*n)));
        let range = |ends: &[f64; 2]| ends.map(text::position).join(" to ");
        let mut rows = vec![("format", self.format.to_owned())];
        rows.extend(self.layer.clone().map(|layer| ("layer", layer)));
        rows.extend([
            ("crs", self.crs.clone()),
            (
                "unit",
                if self.crs == "unknown" { "unknown" } else { self.horizontal_unit }.to_owned(),
            ),
            ("features", format!("{}{}", text::count(self.features), self.with_ids())),
            ("geometries", kinds.collect::<Vec<_>>().join(", ")),
            ("parts", self.parts()),
            ("vertices", text::count(self.vertices)),
        ]);
        rows.extend(self.bounds.map(|bounds| ("bounds", join(&bounds))));
        rows.extend(self.heights.as_ref().map(|ends| ("heights", range(ends))));
        let times = if self.measures_are_times { ", seconds since 1970 (UTC)" } else { "" };
        rows.extend(self.measures.as_ref().map(|ends| ("measures", range(ends) + times)));
        let rows = rows.into_iter().filter(|(_, value)| !value.is_empty());
        let mut rows: Vec<_> = rows.map(|(k, v)| (k.to_owned(), v)).collect();
        rows.extend(self.fields.iter().map(|field| ("field".to_owned(), self.field(field))));
        rows.extend(self.notes.iter().map(|note| ("note".to_owned(), note.clone())));
        rows
    }

    fn with_ids(&self) -> String {
        match self.ids {
            0 => String::new(),
            ids if ids == self.features => ", each with an id".to_owned(),
            ids => format!(", {} with an id", text::count(ids)),
        }
    }

    /// Lines and rings, as far as there are any.
    fn parts(&self) -> String {
        let counts =
            [("lines", self.lines), ("outer rings", self.outer_rings), ("holes", self.holes)];
        let some = counts.into_iter().filter(|(_, n)| *n > 0);
        some.map(|(name, n)| format!("{name}: {}", text::count(n))).collect::<Vec<_>>().join(", ")
    }

    /// "NAME: text of 32 bytes, null in 3 features".
    fn field(&self, field: &FieldStats) -> String {
        let mut told = format!("{}: {}", field.name.escape_debug(), field.kind);
        told.extend(field.width.map(|width| format!(" of {width} bytes")));
        told.extend(field.decimals.filter(|n| *n > 0).map(|n| format!(" with {n} decimals")));
        let nulls = self.features.saturating_sub(field.values);
        told.extend((nulls > 0).then(|| format!(", none in {} features", text::count(nulls))));
        told
    }
}
