//! Synthetic lines as features: `synth:koch,vertices=1000000` in place of a file.

use std::path::Path;

use super::feature::{Feature, Field, FieldKind, Layer, Properties, Value};
use super::geometry::{Coordinates, Geometry, Kind};
use super::source::FeatureSource;
use terrane_base::error::Result;
use terrane_synth::lines::Lines;

/// What comes before the name of the lines.
const PREFIX: &str = "synth:";

/// The lines of this name; `None` for the name of anything else.
///
/// # Errors
/// Parameters that make no sense.
pub fn synthetic(path: &Path) -> Option<Result<Lines>> {
    let name = path.to_str()?.strip_prefix(PREFIX)?;
    Lines::is_named(name).then(|| Lines::parse(name))
}

/// Lines as a source of features, each with its number from 1 as "id".
pub(super) struct Synthetic {
    lines: Lines,
    layer: Layer,
    /// Features made.
    made: u32,
}

impl Synthetic {
    pub(super) fn new(lines: Lines) -> Self {
        let id = Field { name: "id".into(), kind: FieldKind::Int, width: None, decimals: None };
        let layer = Layer {
            name: Some(lines.shape.name.to_owned()),
            schema: Some(vec![id]),
            features: Some(u64::from(lines.features)),
            ..Layer::default()
        };
        Self { lines, layer, made: 0 }
    }
}

impl FeatureSource for Synthetic {
    fn next(&mut self) -> Result<Option<Feature>> {
        if self.made == self.lines.features {
            return Ok(None);
        }
        let mut coordinates = Coordinates::default();
        self.lines.feature(self.made, &mut coordinates.xy);
        self.made += 1;
        let kind = if self.lines.shape.is_rings { Kind::Polygon } else { Kind::LineString };
        let mut properties = Properties::default();
        properties.push("id", Value::Int(i64::from(self.made)));
        let geometry = Geometry::new(kind, coordinates)?;
        Ok(Some(Feature { properties, geometry, ..Feature::default() }))
    }

    fn layer(&self) -> &Layer {
        &self.layer
    }

    fn place(&self) -> String {
        String::new()
    }
}
