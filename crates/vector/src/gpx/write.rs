//! Writer. Waypoints precede routes, and routes precede tracks, so routes and tracks are buffered.

use std::path::{Path, PathBuf};

use super::time;
use crate::crs;
use crate::decimal;
use crate::feature::{Feature, JsonMember, LayerHeader, PropertyValue};
use crate::geometry::{CoordinateSequence, GeometryPart, GeometryType, PartRole};
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use crate::table::push_text;
use terrane_base::error::{Error, Result};
use terrane_files::{self as files, folder_for};

/// Text elements of a waypoint, in the order of the schema.
pub(super) const POINT_TEXTS: &[&str] = &[
    "magvar",
    "geoidheight",
    "name",
    "cmt",
    "desc",
    "src",
    "sym",
    "type",
    "fix",
    "sat",
    "hdop",
    "vdop",
    "pdop",
    "ageofdgpsdata",
    "dgpsid",
];
/// Text elements of a route or track.
pub(super) const LINE_TEXTS: &[&str] = &["name", "cmt", "desc", "src", "number", "type"];

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    if !crs::is_wgs84(&layer.crs) && layer.crs.geographic != Some(true) {
        let message =
            format!("GPX requires longitude and latitude, input is in {}", layer.crs.label());
        return Err(Error::usage(message)
            .in_file(path)
            .remedy("reproject the input first: ogr2ogr -t_srs EPSG:4326"));
    }
    let mut notes = Vec::new();
    if !crs::is_wgs84(&layer.crs) {
        notes.push(format!(
            "coordinates are in {}, but readers of GPX assume WGS 84",
            layer.crs.label()
        ));
    }
    let mut out = VectorOutputFile::create(path, options.overwrite)?;
    out.buffer.extend_from_slice(HEAD.as_bytes());
    let folder = folder_for(path, options.temp_dir.as_deref());
    Ok(Box::new(GpxSink {
        out,
        routes: files::AppendWriter::spool(folder)?,
        tracks: files::AppendWriter::spool(folder)?,
        m_is_time: layer.m_is_time,
        features: 0,
        measured: 0,
        with_more: 0,
        notes,
        path: path.to_path_buf(),
    }))
}

const HEAD: &str = concat!(
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n",
    "<gpx version=\"1.1\" creator=\"terrane ",
    env!("CARGO_PKG_VERSION"),
    "\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n"
);

struct GpxSink {
    out: VectorOutputFile,
    routes: files::AppendWriter,
    tracks: files::AppendWriter,
    m_is_time: bool,
    features: u64,
    /// Number of features with measures that are not times.
    measured: u64,
    /// Number of features with an id or properties that GPX cannot store.
    with_more: u64,
    notes: Vec<String>,
    path: PathBuf,
}

impl FeatureSink for GpxSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        self.features += 1;
        let place = format!("feature {}", self.features);
        self.put(feature).map_err(|e| e.at(place).in_file(&self.path))
    }

    fn finish(mut self: Box<Self>, _: &[JsonMember]) -> Result<WrittenFeatures> {
        self.out.append(self.routes)?;
        self.out.append(self.tracks)?;
        self.out.buffer.extend_from_slice(b"</gpx>\n");
        let mut notes = self.notes;
        if self.measured > 0 {
            let count = self.measured;
            notes.push(format!("measures (m) of {count} features omitted: they are not times"));
        }
        if self.with_more > 0 {
            let count = self.with_more;
            notes.push(format!(
                "ids and properties of {count} features that GPX cannot store omitted"
            ));
        }
        let (path, bytes) = self.out.commit()?;
        Ok(WrittenFeatures { features: self.features, bytes, files: vec![path], notes })
    }
}

impl GpxSink {
    fn put(&mut self, feature: &Feature) -> Result<()> {
        let geometry = &feature.geometry;
        let known = if geometry.kind() == GeometryType::Point { POINT_TEXTS } else { LINE_TEXTS };
        let lost = feature
            .properties
            .iter()
            .any(|(name, value)| *value != PropertyValue::Null && !known.contains(&&**name));
        self.with_more += u64::from(lost || feature.id.is_some());
        self.measured += u64::from(geometry.has_m() && !self.m_is_time);
        let CoordinateSequence { xy, z, m, .. } = geometry.coordinates();
        let texts = |text: &mut Vec<u8>| put_texts(feature, known, text);
        match geometry.kind() {
            GeometryType::Point if !xy.is_empty() => {
                let part = GeometryPart { xy, z, m, role: PartRole::Line };
                let mut pen = self.pen(GpxSection::Out);
                pen.begin(&part, 0, "wpt")?;
                texts(pen.text);
                pen.text.extend_from_slice(b"</wpt>\n");
            }
            GeometryType::LineString => {
                let mut pen = self.pen(GpxSection::Routes);
                pen.text.extend_from_slice(b"<rte>\n");
                texts(pen.text);
                geometry.own_parts().try_for_each(|part| pen.points(&part, "rtept"))?;
                pen.text.extend_from_slice(b"</rte>\n");
            }
            GeometryType::MultiLineString => {
                let mut pen = self.pen(GpxSection::Tracks);
                pen.text.extend_from_slice(b"<trk>\n");
                texts(pen.text);
                for part in geometry.own_parts() {
                    pen.text.extend_from_slice(b"<trkseg>\n");
                    pen.points(&part, "trkpt")?;
                    pen.text.extend_from_slice(b"</trkseg>\n");
                }
                pen.text.extend_from_slice(b"</trk>\n");
            }
            kind => {
                return Err(Error::usage(format!(
                    "GPX supports points and lines, not {}",
                    kind.name()
                ))
                .remedy("write GeoJSON or FlatGeobuf"));
            }
        }
        self.out.settle()?;
        self.routes.settle()?;
        self.tracks.settle()
    }

    fn pen(&mut self, target: GpxSection) -> GpxElementWriter<'_> {
        let text = match target {
            GpxSection::Out => &mut self.out.buffer,
            GpxSection::Routes => &mut self.routes.buffer,
            GpxSection::Tracks => &mut self.tracks.buffer,
        };
        GpxElementWriter { text, m_is_time: self.m_is_time }
    }
}

/// Section of the file for a feature.
enum GpxSection {
    Out,
    Routes,
    Tracks,
}

struct GpxElementWriter<'a> {
    text: &'a mut Vec<u8>,
    m_is_time: bool,
}

impl GpxElementWriter<'_> {
    fn points(&mut self, part: &GeometryPart<'_>, name: &str) -> Result<()> {
        for at in 0..part.xy.len() {
            self.begin(part, at, name)?;
            put_end(name, self.text);
        }
        Ok(())
    }

    /// Start of a point element with elevation and time.
    fn begin(&mut self, part: &GeometryPart<'_>, at: usize, name: &str) -> Result<()> {
        let [lon, lat] = part.xy[at];
        if !(-90.0..=90.0).contains(&lat) || !(-180.0..=180.0).contains(&lon) {
            let message =
                format!("vertex {at}: {lon}, {lat} is not a valid longitude and latitude");
            return Err(Error::usage(message).remedy("reproject the input to EPSG:4326 first"));
        }
        let text = &mut *self.text;
        text.push(b'<');
        text.extend_from_slice(name.as_bytes());
        for (name, value) in [(" lat=\"", lat), ("\" lon=\"", lon)] {
            text.extend_from_slice(name.as_bytes());
            decimal::push(value, text);
        }
        text.extend_from_slice(b"\">");
        if let Some(z) = part.z.get(at).filter(|z| !z.is_nan()) {
            text.extend_from_slice(b"<ele>");
            decimal::push(*z, text);
            text.extend_from_slice(b"</ele>");
        }
        let moment = part.m.get(at).filter(|m| self.m_is_time && !m.is_nan());
        if let Some(moment) = moment.and_then(|m| time::text(*m)) {
            put_element("time", moment.as_bytes(), text);
        }
        Ok(())
    }
}

fn put_texts(feature: &Feature, known: &[&str], text: &mut Vec<u8>) {
    for name in known {
        let mut value = Vec::new();
        push_text(feature.properties.get(name).unwrap_or(&PropertyValue::Null), &mut value);
        if !value.is_empty() {
            put_element(name, &value, text);
            text.push(b'\n');
        }
    }
}

fn put_element(name: &str, value: &[u8], text: &mut Vec<u8>) {
    text.push(b'<');
    text.extend_from_slice(name.as_bytes());
    text.push(b'>');
    for &byte in value {
        match byte {
            b'<' => text.extend_from_slice(b"&lt;"),
            b'>' => text.extend_from_slice(b"&gt;"),
            b'&' => text.extend_from_slice(b"&amp;"),
            // XML cannot contain other control characters.
            0..=8 | 11 | 12 | 14..=31 => text.push(b' '),
            byte => text.push(byte),
        }
    }
    text.extend_from_slice(b"</");
    text.extend_from_slice(name.as_bytes());
    text.push(b'>');
}

fn put_end(name: &str, text: &mut Vec<u8>) {
    text.extend_from_slice(b"</");
    text.extend_from_slice(name.as_bytes());
    text.extend_from_slice(b">\n");
}
