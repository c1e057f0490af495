//! 3MF for 3D printing: a zip archive with one object, f32 as text relative to a recorded origin, in metres or in
//! millimetres of the print. Optionally the surface is closed with walls and a bottom; every edge of such a solid has
//! two triangles.

mod parts;
mod read;
mod solid_walls;

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use self::parts::{CONTENT_TYPES, MODEL, NAME, PREFIX, RELATIONS, push_triangle, push_vertex};
use self::solid_walls::SolidWalls;
use crate::capacity::{self, MeshCapacity};
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::relative_positions::LocalCoordinates;
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::solid::{SolidBase, lowered};
use crate::text;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::xml::escaped;
use terrane_files::{AppendWriter, folder_for};

/// Vertex indices are below 2^31.
const CAPACITY: MeshCapacity = MeshCapacity::new([i32::MAX as u64, u64::MAX, u64::MAX], 16, 10);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: NAME,
    extensions: &["3mf"],
    about: "3D Manufacturing Format, f32 relative to a recorded origin; optionally closed to a solid",
    single_precision: true,
    carries: VertexCapabilities::Nothing,
    can_be_solid: true,
    states_unit: true,
    names_crs: true,
    admits: |_| Ok(()),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(read::open(path)?)),
    sniff: |head| head.starts_with(b"PK\x03\x04") && holds(head, CONTENT_TYPES.as_bytes()),
};

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
/// Namespace of the recorded metadata.
const OWN: &str = "urn:terrane:mesh";
/// Minimum bytes of a file in the archive that needs zip64.
const LARGE_BYTES: u64 = 1 << 31;

fn holds(head: &[u8], words: &[u8]) -> bool {
    head.windows(words.len()).any(|some| some == words)
}

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let local = LocalCoordinates::new(header.origin, header.scale)?;
    let folder = folder_for(path, options.temp_dir.as_deref());
    let base = options.solid_base.map(|height| SolidBase::new(height, header)).transpose()?;
    let walls = base.map(|base| SolidWalls::new(base, folder));
    let head = head(header, walls.is_some()).map_err(|e| e.in_file(path))?;
    FileSink::create(path, options, Encoder3mf { local, head, walls })
}

/// The unit of a file, by its name in 3MF.
fn unit(header: &MeshHeader) -> Result<&'static str> {
    let metres = header.crs.horizontal_metres().unwrap_or(1.0);
    match header.unit.as_deref() {
        Some("millimetre") => Ok("millimeter"),
        Some("metre") => Ok("meter"),
        None if metres == 1.0 => Ok("meter"),
        _ => Err(Error::unsupported("3MF does not support the unit of these coordinates")
            .remedy("write PLY or OBJ")),
    }
}

fn head(header: &MeshHeader, is_solid: bool) -> Result<String> {
    let mut recorded = metadata("origin", &text::point_text(header.origin));
    if header.scale != [1.0; 3] {
        recorded += &metadata("scale", &text::point_text(header.scale));
    }
    // Metadata names must be unique.
    for (place, comment) in text::comments(header).iter().enumerate() {
        recorded += &metadata(&format!("comment-{}", place + 1), comment);
    }
    let kind = if is_solid { "model" } else { "surface" };
    Ok(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <model unit=\"{}\" xml:lang=\"en-US\" xmlns=\"{CORE}\" xmlns:terrane=\"{OWN}\">\n\
         <metadata name=\"Application\">{}</metadata>\n{recorded}\
         <resources>\n<object id=\"1\" name=\"terrain\" type=\"{kind}\">\n<mesh>\n<vertices>\n",
        unit(header)?,
        text::generator(),
    ))
}

fn metadata(name: &str, value: &str) -> String {
    format!("<metadata name=\"{PREFIX}{name}\">{}</metadata>\n", escaped(value))
}

const BETWEEN: &[u8] = b"</vertices>\n<triangles>\n";
const END: &[u8] = b"</triangles>\n</mesh>\n</object>\n</resources>\n\
    <build>\n<item objectid=\"1\"/>\n</build>\n</model>\n";

struct Encoder3mf {
    local: LocalCoordinates,
    head: String,
    walls: Option<SolidWalls>,
}

impl MeshEncoder for Encoder3mf {
    fn name(&self) -> &'static str {
        NAME
    }

    /// A solid has each vertex twice.
    fn capacity(&self) -> MeshCapacity {
        let surface = CAPACITY;
        let copies = if self.walls.is_some() { 2 } else { 1 };
        MeshCapacity { vertices: surface.vertices / copies, ..surface }
    }

    fn header(&self, _counts: MeshCounts) -> Vec<u8> {
        self.head.clone().into_bytes()
    }

    fn wants_corners(&self) -> bool {
        self.walls.is_some()
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        let Self { local, walls, .. } = self;
        let base = walls.as_ref().map(SolidWalls::base);
        body.lines(batch.vertices, |point, text| {
            let position = local.place(point);
            push_vertex(position, text);
            // Each vertex of a solid is followed by its vertex at the bottom.
            base.into_iter().for_each(|base| push_vertex(lowered(position, base), text));
        })?;
        match walls {
            None => tail.lines(batch.triangles, |ids, text| push_triangle(*ids, text))?,
            Some(walls) => {
                walls.note_vertices(batch.vertices.len());
                for (ids, corners) in batch.triangles.iter().zip(batch.corners) {
                    let corners = corners.each_ref().map(|point| local.place(point));
                    tail.lines(&walls.push(*ids, corners)?, |ids, text| push_triangle(*ids, text))?;
                }
            }
        }
        self.local.check()
    }

    fn complete(&mut self, body: &mut AppendWriter, tail: &mut AppendWriter) -> Result<()> {
        if let Some(walls) = self.walls.take() {
            let vertices = walls.complete(body, tail)?;
            if vertices > CAPACITY.vertices {
                let limit = format!("{} vertices", CAPACITY.vertices);
                return Err(capacity::too_much(NAME, &limit, vertices, 0));
            }
        }
        body.write(BETWEEN)?;
        tail.write(END)
    }

    fn is_packed(&self) -> bool {
        true
    }

    fn pack(&self, whole: File, to: &File) -> Result<()> {
        pack(whole, to).map_err(|e| Error::new(ErrorKind::Io, format!("cannot write: {e}")))
    }
}

/// Packs a model into an archive. The timestamp is constant, so equal meshes make equal files.
fn pack(mut model: File, to: &File) -> io::Result<()> {
    const TYPES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
        <Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\n\
        <Default Extension=\"rels\" \
        ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\n\
        <Default Extension=\"model\" \
        ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>\n</Types>\n";
    const RELATED: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
        <Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">\n\
        <Relationship Target=\"/3D/3dmodel.model\" Id=\"rel0\" \
        Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>\n</Relationships>\n";
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(to);
    for (name, text) in [(CONTENT_TYPES, TYPES), (RELATIONS, RELATED)] {
        archive.start_file(name, options)?;
        archive.write_all(text.as_bytes())?;
    }
    archive.start_file(MODEL, options.large_file(model.metadata()?.len() >= LARGE_BYTES))?;
    io::copy(&mut model, &mut archive)?;
    archive.finish()?;
    Ok(())
}
