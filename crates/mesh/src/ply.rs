//! Binary PLY: vertices as `double x y z`, triangles as `list uchar uint vertex_indices`.

use std::path::Path;

use crate::capacity::MeshCapacity;
use crate::channels::{ChannelKind, VertexCapabilities, VertexChannel};
use crate::format::MeshFormat;
use crate::input::{MeshFile, check_corners, check_position, check_range};
use crate::ply_header::{self, PADDING, PlyElementSpan, PlyField, PlyHeader, PlyScalar};
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::source::{MeshInfo, MeshSource};
use crate::text::comments;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_files::AppendWriter;

/// Indices are u32.
const CAPACITY: MeshCapacity = MeshCapacity::new([1 << 32, u64::MAX, u64::MAX], 24, 13);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "PLY",
    extensions: &["ply"],
    about: "binary little-endian PLY, f64 coordinates",
    single_precision: false,
    carries: VertexCapabilities::All,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |_| Ok(()),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(PlySource::open(path)?)),
    sniff: |head| head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n"),
};

const VERTEX_BYTES: usize = 24;
const FACE_BYTES: usize = 13;

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let channels = header.channels.clone();
    FileSink::create(path, options, PlyEncoder { comments: comments(header), channels })
}

struct PlyEncoder {
    comments: Vec<String>,
    channels: Vec<VertexChannel>,
}

/// Header line of a channel.
fn property(VertexChannel { name, kind }: &VertexChannel) -> String {
    let scalar = match kind {
        ChannelKind::Byte => "uchar",
        ChannelKind::Single => "float",
        ChannelKind::Double => "double",
    };
    format!("property {scalar} {name}\n")
}

impl PlyEncoder {
    fn text(&self, counts: MeshCounts, padding: &str) -> String {
        let comments: String = self.comments.iter().map(|c| format!("comment {c}\n")).collect();
        let channels: String = self.channels.iter().map(property).collect();
        let MeshCounts { vertices, triangles } = counts;
        format!(
            "ply\nformat binary_little_endian 1.0\n{comments}comment {PADDING} {padding}\n\
             element vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n{channels}\
             element face {triangles}\nproperty list uchar uint vertex_indices\nend_header\n"
        )
    }
}

impl MeshEncoder for PlyEncoder {
    fn name(&self) -> &'static str {
        FORMAT.name
    }

    fn capacity(&self) -> MeshCapacity {
        CAPACITY
    }

    fn channels(&self) -> &[VertexChannel] {
        &self.channels
    }

    /// The header, padded by a comment to a constant length.
    fn header(&self, counts: MeshCounts) -> Vec<u8> {
        let largest = MeshCounts { vertices: u64::MAX, triangles: u64::MAX };
        let padding = self.text(largest, "").len() - self.text(counts, "").len();
        self.text(counts, &".".repeat(padding)).into_bytes()
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        if self.channels.is_empty() {
            body.records(batch.vertices, vertex_record)?;
        } else {
            let mut values = batch.values.iter();
            body.lines(batch.vertices, |point, record| {
                record.extend(vertex_record(point));
                let channels = self.channels.iter().zip(&mut values);
                channels.for_each(|(channel, &value)| push(channel.kind, value, record));
            })?;
        }
        tail.records(batch.triangles, face_record)
    }
}

fn vertex_record(point: &Point3) -> [u8; VERTEX_BYTES] {
    let mut bytes = [0; VERTEX_BYTES];
    let (slots, _) = bytes.as_chunks_mut::<8>();
    for (slot, value) in slots.iter_mut().zip(point) {
        *slot = value.to_le_bytes();
    }
    bytes
}

/// Appends a value; the sink has checked that its type can store it.
fn push(kind: ChannelKind, value: f64, record: &mut Vec<u8>) {
    match kind {
        ChannelKind::Byte => record.push(value as u8),
        ChannelKind::Single => record.extend((value as f32).to_le_bytes()),
        ChannelKind::Double => record.extend(value.to_le_bytes()),
    }
}

/// The record of a triangle; the sink has checked that ids are below 2^32.
fn face_record(ids: &[u64; 3]) -> [u8; FACE_BYTES] {
    let mut bytes = [3; FACE_BYTES];
    let (slots, _) = bytes[1..].as_chunks_mut::<4>();
    for (slot, &id) in slots.iter_mut().zip(ids) {
        *slot = (id as u32).to_le_bytes();
    }
    bytes
}

/// An open PLY file.
struct PlySource {
    input: MeshFile,
    header: PlyHeader,
    info: MeshInfo,
}

impl PlySource {
    fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        let header = ply_header::read(&input).map_err(|e| e.in_file(path))?;
        let order = if header.big { "big" } else { "little" };
        let encoding = ("encoding".to_owned(), format!("binary {order}-endian"));
        let info = MeshInfo {
            single_precision: header.xyz.iter().any(|field| field.scalar == PlyScalar::F32),
            details: vec![encoding],
            channels: header.channels.iter().map(|(name, _)| name.clone()).collect(),
            ..MeshInfo::plain(FORMAT.name, header.vertices.count, header.faces.count)
        };
        let info = info.with_comments(header.comments.iter().cloned());
        Ok(Self { input, header, info })
    }

    /// Passes the records `first .. first + count` of a span to `each`.
    fn records(
        &self,
        span: PlyElementSpan,
        first: u64,
        count: usize,
        each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let start = span.offset + first * span.stride;
        self.input.records(start..start + count as u64 * span.stride, span.stride, each)
    }

    fn is_native_vertex(&self) -> bool {
        let offsets = self.header.xyz.map(|field| (field.scalar, field.offset));
        !self.header.big
            && offsets == [(PlyScalar::F64, 0), (PlyScalar::F64, 8), (PlyScalar::F64, 16)]
    }

    fn position(&self, record: &[u8]) -> Point3 {
        self.header.xyz.map(|field| self.number(record, field))
    }

    /// A number of a record; NaN beyond its end.
    fn number(&self, record: &[u8], PlyField { offset, scalar }: PlyField) -> f64 {
        scalar.read(record.get(offset as usize..).unwrap_or_default(), self.header.big)
    }

    fn is_native_face(&self) -> bool {
        let PlyHeader { big, faces, length, item, .. } = &self.header;
        let types = (length.scalar, item.scalar);
        !big && faces.stride == FACE_BYTES as u64 && types == (PlyScalar::U8, PlyScalar::U32)
    }

    /// The vertex ids of triangle `index`.
    fn corners(&self, index: u64, record: &[u8]) -> Result<[u64; 3]> {
        let PlyHeader { length, item, .. } = self.header;
        check_length(index, self.number(record, length))?;
        let ids = [0, 1, 2].map(|i| {
            let offset = item.offset + i * item.scalar.bytes();
            self.number(record, PlyField { offset, ..item })
        });
        match ids.iter().find(|id| **id < 0.0) {
            None => Ok(ids.map(|id| id as u64)),
            Some(id) => Err(Error::bad_input(format!("vertex index {id} is negative"))
                .at(format!("triangle {index}"))),
        }
    }
}

fn check_length(index: u64, length: f64) -> Result<()> {
    if length == 3.0 {
        return Ok(());
    }
    Err(Error::unsupported(format!("has {length} corners"))
        .at(format!("face {index}"))
        .remedy("triangulate the mesh first"))
}

/// The position in a record that begins with three little-endian f64.
fn native_position(record: &[u8]) -> Option<Point3> {
    let (values, _) = record.as_chunks::<8>();
    let &[x, y, z] = values.first_chunk::<3>()?;
    Some([x, y, z].map(f64::from_le_bytes))
}

/// The ids of a record in the layout that this program writes, if it is a triangle.
fn native_corners(record: &[u8]) -> Option<[u64; 3]> {
    let (values, _) = record.strip_prefix(&[3])?.as_chunks::<4>();
    let &[a, b, c] = values.first_chunk::<3>()?;
    Some([a, b, c].map(|id| u32::from_le_bytes(id).into()))
}

impl MeshSource for PlySource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let native = self.is_native_vertex();
        self.records(self.header.vertices, first, out.len(), |place, record| {
            let point = native.then(|| native_position(record)).flatten();
            let point = point.unwrap_or_else(|| self.position(record));
            check_position(first + place as u64, &point)?;
            out[place] = point;
            Ok(())
        })
    }

    fn read_channels(&self, first: u64, out: &mut [f64]) -> Result<()> {
        let channels = &self.header.channels;
        let vertices = out.len() / channels.len().max(1);
        check_range("vertices", first, vertices, self.info.vertices)?;
        self.records(self.header.vertices, first, vertices, |place, record| {
            let values = out[place * channels.len()..].iter_mut();
            for (value, (_, field)) in values.zip(channels) {
                let bytes = record.get(field.offset as usize..).unwrap_or_default();
                *value = field.scalar.read(bytes, self.header.big);
            }
            Ok(())
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        let native = self.is_native_face();
        self.records(self.header.faces, first, out.len(), |place, record| {
            let index = first + place as u64;
            let corners = match native.then(|| native_corners(record)).flatten() {
                Some(corners) => corners,
                None => self.corners(index, record)?,
            };
            check_corners(index, &corners, self.info.vertices)?;
            out[place] = corners;
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_keeps_its_length() {
        let comments = vec!["crs EPSG:4326".to_owned()];
        let encoder = PlyEncoder { comments, channels: Vec::new() };
        let length = encoder.header(MeshCounts::default()).len();
        for n in [1, 12_345, u64::MAX] {
            let header = encoder.header(MeshCounts { vertices: n, triangles: n / 2 });
            assert_eq!(header.len(), length);
            assert!(String::from_utf8(header).unwrap().contains(&format!("vertex {n}\n")));
        }
    }
}
