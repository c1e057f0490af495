//! Attributes from the polygons that points lie in.

use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::lookup::{PositionValues, ValueLookup, attribute_name, dimension_of};
use super::{AnyStage, OpenStage, Stage, StageInput, StageName};
use terrane_base::digits::MAX_EXACT;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::{CloudInfo, FilterPolygon, NewDimension};
use terrane_engine::feature_files;
use terrane_engine::reading::polygons_with;
use terrane_vector::PropertyValue as Value;

/// Sets an attribute of the points in each polygon; where several overlap, the last one counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Overlay {
    /// The file of polygons.
    pub file: String,
    /// The attribute, or a new dimension.
    pub attribute: String,
    /// Its value.
    pub value: OverlayValue,
}

/// The value that points in a polygon get.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum OverlayValue {
    /// This number.
    Number(f64),
    /// That of a field of the polygon; without one, points keep their values.
    Field(String),
}

impl OverlayValue {
    fn of(text: &str) -> Self {
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.map_or_else(|| Self::Field(text.to_owned()), Self::Number)
    }
}

/// What is expected of a text.
const EXPECTED: &str = "expected FILE:ATTRIBUTE=FIELD, or =NUMBER";

impl FromStr for Overlay {
    type Err = String;

    /// "lakes.geojson:classification=9", "parcels.shp:owner=ID", "parcels.shp:owner=\"2020\"".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        // In quotes it is a field, whatever it looks like.
        let quoted = text.trim_end().strip_suffix('"').and_then(|text| text.rsplit_once("=\""));
        let (before, value) = match (quoted, text.rsplit_once('=')) {
            (Some((before, field)), _) => (before, OverlayValue::Field(field.to_owned())),
            (None, Some((before, value))) => (before, OverlayValue::of(value.trim())),
            (None, None) => return Err(EXPECTED.to_owned()),
        };
        let (file, name) = before.rsplit_once(':').ok_or(EXPECTED)?;
        if value == OverlayValue::Field(String::new()) {
            return Err("expected the name of a field, or a number, after =".to_owned());
        }
        if file.is_empty() {
            return Err("expected the name of a file".to_owned());
        }
        Ok(Self { file: file.to_owned(), attribute: attribute_name(name)?, value })
    }
}

impl Overlay {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "overlay",
        "FILE:ATTRIBUTE=FIELD",
        "set an attribute of points in polygons to a field of theirs, or to a number",
    )];
}

impl Stage for Overlay {
    fn dimensions(&self) -> Vec<NewDimension> {
        dimension_of(&self.attribute, "Of polygons").into_iter().collect()
    }

    fn resolved(&self, _: &CloudInfo) -> Result<Option<AnyStage>> {
        Ok(Some(Self { file: feature_files::absolute(&self.file)?, ..self.clone() }.into()))
    }

    fn files(&self) -> Vec<PathBuf> {
        feature_files::files(&self.file)
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let mut values = Vec::new();
        let (polygons, crs, path) = polygons_with(&self.file, &input.job.resources, |feature| {
            values.push(match &self.value {
                OverlayValue::Number(number) => *number,
                OverlayValue::Field(field) => number_of(feature.properties.get(field), field)?,
            });
            Ok(())
        })?;
        if let OverlayValue::Field(field) = &self.value
            && values.iter().all(|value| value.is_nan())
        {
            return Err(Error::bad_input(format!("no polygon has a number in a field {field:?}"))
                .in_file(&path)
                .remedy("pass the name of a field, or a number"));
        }
        let same = input.info.crs.check_same_of("cloud", &crs, "polygons");
        same.map_err(|error| error.in_file(&path))?;
        let polygons = polygons.in_steps(&input.info.frame);
        Ok(Box::new(ValueLookup::new(
            &[&self.attribute],
            FeatureValues { polygons, values },
            &path,
            input,
        )?))
    }
}

/// The number in a field; NaN for none.
fn number_of(value: Option<&Value>, field: &str) -> Result<f64> {
    match value {
        None | Some(Value::Null) => Ok(f64::NAN),
        Some(Value::Bool(is_true)) => Ok(f64::from(u8::from(*is_true))),
        Some(Value::Int(number)) if number.unsigned_abs() <= MAX_EXACT => Ok(*number as f64),
        Some(Value::Int(number)) => Err(too_large(field, &number.to_string())),
        Some(Value::Real(number)) => Ok(*number),
        Some(Value::Text(text)) => match text.trim().parse::<f64>() {
            Ok(number) if number.abs() > MAX_EXACT as f64 => Err(too_large(field, text)),
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(not_a_number(field, text)),
        },
        Some(Value::Date(text) | Value::DateTime(text) | Value::Json(text)) => {
            Err(not_a_number(field, text))
        }
    }
}

fn too_large(field: &str, number: &str) -> Error {
    Error::unsupported(format!("field {field:?} is {number}: numbers beyond 2^53 are not exact"))
        .remedy("choose another field")
}

fn not_a_number(field: &str, text: &str) -> Error {
    Error::bad_input(format!("field {field:?} is {text:?}, not a number"))
        .remedy("choose a field of numbers")
}

/// Polygons with values.
struct FeatureValues {
    /// In steps of the records.
    polygons: FilterPolygon,
    values: Vec<f64>,
}

impl PositionValues for FeatureValues {
    fn values(&self, at: Point, out: &mut [f64]) -> Result<()> {
        let feature = self.polygons.last_around(at.x.into(), at.y.into());
        out[0] = feature.map_or(f64::NAN, |feature| self.values[feature as usize]);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        self.polygons.bytes() + size_of_val(&self.values[..]) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_attributes_and_values_are_told_apart() {
        let read = |text: &str| text.parse::<Overlay>();
        let lakes = read("C:\\data\\lakes.shp:class = 9").unwrap();
        assert_eq!(
            (lakes.file.as_str(), lakes.attribute.as_str()),
            ("C:\\data\\lakes.shp", "class")
        );
        assert_eq!(lakes.value, OverlayValue::Number(9.0));
        let owner = read("a=b/parcels.geojson:owner=ID 2").unwrap();
        assert_eq!(owner.value, OverlayValue::Field("ID 2".to_owned()));
        let year = read("a.shp:year=\"2020\"").unwrap();
        assert_eq!(year.value, OverlayValue::Field("2020".to_owned()));
        let equals = read("a.shp:year=\"a=b\"").unwrap();
        assert_eq!(equals.value, OverlayValue::Field("a=b".to_owned()));
        for text in [
            "",
            "a.shp:year=\"\"",
            "lakes.shp",
            "lakes.shp:class",
            "lakes.shp:class=",
            ":class=9",
            "lakes.shp:z=1",
            "a:=1",
        ] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
