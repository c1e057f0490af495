//! Synthetic lines as features: `synth:koch,vertices=1000000` in place of a file.

use std::path::Path;

use super::feature::{
    Feature, FeatureProperties, FieldDefinition, FieldKind, LayerHeader, PropertyValue,
};
use super::geometry::{CoordinateSequence, Geometry, GeometryType};
use super::source::FeatureSource;
use terrane_base::error::Result;
use terrane_synth::lines::SyntheticLines;

/// Prefix of names of synthetic lines.
const PREFIX: &str = "synth:";

/// The synthetic lines called `path`; `None` if it is another name.
///
/// # Errors
/// Invalid parameters.
pub fn synthetic(path: &Path) -> Option<Result<SyntheticLines>> {
    let name = path.to_str()?.strip_prefix(PREFIX)?;
    SyntheticLines::is_named(name).then(|| SyntheticLines::parse(name))
}

/// Synthetic lines as features, numbered from 1 as "id".
pub(super) struct SyntheticFeatures {
    lines: SyntheticLines,
    layer: LayerHeader,
    /// Features made.
    made: u32,
}

impl SyntheticFeatures {
    pub(super) fn new(lines: SyntheticLines) -> Self {
        let id = FieldDefinition {
            name: "id".into(),
            kind: FieldKind::Int,
            width: None,
            decimals: None,
        };
        let layer = LayerHeader {
            name: Some(lines.shape.name.to_owned()),
            schema: Some(vec![id]),
            features: Some(u64::from(lines.features)),
            ..LayerHeader::default()
        };
        Self { lines, layer, made: 0 }
    }
}

impl FeatureSource for SyntheticFeatures {
    fn next(&mut self) -> Result<Option<Feature>> {
        if self.made == self.lines.features {
            return Ok(None);
        }
        let mut coordinates = CoordinateSequence::default();
        self.lines.feature(self.made, &mut coordinates.xy);
        self.made += 1;
        let kind = if self.lines.shape.is_rings {
            GeometryType::Polygon
        } else {
            GeometryType::LineString
        };
        let mut properties = FeatureProperties::default();
        properties.push("id", PropertyValue::Int(i64::from(self.made)));
        let geometry = Geometry::new(kind, coordinates)?;
        Ok(Some(Feature { properties, geometry, ..Feature::default() }))
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        String::new()
    }
}
