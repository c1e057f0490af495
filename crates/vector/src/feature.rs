//! Features: a geometry with its id and properties.

use std::sync::Arc;

use super::geometry::Geometry;

/// A feature as read, and as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Feature {
    /// Its id, in formats that store ids apart from properties.
    pub id: Option<Id>,
    /// Its properties, in order.
    pub properties: FeatureProperties,
    /// Its geometry.
    pub geometry: Geometry,
    /// Foreign members of a GeoJSON feature (RFC 7946, section 6.1); "bbox" counts as one.
    pub foreign: Vec<JsonMember>,
}

/// The id of a feature.
#[derive(Clone, Debug, PartialEq)]
pub enum Id {
    /// An integer.
    Int(i64),
    /// Any other number.
    Real(f64),
    /// A string.
    Text(String),
}

/// A foreign member of a JSON object, copied unchanged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JsonMember {
    /// Its name.
    pub name: String,
    /// Its value: JSON text.
    pub json: String,
}

/// Names and values, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureProperties(pub Vec<(Arc<str>, PropertyValue)>);

impl FeatureProperties {
    /// The value of the first property called `name`.
    pub fn get(&self, name: &str) -> Option<&PropertyValue> {
        self.0.iter().find(|(found, _)| **found == *name).map(|(_, value)| value)
    }

    /// Appends a property.
    pub fn push(&mut self, name: impl Into<Arc<str>>, value: PropertyValue) {
        self.0.push((name.into(), value));
    }

    /// Names and values, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&Arc<str>, &PropertyValue)> {
        self.0.iter().map(|(name, value)| (name, value))
    }
}

/// The value of a property.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PropertyValue {
    /// None.
    #[default]
    Null,
    /// True or false.
    Bool(bool),
    /// An integer.
    Int(i64),
    /// A finite number.
    Real(f64),
    /// A string.
    Text(String),
    /// A date, as "2026-01-31".
    Date(String),
    /// A date and time, as in ISO 8601.
    DateTime(String),
    /// An object, an array, or a number out of range: JSON text.
    Json(String),
}

/// Whether `text` is a valid date, as in [`PropertyValue::Date`].
pub(super) fn is_date(text: &str) -> bool {
    text.len() == 10
        && text.bytes().enumerate().all(|(at, byte)| matches!(at, 4 | 7) || byte.is_ascii_digit())
        && chrono::NaiveDate::parse_from_str(text, "%Y-%m-%d").is_ok()
}

/// Type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// [`PropertyValue::Bool`].
    Bool,
    /// [`PropertyValue::Int`].
    Int,
    /// [`PropertyValue::Real`].
    Real,
    /// [`PropertyValue::Text`].
    Text,
    /// [`PropertyValue::Date`].
    Date,
    /// [`PropertyValue::DateTime`].
    DateTime,
    /// [`PropertyValue::Json`].
    Json,
}

impl PropertyValue {
    /// The field type of the value; null fits any.
    pub fn kind(&self) -> Option<FieldKind> {
        match self {
            Self::Null => None,
            Self::Bool(_) => Some(FieldKind::Bool),
            Self::Int(_) => Some(FieldKind::Int),
            Self::Real(_) => Some(FieldKind::Real),
            Self::Text(_) => Some(FieldKind::Text),
            Self::Date(_) => Some(FieldKind::Date),
            Self::DateTime(_) => Some(FieldKind::DateTime),
            Self::Json(_) => Some(FieldKind::Json),
        }
    }
}

impl FieldKind {
    /// The common type of two fields: Real for numbers, else Text.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        match (self, other) {
            _ if self == other => self,
            (Self::Int | Self::Real, Self::Int | Self::Real) => Self::Real,
            _ => Self::Text,
        }
    }
}

/// Definition of a field of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldDefinition {
    /// Its name.
    pub name: Arc<str>,
    /// Type of its values.
    pub kind: FieldKind,
    /// Maximum length of a value as text in bytes, if the format limits it.
    pub width: Option<u32>,
    /// Number of decimals, if the format fixes it.
    pub decimals: Option<u32>,
}

/// Header of a layer, copied from input to output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerHeader {
    /// Its name.
    pub name: Option<String>,
    /// Coordinate reference system.
    pub crs: terrane_base::geom::Crs,
    /// The fields, in formats with one schema for all features.
    pub schema: Option<Vec<FieldDefinition>>,
    /// x min, y min, x max, y max as declared in the header; not verified.
    pub extent: Option<[f64; 4]>,
    /// Number of features as declared in the header; not verified.
    pub features: Option<u64>,
    /// True if measures are times: seconds since 1970-01-01 (UTC).
    pub m_is_time: bool,
    /// Foreign members of a GeoJSON collection. Those after the features are known once all features have
    /// been read.
    pub foreign: Vec<JsonMember>,
}
