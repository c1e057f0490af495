//! Report on a file of features, read once to its end, feature by feature.

use std::collections::HashMap;
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::bound_slack;
use terrane_base::error::Result;
use terrane_base::limits;
use terrane_engine::{Cancel, Progress};
use terrane_files::{path_of, shown};
use terrane_vector::{
    self as vector, Feature, FeatureSource, FieldDefinition, FieldKind, Geometry, GeometryType,
    LayerHeader, PartRole, PropertyValue, VectorOpenOptions,
};

/// Features between two checks for cancellation.
const STEP: u64 = 1024;

/// Report on a file of features.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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
    pub geometries: Vec<(GeometryType, u64)>,
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
fn by_name<S: Serializer>(
    kinds: &[(GeometryType, u64)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(kinds.iter().map(|(kind, count)| (kind.name(), count)))
}

/// A field of the features.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldStats {
    /// Its name.
    pub name: Arc<str>,
    /// Type of its values: as declared by the file, or else as found; "null" without values.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Most bytes of a value as text, where the format limits them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,
    /// Digits behind the point, where the format fixes them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimals: Option<u32>,
    /// Features that have a value.
    pub values: u64,
}

impl FieldStats {
    /// A field of the file's schema, without values.
    fn declared(field: &FieldDefinition) -> Self {
        Self {
            name: field.name.clone(),
            kind: named(Some(field.kind)),
            width: field.width,
            decimals: field.decimals,
            values: 0,
        }
    }
}

/// Reads all features of a file. Memory for one feature and the names of fields.
///
/// # Errors
/// A file that cannot be opened, or a feature that cannot be read; it names file and place.
pub(super) fn read(
    name: &str,
    options: &VectorOpenOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<FeaturesInfoReport> {
    let path = &*path_of(name);
    let mut source = vector::open(path, options)?;
    let format = vector::identify(path)?.map_or("", |format| format.name);
    progress.begin("read", source.layer().features.unwrap_or_default());
    let mut stats =
        FeaturesInfoReport { file: shown(name), format, ..FeaturesInfoReport::default() };
    let mut fields = FieldCollector::of(source.layer());
    let mut counts = [0; GeometryType::ALL.len()];
    while let Some(feature) = source.next()? {
        if stats.features.is_multiple_of(STEP) {
            cancel.check()?;
        }
        counts[place(feature.geometry.kind())] += 1;
        stats.add(&feature);
        fields.add(&feature);
        progress.advance(1);
    }
    progress.end();
    let kinds = GeometryType::ALL.into_iter().zip(counts);
    stats.geometries = kinds.filter(|(_, count)| *count > 0).collect();
    stats.close(source.as_ref(), fields);
    Ok(stats)
}

fn place(kind: GeometryType) -> usize {
    GeometryType::ALL.iter().position(|known| *known == kind).unwrap_or_default()
}

impl FeaturesInfoReport {
    /// True if the features have ids or fields.
    pub fn is_more_than_positions(&self) -> bool {
        self.ids > 0 || !self.fields.is_empty()
    }

    fn add(&mut self, feature: &Feature) {
        let geometry: &Geometry = &feature.geometry;
        self.features += 1;
        self.ids += u64::from(feature.id.is_some());
        for part in geometry.parts() {
            match part.role {
                PartRole::Line => self.lines += 1,
                PartRole::Outer => self.outer_rings += 1,
                PartRole::Hole => self.holes += 1,
            }
        }
        self.vertices += geometry.vertices() as u64;
        if let Some([west, south, east, north]) = geometry.bounds() {
            let [w, s, e, n] = self.bounds.unwrap_or([west, south, east, north]);
            self.bounds = Some([w.min(west), s.min(south), e.max(east), n.max(north)]);
        }
        for leaf in geometry.leaves() {
            widen(&mut self.heights, &leaf.coordinates().z);
            widen(&mut self.measures, &leaf.coordinates().m);
        }
    }

    /// Metadata of the file, which some formats know only at the end.
    fn close(&mut self, source: &dyn FeatureSource, fields: FieldCollector) {
        let layer = source.layer();
        self.layer = layer.name.clone();
        (self.crs, self.epsg) = (layer.crs.label(), layer.crs.epsg);
        self.horizontal_unit = layer.crs.horizontal_unit();
        self.measures_are_times = layer.m_is_time;
        self.notes = source.notes();
        if fields.is_more {
            self.notes.push(format!("only the first {} fields are listed", fields.all.len()));
        }
        let claimed = layer.features.filter(|claimed| *claimed != self.features);
        self.notes.extend(claimed.map(|n| format!("the header states {n} features")));
        if let Some(claimed) = layer.extent.filter(|claimed| self.is_beyond(claimed)) {
            let claimed = claimed.map(|bound| bound.to_string()).join(", ");
            self.notes.push(format!("positions lie outside the bounds in the header: {claimed}"));
        }
        self.fields = fields.all;
    }

    /// True where positions lie outside of these bounds by more than a rounding.
    fn is_beyond(&self, [west, south, east, north]: &[f64; 4]) -> bool {
        self.bounds.is_some_and(|[w, s, e, n]| {
            w < west - bound_slack(*west)
                || s < south - bound_slack(*south)
                || e > east + bound_slack(*east)
                || n > north + bound_slack(*north)
        })
    }
}

/// Extends a range by values; ignores NaN.
fn widen(range: &mut Option<[f64; 2]>, values: &[f64]) {
    for value in values.iter().filter(|value| !value.is_nan()) {
        let [low, high] = range.unwrap_or([*value; 2]);
        *range = Some([low.min(*value), high.max(*value)]);
    }
}

/// Fields in the order of their first feature.
struct FieldCollector {
    all: Vec<FieldStats>,
    places: HashMap<Arc<str>, usize>,
    /// Type of the values found; `None` if the file declares it, or without values.
    found: Vec<Option<FieldKind>>,
    /// Fields that the file declares.
    declared: usize,
    /// True if there are more than the limit.
    is_more: bool,
}

impl FieldCollector {
    fn of(layer: &LayerHeader) -> Self {
        let declared = layer.schema.as_deref().unwrap_or_default();
        let places = declared.iter().enumerate().map(|(at, field)| (field.name.clone(), at));
        Self {
            all: declared.iter().map(FieldStats::declared).collect(),
            places: places.collect(),
            found: vec![None; declared.len()],
            declared: declared.len(),
            is_more: false,
        }
    }

    fn add(&mut self, feature: &Feature) {
        for (at, (name, value)) in feature.properties.iter().enumerate() {
            if let Some(at) = self.place(at, name) {
                self.note(at, value);
            }
        }
    }

    /// The place of the field called `name`, which is likely to be `guess`.
    fn place(&mut self, guess: usize, name: &Arc<str>) -> Option<usize> {
        if self.all.get(guess).is_some_and(|field| field.name == *name) {
            return Some(guess);
        }
        if let Some(at) = self.places.get(name) {
            return Some(*at);
        }
        if self.all.len() as u64 == limits::MAX_FIELDS {
            self.is_more = true;
            return None;
        }
        let at = self.all.len();
        let (name, kind) = (name.clone(), named(None));
        self.places.insert(name.clone(), at);
        self.all.push(FieldStats { name, kind, width: None, decimals: None, values: 0 });
        self.found.push(None);
        Some(at)
    }

    fn note(&mut self, at: usize, value: &PropertyValue) {
        let Some(kind) = value.kind() else { return };
        let field = &mut self.all[at];
        field.values += 1;
        if at >= self.declared {
            let found = self.found[at].map_or(kind, |before| before.with(kind));
            self.found[at] = Some(found);
            field.kind = named(Some(found));
        }
    }
}

/// The name of a kind of values.
fn named(kind: Option<FieldKind>) -> &'static str {
    match kind {
        None => "null",
        Some(FieldKind::Bool) => "boolean",
        Some(FieldKind::Int) => "integer",
        Some(FieldKind::Real) => "real",
        Some(FieldKind::Text) => "text",
        Some(FieldKind::Date) => "date",
        Some(FieldKind::DateTime) => "date and time",
        Some(FieldKind::Json) => "JSON",
    }
}
