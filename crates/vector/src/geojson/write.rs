//! Writer of feature collections and of newline-delimited features.

use std::path::Path;

use crate::crs;
use crate::decimal;
use crate::feature::{Feature, Id, JsonMember, LayerHeader, PropertyValue};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::json::push_text;
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use terrane_base::error::Result;
use terrane_files::atomic::Sidecar;

/// Creates a file with one FeatureCollection.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    let mut sink = GeoJsonSink::new(path, layer, options, true)?;
    sink.head(layer);
    Ok(Box::new(sink))
}

/// Creates a file with one feature per line.
pub(super) fn create_lines(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    Ok(Box::new(GeoJsonSink::new(path, layer, options, false)?))
}

struct GeoJsonSink {
    out: VectorOutputFile,
    /// `.prj` sidecar, if the CRS cannot be stored in the file.
    prj: Option<Sidecar>,
    is_collection: bool,
    features: u64,
    /// Number of features with measures and without heights, whose measures cannot be stored.
    measured: u64,
    notes: Vec<String>,
}

impl GeoJsonSink {
    fn new(
        path: &Path,
        layer: &LayerHeader,
        options: &VectorWriteOptions,
        is_collection: bool,
    ) -> Result<Self> {
        let out = VectorOutputFile::create(path, options.overwrite)?;
        let is_held =
            crs::is_wgs84(&layer.crs) || (is_collection && crs::member(&layer.crs).is_some());
        let prj = match is_held {
            true => None,
            false => Some(crs::prj(path, &layer.crs, options.overwrite)?),
        };
        let mut notes = Vec::new();
        if !layer.crs.is_named() {
            let what = "readers will assume longitude and latitude in WGS 84";
            notes.push(format!("CRS is unknown: {what}"));
        }
        if !crs::is_wgs84(&layer.crs) {
            let is_beside = prj.as_ref().is_some_and(|prj| prj.place().is_some());
            let how = match (is_held, is_beside) {
                (true, _) => "declared in a \"crs\" member (GeoJSON 2008)",
                (false, true) => "declared in a .prj sidecar",
                (false, false) => "not declared",
            };
            let label = layer.crs.label();
            notes.push(format!("coordinates are in {label}, not WGS 84; the CRS is {how}"));
        }
        Ok(Self { out, prj, is_collection, features: 0, measured: 0, notes })
    }

    /// Writes the text before the features.
    fn head(&mut self, layer: &LayerHeader) {
        let text = &mut self.out.buffer;
        text.extend_from_slice(b"{\n\"type\":\"FeatureCollection\",\n");
        if let Some(name) = &layer.name {
            text.extend_from_slice(b"\"name\":");
            push_text(name, text);
            text.extend_from_slice(b",\n");
        }
        if let Some(crs) = crs::member(&layer.crs) {
            text.extend_from_slice(b"\"crs\":");
            text.extend_from_slice(crs.as_bytes());
            text.extend_from_slice(b",\n");
        }
        for member in &layer.foreign {
            push_member(member, text);
            text.extend_from_slice(b",\n");
        }
        text.extend_from_slice(b"\"features\":[");
    }
}

impl FeatureSink for GeoJsonSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let is_first = self.features == 0;
        let text = &mut self.out.buffer;
        match (self.is_collection, is_first) {
            (true, true) => text.push(b'\n'),
            (true, false) => text.extend_from_slice(b",\n"),
            (false, _) => {}
        }
        push_feature(feature, text);
        if !self.is_collection {
            text.push(b'\n');
        }
        self.features += 1;
        self.measured += u64::from(feature.geometry.has_m() && !feature.geometry.has_z());
        self.out.settle()
    }

    fn finish(mut self: Box<Self>, foreign: &[JsonMember]) -> Result<WrittenFeatures> {
        if self.is_collection {
            let text = &mut self.out.buffer;
            text.extend_from_slice(b"\n]");
            for member in foreign {
                text.extend_from_slice(b",\n");
                push_member(member, text);
            }
            text.extend_from_slice(b"\n}\n");
        }
        if self.measured > 0 {
            let count = self.measured;
            let what = "omitted: GeoJSON stores measures only after heights";
            self.notes.push(format!("measures (m) of {count} features {what}"));
        }
        let (path, mut bytes) = self.out.commit()?;
        let mut files = vec![path];
        if let Some(prj) = self.prj {
            prj.commit()?;
            if let Some((path, more)) = prj.place() {
                files.push(path);
                bytes += more;
            }
        }
        Ok(WrittenFeatures { features: self.features, bytes, files, notes: self.notes })
    }
}

fn push_member(member: &JsonMember, text: &mut Vec<u8>) {
    push_text(&member.name, text);
    text.push(b':');
    text.extend_from_slice(member.json.as_bytes());
}

fn push_feature(feature: &Feature, text: &mut Vec<u8>) {
    text.extend_from_slice(b"{\"type\":\"Feature\",");
    if let Some(id) = &feature.id {
        text.extend_from_slice(b"\"id\":");
        match id {
            Id::Int(id) => text.extend_from_slice(id.to_string().as_bytes()),
            Id::Real(id) => push_real(*id, text),
            Id::Text(id) => push_text(id, text),
        }
        text.push(b',');
    }
    for member in &feature.foreign {
        push_member(member, text);
        text.push(b',');
    }
    text.extend_from_slice(b"\"properties\":{");
    for (at, (name, value)) in feature.properties.iter().enumerate() {
        if at > 0 {
            text.push(b',');
        }
        push_text(name, text);
        text.push(b':');
        push_value(value, text);
    }
    text.extend_from_slice(b"},\"geometry\":");
    push_geometry(&feature.geometry, text);
    text.push(b'}');
}

/// Appends a number with a decimal point or an exponent, so that it is read back as a real.
fn push_real(value: f64, text: &mut Vec<u8>) {
    // Writing into a vector cannot fail.
    let _ = serde_json::to_writer(text, &value);
}

fn push_value(value: &PropertyValue, text: &mut Vec<u8>) {
    match value {
        PropertyValue::Null => text.extend_from_slice(b"null"),
        PropertyValue::Bool(true) => text.extend_from_slice(b"true"),
        PropertyValue::Bool(false) => text.extend_from_slice(b"false"),
        PropertyValue::Int(value) => text.extend_from_slice(value.to_string().as_bytes()),
        PropertyValue::Real(value) => push_real(*value, text),
        PropertyValue::Json(json) => text.extend_from_slice(json.as_bytes()),
        PropertyValue::Text(value)
        | PropertyValue::Date(value)
        | PropertyValue::DateTime(value) => push_text(value, text),
    }
}

// Collections are nested no deeper than their constructor allows.
fn push_geometry(geometry: &Geometry, text: &mut Vec<u8>) {
    if geometry.kind() == GeometryType::Null {
        text.extend_from_slice(b"null");
        return;
    }
    text.extend_from_slice(b"{\"type\":\"");
    text.extend_from_slice(geometry.kind().name().as_bytes());
    if geometry.kind() == GeometryType::Collection {
        text.extend_from_slice(b"\",\"geometries\":[");
        for (at, member) in geometry.members().iter().enumerate() {
            if at > 0 {
                text.push(b',');
            }
            push_geometry(member, text);
        }
        text.extend_from_slice(b"]}");
        return;
    }
    text.extend_from_slice(b"\",\"coordinates\":");
    let coordinates = geometry.coordinates();
    let all = 0..coordinates.xy.len();
    let mut pen = GeoJsonPositionWriter { coordinates, text };
    match geometry.kind() {
        GeometryType::Point if all.is_empty() => pen.text.extend_from_slice(b"[]"),
        GeometryType::Point => pen.position(0),
        GeometryType::MultiPoint | GeometryType::LineString => pen.positions(all),
        GeometryType::MultiLineString | GeometryType::Polygon => {
            pen.parts(0..coordinates.ends.len())
        }
        _ => pen.list(0..coordinates.polygons.len(), |pen, polygon| {
            let ends = &coordinates.polygons;
            let start = if polygon == 0 { 0 } else { ends[polygon - 1] };
            pen.parts(start..ends[polygon]);
        }),
    }
    text.push(b'}');
}

/// Writer of coordinate arrays.
struct GeoJsonPositionWriter<'a> {
    coordinates: &'a CoordinateSequence,
    text: &'a mut Vec<u8>,
}

impl GeoJsonPositionWriter<'_> {
    fn list(&mut self, range: std::ops::Range<usize>, mut item: impl FnMut(&mut Self, usize)) {
        self.text.push(b'[');
        let first = range.start;
        for at in range {
            if at > first {
                self.text.push(b',');
            }
            item(self, at);
        }
        self.text.push(b']');
    }

    fn parts(&mut self, parts: std::ops::Range<usize>) {
        let ends = &self.coordinates.ends;
        self.list(parts, |pen, part| {
            let start = if part == 0 { 0 } else { ends[part - 1] };
            pen.positions(start..ends[part]);
        });
    }

    fn positions(&mut self, range: std::ops::Range<usize>) {
        self.list(range, Self::position);
    }

    fn position(&mut self, at: usize) {
        let [x, y] = self.coordinates.xy[at];
        self.text.push(b'[');
        decimal::push(x, self.text);
        self.text.push(b',');
        decimal::push(y, self.text);
        let there = |values: &[f64]| values.get(at).copied().filter(|value| !value.is_nan());
        if let Some(z) = there(&self.coordinates.z) {
            self.text.push(b',');
            decimal::push(z, self.text);
            if let Some(m) = there(&self.coordinates.m) {
                self.text.push(b',');
                decimal::push(m, self.text);
            }
        }
        self.text.push(b']');
    }
}
