//! Writing. Waypoints come first, then routes, then tracks, so the latter wait.

use std::path::{Path, PathBuf};

use super::time;
use crate::crs;
use crate::feature::{Feature, Layer, Member, Value};
use crate::geometry::{Coordinates, Kind, Part, Role};
use crate::number;
use crate::out::Out;
use crate::sink::{FeatureSink, WriteOptions, Written};
use crate::table::push_text;
use terrane_base::error::{Error, Result};
use terrane_files::{self as files, folder_for};

/// Elements of text that a waypoint may have, in the order of the schema.
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
/// Those of a route or track.
pub(super) const LINE_TEXTS: &[&str] = &["name", "cmt", "desc", "src", "number", "type"];

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &Layer,
    options: &WriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    if !crs::is_wgs84(&layer.crs) && layer.crs.geographic != Some(true) {
        let message = format!("GPX is in longitude and latitude, not in {}", layer.crs.label());
        return Err(Error::usage(message)
            .in_file(path)
            .remedy("reproject the input first: ogr2ogr -t_srs EPSG:4326"));
    }
    let mut notes = Vec::new();
    if !crs::is_wgs84(&layer.crs) {
        notes.push(format!("coordinates are in {}, and GPX means WGS 84", layer.crs.label()));
    }
    let mut out = Out::create(path, options.overwrite)?;
    out.buffer.extend_from_slice(HEAD.as_bytes());
    let folder = folder_for(path, options.temp_dir.as_deref());
    Ok(Box::new(Sink {
        out,
        routes: files::Out::spool(folder)?,
        tracks: files::Out::spool(folder)?,
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

struct Sink {
    out: Out,
    routes: files::Out,
    tracks: files::Out,
    m_is_time: bool,
    features: u64,
    /// Features with measures that are no times.
    measured: u64,
    /// Features with an id, or a property that has no place.
    with_more: u64,
    notes: Vec<String>,
    path: PathBuf,
}

impl FeatureSink for Sink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        self.features += 1;
        let place = format!("feature {}", self.features);
        self.put(feature).map_err(|e| e.at(place).in_file(&self.path))
    }

    fn finish(mut self: Box<Self>, _: &[Member]) -> Result<Written> {
        self.out.append(self.routes)?;
        self.out.append(self.tracks)?;
        self.out.buffer.extend_from_slice(b"</gpx>\n");
        let mut notes = self.notes;
        if self.measured > 0 {
            let count = self.measured;
            notes.push(format!("measures (m) of {count} features are left out: they are no times"));
        }
        if self.with_more > 0 {
            let count = self.with_more;
            notes.push(format!(
                "ids and properties without a place in GPX are left out, of {count} features"
            ));
        }
        let (path, bytes) = self.out.commit()?;
        Ok(Written { features: self.features, bytes, files: vec![path], notes })
    }
}

impl Sink {
    fn put(&mut self, feature: &Feature) -> Result<()> {
        let geometry = &feature.geometry;
        let known = if geometry.kind() == Kind::Point { POINT_TEXTS } else { LINE_TEXTS };
        let lost = feature
            .properties
            .iter()
            .any(|(name, value)| *value != Value::Null && !known.contains(&&**name));
        self.with_more += u64::from(lost || feature.id.is_some());
        self.measured += u64::from(geometry.has_m() && !self.m_is_time);
        let Coordinates { xy, z, m, .. } = geometry.coordinates();
        let texts = |text: &mut Vec<u8>| put_texts(feature, known, text);
        match geometry.kind() {
            Kind::Point if !xy.is_empty() => {
                let part = Part { xy, z, m, role: Role::Line };
                let mut pen = self.pen(Target::Out);
                pen.begin(&part, 0, "wpt")?;
                texts(pen.text);
                pen.text.extend_from_slice(b"</wpt>\n");
            }
            Kind::LineString => {
                let mut pen = self.pen(Target::Routes);
                pen.text.extend_from_slice(b"<rte>\n");
                texts(pen.text);
                geometry.own_parts().try_for_each(|part| pen.points(&part, "rtept"))?;
                pen.text.extend_from_slice(b"</rte>\n");
            }
            Kind::MultiLineString => {
                let mut pen = self.pen(Target::Tracks);
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
                    "GPX holds points and lines, no {}",
                    kind.name()
                ))
                .remedy("write GeoJSON or FlatGeobuf"));
            }
        }
        self.out.settle()?;
        self.routes.settle()?;
        self.tracks.settle()
    }

    fn pen(&mut self, target: Target) -> Pen<'_> {
        let text = match target {
            Target::Out => &mut self.out.buffer,
            Target::Routes => &mut self.routes.buffer,
            Target::Tracks => &mut self.tracks.buffer,
        };
        Pen { text, m_is_time: self.m_is_time }
    }
}

/// Where a feature goes.
enum Target {
    Out,
    Routes,
    Tracks,
}

struct Pen<'a> {
    text: &'a mut Vec<u8>,
    m_is_time: bool,
}

impl Pen<'_> {
    fn points(&mut self, part: &Part<'_>, name: &str) -> Result<()> {
        for at in 0..part.xy.len() {
            self.begin(part, at, name)?;
            put_end(name, self.text);
        }
        Ok(())
    }

    /// The start of a point, its elevation and its time.
    fn begin(&mut self, part: &Part<'_>, at: usize, name: &str) -> Result<()> {
        let [lon, lat] = part.xy[at];
        if !(-90.0..=90.0).contains(&lat) || !(-180.0..=180.0).contains(&lon) {
            let message = format!("vertex {at}: {lon}, {lat} is no longitude and latitude");
            return Err(Error::usage(message).remedy("reproject the input to EPSG:4326 first"));
        }
        let text = &mut *self.text;
        text.push(b'<');
        text.extend_from_slice(name.as_bytes());
        for (name, value) in [(" lat=\"", lat), ("\" lon=\"", lon)] {
            text.extend_from_slice(name.as_bytes());
            number::push(value, text);
        }
        text.extend_from_slice(b"\">");
        if let Some(z) = part.z.get(at).filter(|z| !z.is_nan()) {
            text.extend_from_slice(b"<ele>");
            number::push(*z, text);
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
        push_text(feature.properties.get(name).unwrap_or(&Value::Null), &mut value);
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
            // Other control characters cannot be in XML at all.
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
