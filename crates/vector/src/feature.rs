//! Features: a geometry with its id and properties.

use std::sync::Arc;

use super::geometry::Geometry;

/// A feature as read, and as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Feature {
    /// Its id, in formats that have ids apart from properties.
    pub id: Option<Id>,
    /// Its properties, in order.
    pub properties: FeatureProperties,
    /// Where it is.
    pub geometry: Geometry,
    /// Members of a GeoJSON feature beside those of the standard ("bbox" is one of them).
    pub foreign: Vec<JsonMember>,
}

/// The id of a feature.
#[derive(Clone, Debug, PartialEq)]
pub enum Id {
    /// A whole number.
    Int(i64),
    /// Any other number.
    Real(f64),
    /// A text.
    Text(String),
}

/// A member of a JSON object that is passed on as it is.
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
    /// A whole number.
    Int(i64),
    /// A number, which is finite.
    Real(f64),
    /// A text.
    Text(String),
    /// A day, as "2026-01-31".
    Date(String),
    /// A moment, after ISO 8601.
    DateTime(String),
    /// An object, a list, or a number beyond the others: JSON text.
    Json(String),
}

/// Whether a text is a day of the calendar as [`PropertyValue::Date`] holds it.
pub(super) fn is_date(text: &str) -> bool {
    let is_digit = |(at, byte): (usize, u8)| matches!(at, 4 | 7) || byte.is_ascii_digit();
    text.len() == 10
        && text.bytes().enumerate().all(is_digit)
        && chrono::NaiveDate::parse_from_str(text, "%Y-%m-%d").is_ok()
}

/// What the values of a field are.
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
    /// What kind of field holds it; null fits any.
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
    /// The kind that holds the values of both: numbers are reals, all else text.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        match (self, other) {
            _ if self == other => self,
            (Self::Int | Self::Real, Self::Int | Self::Real) => Self::Real,
            _ => Self::Text,
        }
    }
}

/// A column of a table of features.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldDefinition {
    /// Its name.
    pub name: Arc<str>,
    /// What its values are.
    pub kind: FieldKind,
    /// Most bytes of a value as text, where the format limits them.
    pub width: Option<u32>,
    /// Digits behind the point, where the format fixes them.
    pub decimals: Option<u32>,
}

/// What a file says of itself, carried from input to output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerHeader {
    /// Its name.
    pub name: Option<String>,
    /// Coordinate reference system.
    pub crs: terrane_base::geom::Crs,
    /// The fields, in formats that have the same for all features.
    pub schema: Option<Vec<FieldDefinition>>,
    /// x low, y low, x high, y high as the header has them: a claim.
    pub extent: Option<[f64; 4]>,
    /// Features as the header has them: a claim.
    pub features: Option<u64>,
    /// True where measures are moments: seconds since the start of 1970 (UTC).
    pub m_is_time: bool,
    /// Members of a GeoJSON collection beside those of the standard. Those that stand after the
    /// features are known once all have been read.
    pub foreign: Vec<JsonMember>,
}
