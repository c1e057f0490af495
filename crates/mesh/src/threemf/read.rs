//! Reading of 3MF with one mesh object, of any origin. The model is unpacked into an anonymous file in the system's
//! temporary folder.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use zip::ZipArchive;

use super::parts::{MODEL, NAME, PREFIX, RELATIONS};
use crate::input::{MeshFile, check_corners, check_range};
use crate::obj_index::{SparseIndex, TextLineMark};
use crate::relative_positions::{is_scale, to_world};
use crate::source::{MeshInfo, MeshSource};
use crate::xml::{MeshXmlReader, number};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point3;
use terrane_base::limits;
use terrane_files::xml::{XmlEvent, XmlStartTag};
use terrane_files::{RawFile, RawFileReader, nameless};

/// Maximum entries of an archive, and bytes of its relationships.
const MAX_ENTRIES: u64 = 4096;
const MAX_RELATION_BYTES: u64 = 1 << 20;
/// Relationship type of the model.
const MODEL_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/// Maximum number of comments kept.
const MAX_COMMENTS: usize = 64;

/// An open file, and its model.
pub(super) struct ThreeMfSource {
    input: MeshFile,
    vertices: SparseIndex,
    triangles: SparseIndex,
    info: MeshInfo,
}

/// Opens a file and scans its model once.
pub(super) fn open(path: &Path) -> Result<ThreeMfSource> {
    let input = unpacked(path).map_err(|e| e.in_file(path))?;
    let (mut vertices, mut triangles) = (SparseIndex::new(), SparseIndex::new());
    let mut summary = ThreeMfSummary::default();
    let mut xml = MeshXmlReader::new(&input, 0);
    loop {
        let at = xml.offset();
        let mark = TextLineMark { offset: at, ..TextLineMark::default() };
        let place = |e: Error| e.in_file(path).at(format!("byte {at} of the model"));
        match xml.next()? {
            XmlEvent::Over => break,
            XmlEvent::Start(tag) if tag.local_name() == "vertex" => vertices.note(mark),
            XmlEvent::Start(tag) if tag.local_name() == "triangle" => triangles.note(mark),
            XmlEvent::Start(tag) if tag.local_name() == "metadata" => {
                let name = tag.attribute("name").map_err(place)?;
                summary.record(name.unwrap_or_default(), xml.text()?);
            }
            XmlEvent::Start(tag) => summary.note(&tag).map_err(place)?,
            XmlEvent::Text(_) | XmlEvent::End => {}
        }
    }
    drop(xml);
    if summary.objects != 1 {
        let error =
            Error::unsupported(format!("expected one mesh object, found {}", summary.objects));
        return Err(error.in_file(path).remedy("use a file with one object"));
    }
    let info = summary.info(vertices.count(), triangles.count());
    Ok(ThreeMfSource { input, vertices, triangles, info })
}

fn damaged(e: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("damaged zip archive: {e}")).remedy("write or copy the file again")
}

/// The model of an archive.
fn unpacked(path: &Path) -> Result<MeshFile> {
    let file = RawFile::open(path)?;
    let mut archive = ZipArchive::new(BufReader::new(file.reader())).map_err(damaged)?;
    limits::check("number of files in the archive", archive.len() as u64, MAX_ENTRIES)?;
    let name = model_name(&mut archive)?;
    let mut entry = archive.by_name(&name).map_err(damaged)?;
    let declared = entry.size();
    limits::check("unpacked size of the model in bytes", declared, limits::MAX_UNPACKED_BYTES)?;
    let folder = std::env::temp_dir();
    let mut model = nameless(&folder)?;
    let copied = copy(&mut (&mut entry).take(declared + 1), &mut model, &folder)?;
    if copied != declared {
        return Err(damaged(format!("the unpacked size of the model is not {declared} bytes")));
    }
    model.seek(SeekFrom::Start(0)).map_err(|e| Error::read(&folder, e))?;
    MeshFile::of(model, path)
}

/// Copies a stream; read errors are those of the archive, write errors those of the disk.
fn copy(from: &mut impl Read, to: &mut File, folder: &Path) -> Result<u64> {
    let mut buffer = vec![0; 256 << 10];
    let mut copied = 0;
    loop {
        let count = from.read(&mut buffer).map_err(damaged)?;
        if count == 0 {
            return Ok(copied);
        }
        let written = io::Write::write_all(to, &buffer[..count]);
        written.map_err(|e| Error::write(folder, e))?;
        copied += count as u64;
    }
}

/// Path of the model, by the relationships of the archive.
fn model_name(archive: &mut ZipArchive<BufReader<RawFileReader<'_>>>) -> Result<String> {
    let mut text = Vec::new();
    {
        let entry = archive.by_name(RELATIONS).map_err(damaged)?;
        limits::check("size of the relationships in bytes", entry.size(), MAX_RELATION_BYTES)?;
        entry.take(MAX_RELATION_BYTES).read_to_end(&mut text).map_err(damaged)?;
    }
    let text = String::from_utf8_lossy(&text);
    let model =
        text.split('<').find(|tag| tag.starts_with("Relationship ") && tag.contains(MODEL_TYPE));
    let target = model.and_then(|tag| tag.split("Target=\"").nth(1)?.split('"').next());
    Ok(target.map_or(MODEL, |target| target.trim_start_matches('/')).to_owned())
}

/// Findings of the scan.
#[derive(Default)]
struct ThreeMfSummary {
    unit: Option<String>,
    is_solid: bool,
    /// Number of mesh objects.
    objects: u64,
    origin: Option<Point3>,
    scale: Option<Point3>,
    comments: Vec<String>,
    application: Option<String>,
}

impl ThreeMfSummary {
    fn note(&mut self, tag: &XmlStartTag) -> Result<()> {
        if tag.local_name() == "model" {
            // The default unit is the millimetre.
            self.unit = tag.attribute("unit")?.or_else(|| Some("millimeter".to_owned()));
        } else if tag.local_name() == "object" {
            let kind = tag.attribute("type")?;
            self.is_solid = kind.is_none_or(|kind| kind == "model" || kind == "solidsupport");
        } else if tag.local_name() == "mesh" {
            self.objects += 1;
        } else if tag.local_name() == "component" {
            return Err(Error::unsupported("components are not supported"));
        } else if tag.local_name() == "item" {
            self.check_item(tag)?;
        }
        Ok(())
    }

    fn check_item(&self, tag: &XmlStartTag) -> Result<()> {
        const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let Some(transform) = tag.attribute("transform")? else { return Ok(()) };
        let numbers = transform.split_ascii_whitespace().map(|word| word.parse().ok());
        match numbers.collect::<Option<Vec<f64>>>() {
            Some(numbers) if numbers == IDENTITY => Ok(()),
            _ => Err(Error::unsupported("transforms of build items are not supported")),
        }
    }

    fn record(&mut self, name: String, value: String) {
        if name == "Application" {
            self.application = Some(value);
            return;
        }
        match name.strip_prefix(PREFIX) {
            Some("origin") => self.origin = numbers(&value),
            Some("scale") => self.scale = numbers(&value).filter(is_scale),
            Some(_) if self.comments.len() < MAX_COMMENTS => self.comments.push(value),
            _ => {}
        }
    }

    fn info(self, vertices: u64, triangles: u64) -> MeshInfo {
        let application = self.application.map(|name| ("generator".to_owned(), name));
        let unit = self.unit.map(|unit| ("unit".to_owned(), unit));
        let info = MeshInfo {
            origin: self.origin.unwrap_or_default(),
            scale: self.scale.unwrap_or([1.0; 3]),
            single_precision: true,
            solid: self.origin.is_some() && self.is_solid,
            details: application.into_iter().chain(unit).collect(),
            ..MeshInfo::plain(NAME, vertices, triangles)
        };
        info.with_comments(self.comments)
    }
}

/// Three finite numbers.
fn numbers(text: &str) -> Option<Point3> {
    let words = text.split_ascii_whitespace().map(|word| word.parse().ok());
    let point: Point3 = words.collect::<Option<Vec<f64>>>()?.try_into().ok()?;
    point.iter().all(|c| c.is_finite()).then_some(point)
}

impl ThreeMfSource {
    /// Passes indexed start tags called `name` from `first`, with their indices, to `each` until it returns true.
    fn scan(
        &self,
        index: &SparseIndex,
        name: &str,
        first: u64,
        mut each: impl FnMut(u64, &XmlStartTag) -> Result<bool>,
    ) -> Result<()> {
        let (mut at, mark) = index.before(first);
        let mut xml = MeshXmlReader::new(&self.input, mark.offset);
        loop {
            match xml.next()? {
                XmlEvent::Over => {
                    let message = "the unpacked model changed while it was read";
                    return Err(Error::new(ErrorKind::Internal, message));
                }
                XmlEvent::Start(tag) if tag.local_name() == name => {
                    at += 1;
                    if at > first {
                        let is_enough = each(at - 1, &tag);
                        if is_enough.map_err(|e| e.in_file(self.input.path()))? {
                            return Ok(());
                        }
                    }
                }
                XmlEvent::Start(_) | XmlEvent::Text(_) | XmlEvent::End => {}
            }
        }
    }
}

impl MeshSource for ThreeMfSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(&self.vertices, "vertex", first, |index, tag| {
            let stored: [f32; 3] = [number(tag, "x")?, number(tag, "y")?, number(tag, "z")?];
            if !stored.iter().all(|c| c.is_finite()) {
                let error = Error::bad_input("position is not finite");
                return Err(error.at(format!("vertex {index}")));
            }
            *slot = to_world(stored.map(f64::from), self.info.origin, self.info.scale);
            Ok(slots.next().map(|next| slot = next).is_none())
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(&self.triangles, "triangle", first, |index, tag| {
            *slot = [number(tag, "v1")?, number(tag, "v2")?, number(tag, "v3")?];
            check_corners(index, slot, self.info.vertices)?;
            Ok(slots.next().map(|next| slot = next).is_none())
        })
    }
}
