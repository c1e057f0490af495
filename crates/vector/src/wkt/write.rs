//! Writer with one geometry per line.

use std::path::Path;

use crate::crs;
use crate::decimal;
use crate::feature::{Feature, JsonMember, LayerHeader};
use crate::geometry::{CoordinateSequence, Geometry, GeometryPart, GeometryType};
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use terrane_base::error::{Error, Result};
use terrane_files::atomic::Sidecar;

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    let out = VectorOutputFile::create(path, options.overwrite)?;
    let prj = crs::prj(path, &layer.crs, options.overwrite)?;
    let notes = crs::notes(&layer.crs);
    Ok(Box::new(WktSink { out, prj, notes, features: 0, with_properties: 0, nulls: 0 }))
}

struct WktSink {
    out: VectorOutputFile,
    prj: Sidecar,
    notes: Vec<String>,
    features: u64,
    /// Number of features with properties or an id.
    with_properties: u64,
    /// Number of features with a null geometry.
    nulls: u64,
}

impl FeatureSink for WktSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        self.features += 1;
        let has_more = !feature.properties.0.is_empty() || feature.id.is_some();
        self.with_properties += u64::from(has_more);
        self.nulls += u64::from(feature.geometry.kind() == GeometryType::Null);
        let number = self.features;
        push_geometry(&feature.geometry, &mut self.out.buffer)
            .map_err(|e| e.at(format!("feature {number}")))?;
        self.out.buffer.push(b'\n');
        self.out.settle()
    }

    fn finish(self: Box<Self>, _: &[JsonMember]) -> Result<WrittenFeatures> {
        let mut notes = self.notes;
        if self.with_properties > 0 {
            let count = self.with_properties;
            notes.push(format!("properties of {count} features omitted: WKT has no properties"));
        }
        if self.nulls > 0 {
            let what = "features without a geometry are written as empty collections";
            notes.push(format!("{} {what}", self.nulls));
        }
        let (path, mut bytes) = self.out.commit()?;
        let mut files = vec![path];
        self.prj.commit()?;
        if let Some((path, more)) = self.prj.place() {
            files.push(path);
            bytes += more;
        }
        Ok(WrittenFeatures { features: self.features, bytes, files, notes })
    }
}

// Collections are nested no deeper than their constructor allows.
fn push_geometry(geometry: &Geometry, text: &mut Vec<u8>) -> Result<()> {
    let kind = if geometry.kind() == GeometryType::Null {
        GeometryType::Collection
    } else {
        geometry.kind()
    };
    text.extend_from_slice(kind.name().to_ascii_uppercase().as_bytes());
    let coordinates = geometry.coordinates();
    let CoordinateSequence { z, m, .. } = coordinates;
    if z.iter().any(|z| z.is_nan()) || m.iter().any(|m| m.is_nan()) {
        let message = "some vertices lack a height or measure";
        return Err(Error::usage(message).remedy("write GeoJSON or FlatGeobuf"));
    }
    text.extend_from_slice(match (z.is_empty(), m.is_empty()) {
        (true, true) => b" ",
        (false, true) => b" Z ",
        (true, false) => b" M ",
        (false, false) => b" ZM ",
    });
    if coordinates.xy.is_empty() && geometry.members().is_empty() {
        text.extend_from_slice(b"EMPTY");
        return Ok(());
    }
    let mut pen = WktWriter { text };
    match kind {
        GeometryType::Collection => {
            pen.text.push(b'(');
            for (at, member) in geometry.members().iter().enumerate() {
                if at > 0 {
                    pen.text.push(b',');
                }
                push_geometry(member, pen.text)?;
            }
            pen.text.push(b')');
        }
        GeometryType::MultiPolygon => {
            pen.list(geometry.polygons(), |pen, rings| pen.list(rings, WktWriter::part))
        }
        GeometryType::MultiLineString | GeometryType::Polygon => {
            pen.list(geometry.own_parts(), WktWriter::part)
        }
        _ => {
            let CoordinateSequence { xy, z, m, .. } = coordinates;
            pen.part(GeometryPart { xy, z, m, role: crate::PartRole::Line });
        }
    }
    Ok(())
}

struct WktWriter<'a> {
    text: &'a mut Vec<u8>,
}

impl WktWriter<'_> {
    fn list<T>(&mut self, items: impl Iterator<Item = T>, mut item: impl FnMut(&mut Self, T)) {
        self.text.push(b'(');
        for (at, one) in items.enumerate() {
            if at > 0 {
                self.text.push(b',');
            }
            item(self, one);
        }
        self.text.push(b')');
    }

    fn part(&mut self, part: GeometryPart<'_>) {
        self.list(0..part.xy.len(), |pen, at| {
            let [x, y] = part.xy[at];
            let more = part.z.get(at).into_iter().chain(part.m.get(at));
            decimal::push(x, pen.text);
            for value in std::iter::once(&y).chain(more) {
                pen.text.push(b' ');
                decimal::push(*value, pen.text);
            }
        });
    }
}
