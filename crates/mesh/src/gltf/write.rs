//! Writing of binary glTF: positions and triangles, plain or compressed.

use std::path::Path;

use serde_json::{Value, json};

use super::layout::{
    BIN_CHUNK, FLOAT, GltfCompression, JSON_CHUNK, MAGIC, NAME, PACKED_NAME, POINTS, TRIANGLES,
    UNSIGNED_INT, VERSION, to_y_up,
};
use super::meshopt;
use super::packer::{MeshoptPacker, MeshoptSizes};
use crate::capacity::{self, MeshCapacity};
use crate::channels::{VertexCapabilities, VertexChannel, linear, opacity};
use crate::relative_positions::LocalCoordinates;
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::text;
use terrane_base::error::Result;
use terrane_base::geom::Point3;
use terrane_files::{AppendWriter, folder_for};

/// The file length is a u32, and so is the uncompressed size.
pub(super) const CAPACITY: MeshCapacity = MeshCapacity::new([u32::MAX as u64; 3], 12, 12);

const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

const VERTEX_BYTES: usize = 12;
const TRIANGLE_BYTES: usize = 12;
/// The file's header and the headers of both chunks.
const FRAME_BYTES: u64 = 12 + 8 + 8;

pub(super) fn create(
    path: &Path,
    header: &MeshHeader,
    options: &SinkOptions,
    packing: GltfCompression,
) -> Result<Box<dyn MeshSink>> {
    let local = LocalCoordinates::new(header.origin, header.scale)?;
    let crs = (!header.crs.is_unknown()).then(|| header.crs.label());
    let comments = header.promises.to_lines();
    capacity::check_channels(NAME, VertexCapabilities::Colours, &header.channels)?;
    let (channels, light) = (header.channels.clone(), linear());
    let spool = folder_for(path, options.temp_dir.as_deref());
    let packer = match packing {
        GltfCompression::None => None,
        GltfCompression::Meshopt => {
            Some(MeshoptPacker::new(VERTEX_BYTES + 4 * channels.len(), spool)?)
        }
    };
    let encoder = GlbEncoder { local, crs, comments, channels, light, packer };
    FileSink::create(path, options, encoder)
}

struct GlbEncoder {
    /// Positions in world axes.
    local: LocalCoordinates,
    crs: Option<String>,
    comments: Vec<String>,
    /// Channels of a colour, or none.
    channels: Vec<VertexChannel>,
    /// Linear intensity of sRGB bytes.
    light: [f32; 256],
    /// The compressor, if any.
    packer: Option<MeshoptPacker>,
}

impl GlbEncoder {
    fn json(
        &self,
        counts: MeshCounts,
        [low, high]: [[f32; 3]; 2],
        packed: Option<MeshoptSizes>,
    ) -> Vec<u8> {
        let mut asset = json!({
            "version": "2.0",
            "generator": text::generator(),
            "extras": {
                "origin": self.local.origin(),
                "axes": "world position = origin + (x, -z, y)",
                "crs": self.crs,
                "comments": self.comments,
            },
        });
        if let Some(scale) = self.local.scale() {
            asset["extras"]["scale"] = json!(scale);
            asset["extras"]["axes"] = "world position = origin + (x, -z, y) / scale".into();
        }
        let mut document = json!({ "asset": asset, "scene": 0, "scenes": [{}] });
        if counts.vertices > 0 {
            let (low, high) =
                (to_y_up([low[0], high[1], low[2]]), to_y_up([high[0], low[1], high[2]]));
            add_mesh(&mut document, counts, [low, high], self.channels.len());
            if let Some(sizes) = packed {
                pack(&mut document, sizes, counts, self.vertex_bytes() as u64);
            }
        }
        document.to_string().into_bytes()
    }

    /// Bytes of the position and colour of a vertex.
    fn vertex_bytes(&self) -> usize {
        VERTEX_BYTES + 4 * self.channels.len()
    }

    /// Appends linear red, green and blue, and opacity.
    fn push_colour(&self, values: &[f64], record: &mut Vec<u8>) {
        for (place, &value) in values.iter().enumerate() {
            // The sink has checked that it is a byte.
            let share = if place < 3 { self.light[value as usize] } else { opacity(value) };
            record.extend(share.to_le_bytes());
        }
    }

    /// Sizes of the compressed streams, if any.
    fn sizes(&self) -> Option<MeshoptSizes> {
        self.packer.as_ref().map(MeshoptPacker::sizes)
    }

    /// Bytes after the JSON.
    fn data_bytes(&self, counts: MeshCounts) -> u64 {
        let raw =
            counts.vertices * self.vertex_bytes() as u64 + counts.triangles * TRIANGLE_BYTES as u64;
        self.sizes().map_or(raw, MeshoptSizes::bytes)
    }

    /// Bytes reserved for the JSON text, enough for the largest mesh.
    fn json_bytes(&self) -> usize {
        let largest = u32::MAX.into();
        let counts = MeshCounts { vertices: largest, triangles: largest };
        let sizes = self.sizes().map(|_| MeshoptSizes([largest; 2]));
        self.json(counts, [[f32::MIN; 3]; 2], sizes).len().next_multiple_of(4)
    }
}

/// Adds the mesh to a document. A mesh without triangles becomes a point set, because glTF has no empty index lists.
/// A colour of three or four channels follows the position of its vertex.
fn add_mesh(document: &mut Value, counts: MeshCounts, [low, high]: [[f32; 3]; 2], channels: usize) {
    let MeshCounts { vertices, triangles } = counts;
    let vertex_bytes = (VERTEX_BYTES + 4 * channels) as u64;
    let (position_bytes, index_bytes) =
        (vertices * vertex_bytes, triangles * TRIANGLE_BYTES as u64);
    let mut views = vec![json!({
        "buffer": 0, "byteLength": position_bytes, "target": ARRAY_BUFFER,
    })];
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": FLOAT, "count": vertices, "type": "VEC3",
        "min": low.map(f64::from), "max": high.map(f64::from),
    })];
    let mut primitive = json!({ "attributes": { "POSITION": 0 }, "material": 0, "mode": POINTS });
    if triangles > 0 {
        views.push(json!({
            "buffer": 0, "byteOffset": position_bytes, "byteLength": index_bytes,
            "target": ELEMENT_ARRAY_BUFFER,
        }));
        accessors.push(json!({
            "bufferView": 1, "componentType": UNSIGNED_INT, "count": 3 * triangles,
            "type": "SCALAR",
        }));
        primitive["indices"] = 1.into();
        primitive["mode"] = TRIANGLES.into();
    }
    let mut material = json!({
        "name": "ground",
        "doubleSided": true,
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 1 },
    });
    if channels > 0 {
        views[0]["byteStride"] = vertex_bytes.into();
        primitive["attributes"]["COLOR_0"] = accessors.len().into();
        accessors.push(json!({
            "bufferView": 0, "byteOffset": VERTEX_BYTES, "componentType": FLOAT, "count": vertices,
            "type": format!("VEC{channels}"),
        }));
    }
    if channels == 4 {
        material["alphaMode"] = "BLEND".into();
    }
    document["scenes"] = json!([{ "nodes": [0] }]);
    document["nodes"] = json!([{ "mesh": 0, "name": "terrain" }]);
    document["meshes"] = json!([{ "name": "terrain", "primitives": [primitive] }]);
    document["materials"] = json!([material]);
    document["buffers"] = json!([{ "byteLength": position_bytes + index_bytes }]);
    document["bufferViews"] = views.into();
    document["accessors"] = accessors.into();
}

impl MeshEncoder for GlbEncoder {
    fn name(&self) -> &'static str {
        if self.packer.is_some() { PACKED_NAME } else { NAME }
    }

    fn capacity(&self) -> MeshCapacity {
        MeshCapacity { vertex_bytes: self.vertex_bytes() as u64, ..CAPACITY }
    }

    fn channels(&self) -> &[VertexChannel] {
        &self.channels
    }

    /// Header and JSON, padded with spaces to the reserved size. Without vertices there is no binary chunk, and its
    /// header becomes spaces too.
    fn header(&self, counts: MeshCounts) -> Vec<u8> {
        let mut json = self.json(counts, self.local.bounds(), self.sizes());
        let mut reserved = self.json_bytes();
        let is_empty = counts.vertices == 0;
        if is_empty {
            reserved += 8;
        }
        json.resize(reserved, b' ');
        let data = self.data_bytes(counts);
        let file = FRAME_BYTES + self.json_bytes() as u64 + data;
        let mut header = [MAGIC.as_slice(), &VERSION.to_le_bytes(), &word(file)].concat();
        header.extend([word(reserved as u64), *JSON_CHUNK].concat());
        header.extend(json);
        if !is_empty {
            header.extend([word(data), *BIN_CHUNK].concat());
        }
        header
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        if self.packer.is_some() {
            self.pack(batch, body, tail)?;
        } else if self.channels.is_empty() {
            body.records(batch.vertices, |point| placed(&mut self.local, point))?;
        } else {
            let mut values = batch.values.chunks_exact(self.channels.len());
            body.lines(batch.vertices, |point, bytes| {
                self.push_vertex(point, values.next().unwrap_or_default(), bytes);
            })?;
        }
        if self.packer.is_none() {
            // The ids are below 2^32: the sink has checked them against a number of vertices that fits.
            tail.records(batch.triangles, |ids| record(*ids, |id| (id as u32).to_le_bytes()))?;
        }
        self.local.check()
    }

    fn complete(&mut self, body: &mut AppendWriter, tail: &mut AppendWriter) -> Result<()> {
        let Some(packer) = &mut self.packer else { return Ok(()) };
        packer.complete(body, tail)?;
        let bytes = FRAME_BYTES + packer.sizes().bytes() + self.json_bytes() as u64;
        if bytes > u32::MAX.into() {
            let limit = format!("{} bytes", u32::MAX);
            return Err(capacity::too_much(PACKED_NAME, &limit, 0, 0));
        }
        Ok(())
    }
}

impl GlbEncoder {
    fn push_vertex(&mut self, point: &Point3, values: &[f64], bytes: &mut Vec<u8>) {
        bytes.extend(placed(&mut self.local, point));
        self.push_colour(values, bytes);
    }

    /// Compresses a batch.
    fn pack(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        let channels = self.channels.len();
        let mut element = Vec::new();
        for (place, point) in batch.vertices.iter().enumerate() {
            element.clear();
            self.push_vertex(point, &batch.values[place * channels..][..channels], &mut element);
            if let Some(packer) = &mut self.packer {
                packer.push_vertex(&element, body)?;
            }
        }
        // As above, ids are below 2^32.
        let triangles = batch.triangles.iter().map(|ids| ids.map(|id| id as u32));
        let packer = self.packer.as_mut();
        packer.map_or(Ok(()), |packer| packer.push_triangles(triangles, tail))
    }
}

/// Marks the buffer of a document as compressed, and refers to a fallback buffer without data, as the extension
/// requires.
fn pack(document: &mut Value, sizes: MeshoptSizes, counts: MeshCounts, vertex_bytes: u64) {
    let raw = document["buffers"][0]["byteLength"].clone();
    let fallback = json!({ meshopt::NAME: { "fallback": true } });
    document["buffers"] = json!([
        { "byteLength": sizes.bytes() },
        { "byteLength": raw, "extensions": fallback },
    ]);
    let [vertices, triangles] = sizes.spans();
    let views = [
        (vertices, "ATTRIBUTES", vertex_bytes, counts.vertices),
        (triangles, "TRIANGLES", 4, 3 * counts.triangles),
    ];
    let all = document["bufferViews"].as_array_mut();
    for (view, ((offset, bytes), mode, stride, count)) in all.into_iter().flatten().zip(views) {
        view["buffer"] = 1.into();
        view["extensions"] = json!({ meshopt::NAME: {
            "buffer": 0, "byteOffset": offset, "byteLength": bytes, "byteStride": stride,
            "mode": mode, "count": count,
        } });
    }
    for list in ["extensionsUsed", "extensionsRequired"] {
        document[list] = json!([meshopt::NAME]);
    }
}

/// The bytes of a position.
fn placed(local: &mut LocalCoordinates, point: &Point3) -> [u8; 12] {
    record(to_y_up(local.place(point)), f32::to_le_bytes)
}

/// A size below 2^32; the sink has checked it.
fn word(size: u64) -> [u8; 4] {
    (size as u32).to_le_bytes()
}

fn record<T: Copy>(values: [T; 3], encode: impl Fn(T) -> [u8; 4]) -> [u8; 12] {
    let mut bytes = [0; 12];
    let (slots, _) = bytes.as_chunks_mut::<4>();
    for (slot, value) in slots.iter_mut().zip(values) {
        *slot = encode(value);
    }
    bytes
}
