//! Streaming reader; one waypoint, route or track is in memory at a time.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::time;
use crate::crs;
use crate::decimal;
use crate::feature::{Feature, FeatureProperties, LayerHeader, PropertyValue};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::window::FileWindow;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::xml::{XmlEvent, XmlReader, XmlStartTag};

/// Opens a file.
pub(super) fn open(path: &Path, _: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let xml = XmlReader::new(WindowStream(FileWindow::open(path)?));
    let layer = LayerHeader { crs: crs::wgs84(), m_is_time: true, ..LayerHeader::default() };
    let mut source = GpxSource { xml, layer, at: 0, left_out: 0, is_over: false };
    loop {
        match source.xml.next()? {
            XmlEvent::Start(tag) if tag.name() == "gpx" => return Ok(Box::new(source)),
            XmlEvent::Text(text) if text.trim().is_empty() => {}
            _ => return Err(Error::bad_input("is not GPX: the root element is not gpx")),
        }
    }
}

/// A window as a byte stream.
struct WindowStream(FileWindow);

impl Read for WindowStream {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = self.fill_buf()?;
        let count = bytes.len().min(out.len());
        out[..count].copy_from_slice(&bytes[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for WindowStream {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.0.text().is_empty() {
            self.0.more().map_err(io::Error::other)?;
        }
        Ok(self.0.text())
    }

    fn consume(&mut self, bytes: usize) {
        self.0.advance(bytes);
    }
}

struct GpxSource {
    xml: XmlReader<WindowStream>,
    layer: LayerHeader,
    /// Offset of the last feature.
    at: u64,
    /// Number of invalid times.
    left_out: u64,
    is_over: bool,
}

impl FeatureSource for GpxSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        while !self.is_over {
            self.at = self.xml.offset();
            match self.xml.next()? {
                XmlEvent::Text(_) => {}
                XmlEvent::End | XmlEvent::Over => self.is_over = true,
                XmlEvent::Start(tag) => match tag.name() {
                    "wpt" => return self.waypoint(&tag).map(Some),
                    "rte" => return self.line(GeometryType::LineString).map(Some),
                    "trk" => return self.line(GeometryType::MultiLineString).map(Some),
                    _ => self.xml.skip()?,
                },
            }
        }
        Ok(None)
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        format!("byte {}", self.at)
    }

    fn notes(&self) -> Vec<String> {
        let note = format!("{} invalid times omitted", self.left_out);
        (self.left_out > 0).then_some(note).into_iter().collect()
    }
}

impl GpxSource {
    fn waypoint(&mut self, tag: &XmlStartTag) -> Result<Feature> {
        let mut found = CoordinateSequence::default();
        let mut properties = FeatureProperties::default();
        self.point(tag, &mut found, Some(&mut properties))?;
        let geometry = Geometry::new(GeometryType::Point, found)?;
        Ok(Feature { properties, geometry, ..Feature::default() })
    }

    /// A route or track; its parts are segments.
    fn line(&mut self, kind: GeometryType) -> Result<Feature> {
        let mut found = CoordinateSequence::default();
        let mut properties = FeatureProperties::default();
        // Open elements: the line, and a segment in it.
        let mut open = 1;
        while open > 0 {
            match self.xml.next()? {
                XmlEvent::Text(_) => {}
                XmlEvent::End | XmlEvent::Over => {
                    found.end_part();
                    open -= 1;
                }
                XmlEvent::Start(tag) => match tag.name() {
                    "trkseg" if open == 1 => open += 1,
                    "trkpt" | "rtept" => self.point(&tag, &mut found, None)?,
                    _ => self.property(&tag, &mut properties)?,
                },
            }
        }
        if kind == GeometryType::LineString && found.ends.len() > 1 {
            return Err(self.bad("route with segments"));
        }
        let geometry = Geometry::new(kind, found)?;
        Ok(Feature { properties, geometry, ..Feature::default() })
    }

    fn degrees(&self, tag: &XmlStartTag, name: &str) -> Result<f64> {
        let value = tag.value(name)?.and_then(|text| decimal::whole(text.as_bytes()));
        let value = value.filter(|value| value.is_finite());
        value.ok_or_else(|| self.bad("point without numeric lat and lon"))
    }

    /// The content of a point element; child texts become properties if `properties` is given.
    fn point(
        &mut self,
        tag: &XmlStartTag,
        to: &mut CoordinateSequence,
        mut properties: Option<&mut FeatureProperties>,
    ) -> Result<()> {
        let at = [self.degrees(tag, "lon")?, self.degrees(tag, "lat")?];
        let (mut height, mut moment) = (None, None);
        loop {
            match self.xml.next()? {
                XmlEvent::Text(_) => {}
                XmlEvent::End | XmlEvent::Over => break,
                XmlEvent::Start(tag) => match (tag.name(), &mut properties) {
                    ("ele", _) => {
                        let text = self.text()?.unwrap_or_default();
                        let value = decimal::whole(text.as_bytes());
                        height = Some(value.ok_or_else(|| self.bad("elevation is not a number"))?);
                    }
                    ("time", _) => {
                        let text = self.text()?.unwrap_or_default();
                        moment = time::seconds(&text);
                        self.left_out += u64::from(moment.is_none());
                    }
                    (_, Some(properties)) => self.property(&tag, properties)?,
                    _ => self.xml.skip()?,
                },
            }
        }
        to.push(at, height, moment);
        Ok(())
    }

    /// The element `tag` as a property, if it contains only text.
    fn property(&mut self, tag: &XmlStartTag, properties: &mut FeatureProperties) -> Result<()> {
        if let Some(text) =
            self.text()?.filter(|text| !text.is_empty() && !tag.name().contains(':'))
        {
            let count = properties.0.len() as u64;
            limits::check("number of properties of a feature", count, limits::MAX_FIELDS)?;
            properties.push(tag.name(), PropertyValue::Text(text));
        }
        Ok(())
    }

    /// The text of the current element; `None` if it has child elements.
    fn text(&mut self) -> Result<Option<String>> {
        let (mut text, mut is_plain) = (String::new(), true);
        loop {
            match self.xml.next()? {
                XmlEvent::Text(more) => text += &more,
                XmlEvent::End | XmlEvent::Over => {
                    return Ok(is_plain.then(|| text.trim().to_owned()));
                }
                XmlEvent::Start(_) => {
                    is_plain = false;
                    self.xml.skip()?;
                }
            }
            limits::check("text length in bytes", text.len() as u64, limits::MAX_HEADER_BYTES)?;
        }
    }

    fn bad(&self, message: &str) -> Error {
        Error::bad_input(format!("byte {}: {message}", self.xml.offset()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RetainedVertices, VectorWriteOptions, by_path, create, open};

    const TRACK: &str = r#"<?xml version="1.0"?>
        <gpx version="1.1"><metadata><name>x</name></metadata>
        <trk><name>up &amp; down</name><extensions><g:a xmlns:g="u">7</g:a></extensions>
        <trkseg><trkpt lat="46.5" lon="7.5"><ele>1000.5</ele><time>2020-01-01T00:00:00Z</time></trkpt>
        <trkpt lat="46.6" lon="7.6"><ele>1001</ele><time>2020-01-01T00:00:01.500Z</time></trkpt>
        <trkpt lat="46.7" lon="7.7"><ele>1002</ele><time>2020-01-01T00:00:03Z</time></trkpt></trkseg>
        <trkseg><trkpt lat="1" lon="2"/><trkpt lat="3" lon="4"/></trkseg></trk>
        <wpt lat="5" lon="6"><sym>Flag</sym><link href="y"><text>t</text></link></wpt></gpx>"#;

    fn read(path: &Path) -> Result<(LayerHeader, Vec<Feature>)> {
        let mut source = open(path, &VectorOpenOptions::default())?;
        let layer = source.layer().clone();
        let features: Result<Vec<Feature>> =
            std::iter::from_fn(|| source.next().transpose()).collect();
        Ok((layer, features?))
    }

    #[test]
    fn times_stay_with_the_vertices_that_stay() {
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["a.gpx", "b.gpx"].map(|name| folder.path().join(name));
        std::fs::write(&from, TRACK).unwrap();
        let (layer, found) = read(&from).unwrap();
        assert_eq!(found[0].properties.get("name"), Some(&PropertyValue::Text("up & down".into())));
        assert_eq!(found[0].geometry.coordinates().ends, [3, 5]);
        assert_eq!(found[1].properties.get("sym"), Some(&PropertyValue::Text("Flag".into())));
        let options = VectorWriteOptions::default();
        let mut sink = create(&to, by_path(&to, None).unwrap(), &layer, &options).unwrap();
        for feature in found {
            let geometry = feature.geometry.keep(|part, _| match part {
                0 => RetainedVertices::Vertices(vec![0, 2]),
                _ => RetainedVertices::All,
            });
            sink.write(&Feature { geometry, ..feature }).unwrap();
        }
        assert!(sink.finish(&[]).unwrap().notes.is_empty());
        let text = std::fs::read_to_string(&to).unwrap();
        let last = "lat=\"46.7\" lon=\"7.7\"><ele>1002</ele><time>2020-01-01T00:00:03Z</time>";
        assert!(text.contains(last) && !text.contains("46.6"), "{text}");
        assert!(text.contains("<name>up &amp; down</name>") && text.contains("<sym>Flag</sym>"));
        let kept = read(&to).unwrap().1.swap_remove(1);
        let m = &kept.geometry.coordinates().m;
        assert!(m[1] - m[0] == 3.0 && m[2].is_nan());
    }

    #[test]
    fn damage_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpx");
        for (from, to, told) in [
            ("lat=\"46.5\"", "lat=\"x\"", "without numeric lat and lon"),
            ("lat=\"46.5\"", "", "without numeric lat and lon"),
            ("1000.5", "high", "elevation is not a number"),
            ("</gpx>", "", "inside an element"),
            ("<gpx ", "<!DOCTYPE a><gpx ", "document type"),
            ("&amp;", "&x;", "entity &x;"),
            ("</trkseg>", "</trk>", "well-formed"),
        ] {
            std::fs::write(&path, TRACK.replacen(from, to, 1)).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(told), "{to}: {error}");
        }
    }
}
