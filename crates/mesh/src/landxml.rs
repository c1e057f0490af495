//! LandXML 1.2: one surface, a TIN of points (northing, easting, elevation) and faces, in f64. All three coordinates
//! have the same unit. The dates that the schema requires are constant, so equal meshes make equal files.

use std::path::Path;

use crate::capacity::MeshCapacity;
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::input::{MeshFile, check_range};
use crate::length_unit;
use crate::obj_index::{SparseIndex, TextLineMark};
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::source::{MeshInfo, MeshSource};
use crate::text::{self, push_f64, push_u64};
use crate::xml::{MeshXmlReader, number};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point3};
use terrane_base::limits;
use terrane_files::AppendWriter;
use terrane_files::xml::{XmlEvent, XmlStartTag, escaped};

/// Text has no capacity limit; the bytes are typical values.
const CAPACITY: MeshCapacity = MeshCapacity::new([u64::MAX - 1, u64::MAX, u64::MAX], 52, 32);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "LandXML",
    extensions: &["xml", "landxml"],
    about: "LandXML 1.2, a surface of points and faces, f64 as text",
    single_precision: false,
    carries: VertexCapabilities::Nothing,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |crs| unit(crs).map(drop),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(LandXmlSource::open(path)?)),
    sniff: |head| head.windows(8).any(|some| some == b"<LandXML"),
};

/// A length unit, and its system of units.
struct LandXmlUnit {
    name: &'static str,
    metres: f64,
    system: &'static str,
}

const UNITS: [LandXmlUnit; 3] = [
    LandXmlUnit { name: "meter", metres: 1.0, system: METRIC },
    LandXmlUnit { name: "foot", metres: 0.3048, system: IMPERIAL },
    LandXmlUnit { name: "USSurveyFoot", metres: 1200.0 / 3937.0, system: IMPERIAL },
];
const METRIC: &str = "Metric areaUnit=\"squareMeter\" volumeUnit=\"cubicMeter\" \
    temperatureUnit=\"celsius\" pressureUnit=\"milliBars\"";
const IMPERIAL: &str = "Imperial areaUnit=\"squareFoot\" volumeUnit=\"cubicFeet\" \
    temperatureUnit=\"fahrenheit\" pressureUnit=\"inchHG\"";

/// The XML element of the unit of a CRS; metres if unknown.
fn unit(crs: &Crs) -> Result<String> {
    let across = crs.horizontal_metres();
    if across.is_none() && crs.horizontal_unit() == "degree" {
        return Err(refused_units("x and y are in degrees"));
    }
    let metres = across.unwrap_or(1.0);
    if let Some(up) = crs.vertical_metres().filter(|up| !length_unit::is_same(*up, metres)) {
        let why = format!("the horizontal unit is {metres} m, the vertical unit {up} m");
        return Err(refused_units(&why));
    }
    let unit = UNITS.iter().find(|unit| length_unit::is_same(unit.metres, metres));
    let LandXmlUnit { name, system, .. } =
        unit.ok_or_else(|| refused_units(&format!("no LandXML unit is {metres} m long")))?;
    Ok(format!("<{system} linearUnit=\"{name}\"/>"))
}

fn refused_units(why: &str) -> Error {
    Error::unsupported(format!("LandXML requires one length unit for x, y and z: {why}"))
        .remedy("write PLY or OBJ, or reproject the data")
}

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let unit = unit(&header.crs).map_err(|e| e.in_file(path))?;
    FileSink::create(path, options, LandXmlEncoder { head: head(header, &unit), vertices: 0 })
}

fn head(header: &MeshHeader, unit: &str) -> String {
    const SPACE: &str = "http://www.landxml.org/schema/LandXML-1.2";
    let comments = text::signed(&header.promises);
    let properties = comments
        .iter()
        .map(|text| format!("<Property label=\"comment\" value=\"{}\"/>\n", escaped(text)));
    let wkt = header.crs.to_wkt().map(|text| format!(" ogcWktCode=\"{}\"", escaped(&text)));
    let code = header.crs.epsg.map(|code| format!(" epsgCode=\"{code}\""));
    let system = (!header.crs.is_unknown()).then(|| {
        format!(
            "<CoordinateSystem desc=\"{}\"{}{}/>\n",
            escaped(&header.crs.label()),
            code.unwrap_or_default(),
            wkt.unwrap_or_default(),
        )
    });
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <LandXML xmlns=\"{SPACE}\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"{SPACE} {SPACE}/LandXML-1.2.xsd\" version=\"1.2\" \
         date=\"1970-01-01\" time=\"00:00:00\" readOnly=\"false\" language=\"English\">\n\
         <Units>{unit}</Units>\n{}\
         <Project name=\"terrain\">\n<Feature code=\"terrane\">\n{}</Feature>\n</Project>\n\
         <Application name=\"terrane\" version=\"{}\"/>\n\
         <Surfaces>\n<Surface name=\"terrain\">\n<Definition surfType=\"TIN\">\n<Pnts>\n",
        system.unwrap_or_default(),
        properties.collect::<String>(),
        env!("CARGO_PKG_VERSION"),
    )
}

const BETWEEN: &[u8] = b"</Pnts>\n<Faces>\n";
const END: &[u8] = b"</Faces>\n</Definition>\n</Surface>\n</Surfaces>\n</LandXML>\n";

struct LandXmlEncoder {
    head: String,
    vertices: u64,
}

impl MeshEncoder for LandXmlEncoder {
    fn name(&self) -> &'static str {
        FORMAT.name
    }

    fn capacity(&self) -> MeshCapacity {
        CAPACITY
    }

    fn header(&self, _counts: MeshCounts) -> Vec<u8> {
        self.head.clone().into_bytes()
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        body.lines(batch.vertices, |&[x, y, z], line| {
            self.vertices += 1;
            line.extend_from_slice(b"<P id=\"");
            push_u64(self.vertices, line);
            line.extend_from_slice(b"\">");
            push_words(&[y, x, z], line, push_f64);
            line.extend_from_slice(b"</P>\n");
        })?;
        tail.lines(batch.triangles, |ids, line| {
            line.extend_from_slice(b"<F>");
            push_words(&ids.map(|id| id + 1), line, push_u64);
            line.extend_from_slice(b"</F>\n");
        })
    }

    fn complete(&mut self, body: &mut AppendWriter, tail: &mut AppendWriter) -> Result<()> {
        body.write(BETWEEN)?;
        tail.write(END)
    }
}

fn push_words<T: Copy>(values: &[T; 3], line: &mut Vec<u8>, push: impl Fn(T, &mut Vec<u8>)) {
    for (place, &value) in values.iter().enumerate() {
        line.extend((place > 0).then_some(b' '));
        push(value, line);
    }
}

/// Maximum runs of consecutive point ids.
const MAX_RUNS: u64 = 1 << 20;
/// Maximum number of comments kept, and bytes of each.
const MAX_COMMENTS: usize = 64;

/// Point ids as runs of consecutive numbers, sorted at the end.
#[derive(Debug, Default)]
struct LandXmlPointIds {
    runs: Vec<LandXmlPointIdRun>,
    points: u64,
}

#[derive(Clone, Copy, Debug)]
struct LandXmlPointIdRun {
    /// Id of the first point.
    number: u64,
    /// Index of the first point in the file.
    first: u64,
    points: u64,
}

impl LandXmlPointIds {
    fn push(&mut self, number: u64) -> Result<()> {
        let first = self.points;
        self.points += 1;
        match self.runs.last_mut() {
            Some(run) if run.number.checked_add(run.points) == Some(number) => run.points += 1,
            _ => self.runs.push(LandXmlPointIdRun { number, first, points: 1 }),
        }
        limits::check("number of runs of point ids", self.runs.len() as u64, MAX_RUNS)
    }

    /// Sorts the runs. Fails if two points have the same id.
    fn complete(&mut self) -> Result<()> {
        self.runs.sort_unstable_by_key(|run| run.number);
        let twice =
            self.runs.windows(2).find(|pair| pair[1].number - pair[0].number < pair[0].points);
        match twice {
            None => Ok(()),
            Some(pair) => {
                let number = pair[1].number;
                Err(Error::bad_input(format!("two points have the id {number}")))
            }
        }
    }

    /// Index of the point with this id.
    fn place(&self, number: u64) -> Option<u64> {
        let after = self.runs.partition_point(|run| run.number <= number);
        let run = self.runs.get(after.checked_sub(1)?)?;
        let along = number - run.number;
        (along < run.points).then_some(run.first + along)
    }
}

/// An open file.
struct LandXmlSource {
    input: MeshFile,
    points: SparseIndex,
    faces: SparseIndex,
    numbers: LandXmlPointIds,
    info: MeshInfo,
}

/// Findings of the scan.
#[derive(Default)]
struct LandXmlSummary {
    surfaces: u64,
    is_landxml: bool,
    crs: Option<String>,
    systems: Vec<String>,
    unit: Option<String>,
    comments: Vec<String>,
}

impl LandXmlSource {
    /// Scans the whole file once.
    fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        let (mut points, mut faces) = (SparseIndex::new(), SparseIndex::new());
        let (mut numbers, mut summary) = (LandXmlPointIds::default(), LandXmlSummary::default());
        let mut xml = MeshXmlReader::new(&input, 0);
        loop {
            let at = xml.offset();
            let mark = TextLineMark { offset: at, ..TextLineMark::default() };
            let place = |e: Error| e.in_file(path).at(format!("byte {at}"));
            match xml.next()? {
                XmlEvent::Over => break,
                XmlEvent::Start(tag) if tag.local_name() == "P" && summary.surfaces > 0 => {
                    numbers.push(number(&tag, "id").map_err(place)?).map_err(place)?;
                    points.note(mark);
                }
                XmlEvent::Start(tag) if tag.local_name() == "F" && summary.surfaces > 0 => {
                    // Faces of other programs may be invisible.
                    if tag.attribute("i").map_err(place)?.is_none_or(|hidden| hidden != "1") {
                        faces.note(mark);
                    }
                }
                XmlEvent::Start(tag) => summary.note(&tag).map_err(place)?,
                XmlEvent::Text(_) | XmlEvent::End => {}
            }
        }
        numbers.complete().map_err(|e| e.in_file(path))?;
        if !summary.is_landxml || summary.surfaces != 1 {
            let count = summary.surfaces;
            let error = Error::unsupported(format!("expected one TIN surface, found {count}"));
            return Err(error.in_file(path).remedy("use a LandXML file with one surface"));
        }
        let info = summary.info(points.count(), faces.count());
        drop(xml);
        Ok(Self { input, points, faces, numbers, info })
    }
}

impl LandXmlSummary {
    fn note(&mut self, tag: &XmlStartTag) -> Result<()> {
        if tag.local_name() == "LandXML" {
            self.is_landxml = true;
        } else if tag.local_name() == "Definition" {
            self.surfaces += 1;
            let kind = tag.attribute("surfType")?.unwrap_or_default();
            if kind != "TIN" {
                return Err(Error::unsupported(format!(
                    "the surface type {kind:?} is not supported"
                )));
            }
        } else if tag.local_name() == "Metric" || tag.local_name() == "Imperial" {
            self.unit = tag.attribute("linearUnit")?;
        } else if tag.local_name() == "CoordinateSystem" {
            let code = tag.attribute("epsgCode")?.map(|code| format!("EPSG:{code}"));
            self.crs = tag.attribute("desc")?.or(code.clone()).or(tag.attribute("name")?);
            self.systems.extend(code.into_iter().chain(tag.attribute("ogcWktCode")?));
        } else if tag.local_name() == "Property"
            && self.comments.len() < MAX_COMMENTS
            && tag.attribute("label")?.as_deref() == Some("comment")
        {
            self.comments.extend(tag.attribute("value")?);
        }
        Ok(())
    }

    fn info(self, points: u64, faces: u64) -> MeshInfo {
        let details = self.unit.map(|unit| ("unit".to_owned(), unit)).into_iter().collect();
        let (crs, systems) = (self.crs, self.systems);
        let plain = MeshInfo::plain(FORMAT.name, points, faces);
        MeshInfo { crs, systems, details, ..plain }.with_comments(self.comments)
    }
}

impl LandXmlSource {
    /// Passes indexed elements called `name` from `first` to `each`, until it returns true.
    fn scan(
        &self,
        index: &SparseIndex,
        name: &str,
        first: u64,
        mut each: impl FnMut(&mut MeshXmlReader<'_>) -> Result<bool>,
    ) -> Result<()> {
        let (mut at, mark) = index.before(first);
        let mut xml = MeshXmlReader::new(&self.input, mark.offset);
        loop {
            match xml.next()? {
                XmlEvent::Over => {
                    return Err(self.input.bad("changed while it was read"));
                }
                XmlEvent::Start(tag) if tag.local_name() == name => {
                    if tag.attribute("i")?.is_some_and(|hidden| hidden == "1") {
                        continue;
                    }
                    at += 1;
                    if at > first && each(&mut xml)? {
                        return Ok(());
                    }
                }
                XmlEvent::Start(_) | XmlEvent::Text(_) | XmlEvent::End => {}
            }
        }
    }
}

impl MeshSource for LandXmlSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(&self.points, "P", first, |xml| {
            let [y, x, z] = xml.three::<f64>("a point")?;
            *slot = [x, y, z];
            if !slot.iter().all(|c| c.is_finite()) {
                return Err(xml.bad("position is not finite"));
            }
            Ok(slots.next().map(|next| slot = next).is_none())
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(&self.faces, "F", first, |xml| {
            for (id, number) in slot.iter_mut().zip(xml.three::<u64>("a face")?) {
                let place = self.numbers.place(number);
                *id = place.ok_or_else(|| xml.bad(format!("point {number} does not exist")))?;
            }
            Ok(slots.next().map(|next| slot = next).is_none())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn units_that_cannot_be_said_are_refused() {
        let crs = |epsg: u32, up: &str| Crs {
            epsg: Some(epsg),
            vertical_unit: (!up.is_empty()).then(|| up.to_owned()),
            ..Crs::default()
        };
        assert!(unit(&crs(32611, "metre")).unwrap().contains("\"meter\""));
        assert!(unit(&Crs::default()).unwrap().contains("\"meter\""));
        assert!(unit(&crs(2263, "")).unwrap().contains("\"USSurveyFoot\""));
        for (crs, why) in
            [(crs(4326, ""), "in degrees"), (crs(32611, "foot"), "vertical unit 0.3048 m")]
        {
            let error = unit(&crs).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }

    proptest! {
        /// Beside a list of all.
        #[test]
        fn numbers_are_found_again(numbers in prop::collection::vec(0_u64..60, 0..50)) {
            let mut runs = LandXmlPointIds::default();
            numbers.iter().for_each(|number| runs.push(*number).unwrap());
            let mut sorted = numbers.clone();
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(runs.complete().is_ok(), sorted.len() == numbers.len());
            if sorted.len() == numbers.len() {
                for number in 0..70 {
                    let place = numbers.iter().position(|known| *known == number);
                    prop_assert_eq!(runs.place(number), place.map(|place| place as u64));
                }
            }
        }
    }
}
