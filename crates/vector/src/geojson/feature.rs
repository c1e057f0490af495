//! Parser of a feature or geometry.

use std::sync::Arc;

use crate::decimal;
use crate::feature::{Feature, FeatureProperties, Id, JsonMember, PropertyValue};
use crate::geometry::{Geometry, GeometryType};
use crate::json::{JsonCursor, JsonToken, compact};
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Feature parser; repeated property names share their memory.
#[derive(Default)]
pub(crate) struct GeoJsonFeatureReader {
    /// Property names of the previous feature.
    names: Vec<Arc<str>>,
}

impl GeoJsonFeatureReader {
    /// A feature, or a bare geometry, from the text of an object.
    pub(super) fn feature(&mut self, text: &[u8], base: u64) -> Result<Feature> {
        let mut cursor = JsonCursor::new(text, base);
        let mut feature = Feature::default();
        let (mut is_first, mut is_feature, mut is_geometry) = (true, false, false);
        cursor.expect(b'{')?;
        while let Some(name) = cursor.member(&mut is_first)? {
            match &*name {
                "type" => {
                    let kind = cursor.string()?;
                    if GeometryType::by_name(&kind).is_some_and(|kind| kind != GeometryType::Null) {
                        return bare(text, base);
                    }
                    is_feature = kind == "Feature";
                    if !is_feature {
                        return Err(cursor.bad(format!("type {:?} is not Feature", short(&kind))));
                    }
                }
                "geometry" => feature.geometry = geometry(&mut cursor, 0)?,
                "properties" => feature.properties = self.properties(&mut cursor)?,
                "id" => feature.id = id(&mut cursor)?,
                _ => {
                    is_geometry |= matches!(&*name, "coordinates" | "geometries");
                    let count = feature.foreign.len() as u64;
                    limits::check("number of members of a feature", count, limits::MAX_FIELDS)?;
                    feature.foreign.push(member(&name, &mut cursor)?);
                }
            }
        }
        match (is_feature, is_geometry) {
            (true, _) => Ok(feature),
            (false, true) => bare(text, base),
            (false, false) => Err(cursor.bad("object has no known type")),
        }
    }

    /// A properties object, or null.
    pub(crate) fn properties(&mut self, cursor: &mut JsonCursor<'_>) -> Result<FeatureProperties> {
        let mut properties = FeatureProperties::default();
        if cursor.peek() != Some(b'{') {
            return match cursor.value()? {
                JsonToken::Null => Ok(properties),
                _ => Err(cursor.bad("properties are not an object")),
            };
        }
        cursor.expect(b'{')?;
        properties.0.reserve(self.names.len());
        let mut is_first = true;
        while let Some(name) = cursor.member(&mut is_first)? {
            let at = properties.0.len();
            limits::check("number of properties of a feature", at as u64, limits::MAX_FIELDS)?;
            let known = self.names.get(at).filter(|known| ***known == *name);
            let name = known.cloned().unwrap_or_else(|| Arc::from(&*name));
            properties.0.push((name, value(cursor.value()?)));
        }
        if self.names.len() != properties.0.len()
            || self.names.iter().zip(&properties.0).any(|(a, (b, _))| !Arc::ptr_eq(a, b))
        {
            self.names = properties.0.iter().map(|(name, _)| name.clone()).collect();
        }
        Ok(properties)
    }
}

/// A foreign member.
pub(crate) fn member(name: &str, cursor: &mut JsonCursor<'_>) -> Result<JsonMember> {
    let json = match cursor.value()? {
        JsonToken::Null => "null".to_owned(),
        JsonToken::Bool(value) => value.to_string(),
        JsonToken::Number(text) => text.to_owned(),
        JsonToken::Text(text) => serde_json::Value::from(&*text).to_string(),
        JsonToken::Nested(json) => compact(json),
    };
    Ok(JsonMember { name: name.to_owned(), json })
}

/// The id of a feature.
pub(crate) fn id(cursor: &mut JsonCursor<'_>) -> Result<Option<Id>> {
    match value(cursor.value()?) {
        PropertyValue::Null => Ok(None),
        PropertyValue::Int(id) => Ok(Some(Id::Int(id))),
        PropertyValue::Real(id) => Ok(Some(Id::Real(id))),
        PropertyValue::Text(id) => Ok(Some(Id::Text(id))),
        _ => Err(cursor.bad("id is neither a number nor a string")),
    }
}

fn value(token: JsonToken<'_>) -> PropertyValue {
    match token {
        JsonToken::Null => PropertyValue::Null,
        JsonToken::Bool(value) => PropertyValue::Bool(value),
        JsonToken::Text(text) => PropertyValue::Text(text.into_owned()),
        JsonToken::Nested(json) => PropertyValue::Json(compact(json)),
        JsonToken::Number(text) => {
            let is_whole = !text.contains(['.', 'e', 'E']) && text != "-0";
            let value = match is_whole {
                true => text.parse().ok().map(PropertyValue::Int),
                false => decimal::whole(text.as_bytes())
                    .filter(|value| value.is_finite())
                    .map(PropertyValue::Real),
            };
            // A number that neither type can store keeps its digits.
            value.unwrap_or_else(|| PropertyValue::Json(text.to_owned()))
        }
    }
}

/// A geometry outside a feature.
fn bare(text: &[u8], base: u64) -> Result<Feature> {
    let geometry = geometry(&mut JsonCursor::new(text, base), 0)?;
    Ok(Feature { geometry, ..Feature::default() })
}

/// A geometry object, or null, inside `depth` collections; recursion is limited to the allowed depth of
/// collections.
fn geometry(cursor: &mut JsonCursor<'_>, depth: u64) -> Result<Geometry> {
    limits::check("depth of a geometry collection", depth, limits::MAX_COLLECTION_DEPTH)?;
    if cursor.peek() != Some(b'{') {
        return match cursor.value()? {
            JsonToken::Null => Ok(Geometry::null()),
            _ => Err(cursor.bad("geometry is not an object")),
        };
    }
    cursor.expect(b'{')?;
    let (mut kind, mut coordinates, mut members) = (None, None, None);
    let mut is_first = true;
    while let Some(name) = cursor.member(&mut is_first)? {
        match &*name {
            "type" => {
                let name = cursor.string()?;
                kind = GeometryType::by_name(&name);
                if kind.is_none() {
                    return Err(
                        cursor.bad(format!("type {:?} is not a geometry type", short(&name)))
                    );
                }
            }
            "coordinates" => coordinates = Some(cursor.coordinates()?),
            "geometries" => members = Some(geometries(cursor, depth)?),
            _ => _ = cursor.value()?,
        }
    }
    let missing = |what: &str| cursor.bad(format!("geometry lacks {what}"));
    match (kind.ok_or_else(|| missing("type"))?, coordinates, members) {
        (GeometryType::Collection, _, members) => {
            Geometry::collection(members.ok_or_else(|| missing("geometries"))?)
        }
        (kind, coordinates, _) => {
            let (found, coordinates) = coordinates.ok_or_else(|| missing("coordinates"))?;
            check_depth(kind, found).map_err(|e| cursor.bad(e))?;
            Geometry::new(kind, coordinates)
        }
    }
}

fn geometries(cursor: &mut JsonCursor<'_>, depth: u64) -> Result<Vec<Geometry>> {
    cursor.expect(b'[')?;
    let (mut is_first, mut members) = (true, Vec::new());
    while cursor.item(&mut is_first)? {
        let count = members.len() as u64;
        limits::check(
            "number of members of a geometry collection",
            count,
            limits::MAX_COLLECTION_MEMBERS,
        )?;
        members.push(geometry(cursor, depth + 1)?);
    }
    Ok(members)
}

/// Fails unless positions are nested as deeply as `kind` requires; 0 means no positions.
pub(crate) fn check_depth(kind: GeometryType, found: usize) -> std::result::Result<(), String> {
    let deep = match kind {
        GeometryType::Point => 1,
        GeometryType::MultiPoint | GeometryType::LineString => 2,
        GeometryType::MultiLineString | GeometryType::Polygon => 3,
        GeometryType::MultiPolygon => 4,
        GeometryType::Null | GeometryType::Collection => 0,
    };
    if found == deep || found == 0 {
        return Ok(());
    }
    Err(format!("coordinates are nested {found} deep, expected {deep} for {}", kind.name()))
}

/// A prefix of `text` for error messages.
pub(crate) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Error of a feature that is not an object.
pub(super) fn no_object(place: u64) -> Error {
    Error::bad_input(format!("byte {place}: missing feature or extra comma"))
}
