//! Reading of binary glTF with one mesh of one primitive, of any origin.

use std::path::Path;

use serde::Deserialize;

use super::layout::{
    BIN_CHUNK, FLOAT, JSON_CHUNK, MAGIC, NAME, PACKED_NAME, POINTS, TRIANGLES, UNSIGNED_INT,
    VERSION, to_z_up,
};
use super::meshopt;
use super::packed::{self, AccessorElements, MeshoptExtension};
use crate::channels::{COLOURS, from_linear, from_opacity, linear};
use crate::input::{MeshFile, check_corners, check_position, check_range};
use crate::relative_positions::{is_scale, to_world};
use crate::source::{MeshInfo, MeshSource};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_base::limits;

/// Maximum bytes of JSON: a single mesh takes one thousand.
const MAX_JSON_BYTES: u64 = 1 << 20;
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct GltfDocument {
    asset: GltfAsset,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    nodes: Vec<GltfNode>,
    #[serde(default)]
    meshes: Vec<GltfMesh>,
    #[serde(default)]
    accessors: Vec<GltfAccessor>,
    #[serde(default)]
    buffer_views: Vec<GltfBufferView>,
    #[serde(default)]
    buffers: Vec<GltfBuffer>,
}

#[derive(Deserialize)]
struct GltfAsset {
    generator: Option<String>,
    /// Arbitrary content is accepted.
    #[serde(default)]
    extras: serde_json::Value,
}

#[derive(Deserialize)]
struct GltfNode {
    mesh: Option<u64>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct GltfMesh {
    primitives: Vec<GltfPrimitive>,
}

#[derive(Deserialize)]
struct GltfPrimitive {
    attributes: GltfAttributes,
    indices: Option<usize>,
    #[serde(default = "triangles")]
    mode: u32,
}

fn triangles() -> u32 {
    TRIANGLES
}

#[derive(Deserialize)]
struct GltfAttributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
    #[serde(rename = "COLOR_0")]
    colour: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct GltfAccessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    count: u64,
    #[serde(rename = "type")]
    shape: String,
    /// Arbitrary content is accepted.
    #[serde(default)]
    min: serde_json::Value,
    #[serde(default)]
    max: serde_json::Value,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct GltfBufferView {
    buffer: u64,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
    #[serde(default)]
    extensions: BufferViewExtensions,
}

/// Extensions of a buffer view.
#[derive(Default, Deserialize)]
struct BufferViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    packed: Option<MeshoptExtension>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct GltfBuffer {
    byte_length: u64,
    uri: Option<serde::de::IgnoredAny>,
}

/// Location of the elements of an accessor in the file.
struct AccessorSpan {
    place: AccessorLocation,
    count: u64,
    /// Bytes of a component.
    width: usize,
}

enum AccessorLocation {
    Plain { offset: u64, stride: u64 },
    Packed(packed::MeshoptAccessor),
}

/// An open GLB file.
pub(super) struct GlbSource {
    input: MeshFile,
    positions: Option<AccessorSpan>,
    /// Stated bounds of the positions.
    bounds: Option<[Point3; 2]>,
    /// `None` if every three vertices are a triangle, or without triangles.
    indices: Option<AccessorSpan>,
    /// Colours in f32.
    colours: Option<AccessorSpan>,
    /// Channels of a colour: 3 or 4.
    parts: usize,
    /// Linear intensity of sRGB bytes.
    light: [f32; 256],
    info: MeshInfo,
}

impl GlbSource {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        let (document, data) = read_chunks(&input)?;
        let layout = GltfResolver { input: &input, document: &document, data };
        let primitive = layout.primitive()?;
        let positions = primitive.map(|p| layout.positions(p)).transpose()?;
        let bounds = primitive.and_then(|p| document.accessors[p.attributes.position?].bounds());
        let indices = primitive.and_then(|p| p.indices.map(|at| layout.indices(at))).transpose()?;
        let vertices = positions.as_ref().map_or(0, |span| span.count);
        let is_points = primitive.is_some_and(|p| p.mode == POINTS);
        let corners = indices.as_ref().map_or(vertices, |span| span.count);
        if !is_points && !corners.is_multiple_of(3) {
            return Err(
                input.bad(format!("the number of indices ({corners}) is not a multiple of 3"))
            );
        }
        let triangles = if is_points { 0 } else { corners / 3 };
        let colours = primitive.map(|p| layout.colours(p, vertices)).transpose()?.flatten();
        let (colours, parts) = colours.map_or((None, 0), |(span, parts)| (Some(span), parts));
        let channels = COLOURS[..parts].iter().map(|name| (*name).to_owned()).collect();
        let plain = MeshInfo {
            channels,
            indexed: indices.is_some() || is_points,
            ..MeshInfo::plain(NAME, vertices, triangles)
        };
        let mut info = info(&document.asset, plain);
        if document.buffer_views.iter().any(|view| view.extensions.packed.is_some()) {
            info.format = PACKED_NAME;
        }
        Ok(Self { input, positions, bounds, indices, colours, parts, light: linear(), info })
    }
}

fn info(asset: &GltfAsset, plain: MeshInfo) -> MeshInfo {
    let extras = &asset.extras;
    // Extras of other programs may have these names and anything in them.
    let origin = serde_json::from_value::<Point3>(extras["origin"].clone()).unwrap_or_default();
    let scale = serde_json::from_value::<Point3>(extras["scale"].clone()).ok();
    let generator = asset.generator.iter().map(|name| ("generator".to_owned(), name.clone()));
    let comments = extras["comments"].as_array().into_iter().flatten().filter_map(|c| c.as_str());
    let info = MeshInfo {
        origin,
        scale: scale.filter(is_scale).unwrap_or([1.0; 3]),
        single_precision: true,
        crs: extras["crs"].as_str().map(str::to_owned),
        details: generator.collect(),
        ..plain
    };
    info.with_comments(comments.map(str::to_owned))
}

/// The JSON document, and offset and length of the binary data.
fn read_chunks(input: &MeshFile) -> Result<(GltfDocument, (u64, u64))> {
    let [magic, version, length] = words(input, 0)?;
    if magic != *MAGIC {
        return Err(input.bad("the signature \"glTF\" is missing"));
    }
    if u32::from_le_bytes(version) != VERSION {
        let version = u32::from_le_bytes(version);
        return Err(input.unsupported(format!("glTF container version {version} is not supported")));
    }
    let length = u64::from(u32::from_le_bytes(length));
    if length != input.bytes() {
        let message = format!("has {} bytes, the header states {length}", input.bytes());
        return Err(input.bad(message).remedy("write or copy the file again"));
    }
    let (json_start, json_bytes) = chunk(input, 12, JSON_CHUNK)?;
    limits::check("GLB JSON length", json_bytes, MAX_JSON_BYTES)
        .map_err(|e| e.in_file(input.path()))?;
    let mut json = vec![0; json_bytes as usize];
    input.read_at(json_start, &mut json)?;
    let document = serde_json::from_slice(&json).map_err(|e| input.bad(format!("JSON: {e}")))?;
    let end = json_start + json_bytes;
    let data = if end == length { (end, 0) } else { chunk(input, end, BIN_CHUNK)? };
    Ok((document, data))
}

/// Start and length of the chunk at `offset`, which must be of `kind` and inside the file.
fn chunk(input: &MeshFile, offset: u64, kind: &[u8; 4]) -> Result<(u64, u64)> {
    let [length, found] = words(input, offset)?;
    let (start, length) = (offset + 8, u64::from(u32::from_le_bytes(length)));
    let name = String::from_utf8_lossy(kind).trim_end_matches('\0').to_owned();
    if found != *kind {
        return Err(input.bad(format!("has no {name} chunk at byte {offset}")));
    }
    // The eight bytes before `start` were read, so it is not beyond the file.
    if length > input.bytes() - start {
        return Err(input.bad(format!("the {name} chunk of {length} bytes is truncated")));
    }
    Ok((start, length))
}

fn words<const N: usize>(input: &MeshFile, offset: u64) -> Result<[[u8; 4]; N]> {
    let mut words = [[0; 4]; N];
    if offset + 4 * N as u64 > input.bytes() {
        return Err(input.bad("is truncated").remedy("write or copy the file again"));
    }
    input.read_at(offset, words.as_flattened_mut())?;
    Ok(words)
}

/// Resolves references of a document, checked against offset and length of the binary data.
struct GltfResolver<'a> {
    input: &'a MeshFile,
    document: &'a GltfDocument,
    data: (u64, u64),
}

impl<'a> GltfResolver<'a> {
    fn bad(&self, message: impl Into<String>) -> Error {
        self.input.bad(message)
    }

    fn unsupported(&self, message: impl Into<String>) -> Error {
        self.input.unsupported(message)
    }

    /// The only primitive of the only mesh, if any.
    fn primitive(&self) -> Result<Option<&'a GltfPrimitive>> {
        let required = self.document.extensions_required.iter();
        if let Some(name) = required.into_iter().find(|name| *name != meshopt::NAME) {
            return Err(self.unsupported(format!("the glTF extension {name} is not supported")));
        }
        let Some(mesh) = self.document.meshes.first() else { return Ok(None) };
        self.check_nodes()?;
        let (meshes, primitives) = (self.document.meshes.len(), mesh.primitives.len());
        let [primitive] = mesh.primitives.as_slice() else {
            return Err(
                self.unsupported(format!("meshes of {primitives} primitives are not supported"))
            );
        };
        if meshes > 1 {
            return Err(self.unsupported(format!("several meshes ({meshes}) are not supported")));
        }
        if primitive.mode != TRIANGLES && (primitive.mode != POINTS || primitive.indices.is_some())
        {
            return Err(
                self.unsupported(format!("primitive mode {} is not supported", primitive.mode))
            );
        }
        Ok(Some(primitive))
    }

    fn check_nodes(&self) -> Result<()> {
        let nodes = &self.document.nodes;
        if let Some(at) = nodes.iter().position(|node| !node.is_identity()) {
            return Err(
                self.unsupported(format!("node {at} has a transform, which is not supported"))
            );
        }
        if nodes.iter().filter(|node| node.mesh.is_some()).count() > 1 {
            return Err(self.unsupported("instancing (a mesh in several nodes) is not supported"));
        }
        Ok(())
    }

    fn positions(&self, primitive: &GltfPrimitive) -> Result<AccessorSpan> {
        let at = primitive.attributes.position.ok_or_else(|| self.bad("has no positions"))?;
        let accessor = self.accessor(at)?;
        if accessor.component_type != FLOAT || accessor.shape != "VEC3" {
            return Err(self.unsupported("positions other than VEC3 of f32 are not supported"));
        }
        self.span(accessor, 4, 3)
    }

    /// Colours of the vertices and their number of channels, if stored as f32; others are ignored.
    fn colours(
        &self,
        primitive: &GltfPrimitive,
        vertices: u64,
    ) -> Result<Option<(AccessorSpan, usize)>> {
        let Some(at) = primitive.attributes.colour else { return Ok(None) };
        let accessor = self.accessor(at)?;
        let parts = match accessor.shape.as_str() {
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return Ok(None),
        };
        if accessor.component_type != FLOAT {
            return Ok(None);
        }
        if accessor.count != vertices {
            let count = accessor.count;
            return Err(self.bad(format!("has {count} colours for {vertices} vertices")));
        }
        Ok(Some((self.span(accessor, 4, parts as u64)?, parts)))
    }

    fn indices(&self, at: usize) -> Result<AccessorSpan> {
        let accessor = self.accessor(at)?;
        let width = match accessor.component_type {
            UNSIGNED_BYTE => 1,
            UNSIGNED_SHORT => 2,
            UNSIGNED_INT => 4,
            other => return Err(self.bad(format!("has indices of component type {other}"))),
        };
        if accessor.shape != "SCALAR" {
            return Err(self.bad("has indices that are not SCALAR"));
        }
        self.span(accessor, width, 1)
    }

    fn accessor(&self, at: usize) -> Result<&'a GltfAccessor> {
        let accessor = self.document.accessors.get(at);
        let accessor = accessor.ok_or_else(|| self.bad(format!("has no accessor {at}")))?;
        if accessor.sparse.is_some() {
            return Err(
                self.unsupported(format!("sparse accessors (accessor {at}) are not supported"))
            );
        }
        Ok(accessor)
    }

    /// Location of an accessor with `parts` components of `width` bytes; checked to be inside the file.
    fn span(&self, accessor: &GltfAccessor, width: usize, parts: u64) -> Result<AccessorSpan> {
        let size = width as u64 * parts;
        let lost = || self.bad("has an accessor outside its buffer");
        let view = accessor.buffer_view.and_then(|at| self.document.buffer_views.get(at));
        let view = view.ok_or_else(|| self.bad("has an accessor without a buffer view"))?;
        if let Some(packed) = &view.extensions.packed {
            let bytes = self.buffer_bytes(packed.buffer())?;
            let GltfAccessor { byte_offset: offset, count, .. } = *accessor;
            let elements = AccessorElements { offset, count, width, parts };
            let place = packed.open(self.input, self.data.0, bytes, elements)?;
            return Ok(AccessorSpan {
                place: AccessorLocation::Packed(place),
                count: accessor.count,
                width,
            });
        }
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size || stride > 252 {
            return Err(self.bad(format!("has a byte stride of {stride}")));
        }
        let start = view.byte_offset.checked_add(accessor.byte_offset).ok_or_else(lost)?;
        let length = match accessor.count {
            0 => 0,
            n => (n - 1).checked_mul(stride).and_then(|b| b.checked_add(size)).ok_or_else(lost)?,
        };
        let view_end = view.byte_offset.checked_add(view.byte_length).ok_or_else(lost)?;
        let end = start.checked_add(length).filter(|&end| end <= view_end).ok_or_else(lost)?;
        if end > self.buffer_bytes(view.buffer)? {
            return Err(lost());
        }
        let place = AccessorLocation::Plain { offset: self.data.0 + start, stride };
        Ok(AccessorSpan { place, count: accessor.count, width })
    }

    /// Length of the buffer, which must be the binary chunk.
    fn buffer_bytes(&self, at: u64) -> Result<u64> {
        let buffer = self.document.buffers.first().filter(|_| at == 0);
        let buffer = buffer.ok_or_else(|| {
            self.unsupported(format!("several buffers (buffer {at}) are not supported"))
        })?;
        if buffer.uri.is_some() {
            return Err(self.unsupported("external buffers are not supported"));
        }
        Ok(buffer.byte_length.min(self.data.1))
    }
}

impl GltfAccessor {
    /// Stated bounds of positions, as stored.
    fn bounds(&self) -> Option<[Point3; 2]> {
        let [min, max] =
            [&self.min, &self.max].map(|corner| serde_json::from_value(corner.clone()).ok());
        Some([min?, max?])
    }
}

impl GltfNode {
    fn is_identity(&self) -> bool {
        let matrix = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
        self.matrix.is_none_or(|m| m == matrix)
            && self.translation.is_none_or(|t| t == [0.0; 3])
            && self.rotation.is_none_or(|r| r == [0.0, 0.0, 0.0, 1.0])
            && self.scale.is_none_or(|s| s == [1.0; 3])
    }
}

impl GlbSource {
    /// Passes elements `first .. first + count` of a span to `each`. The last element may end before its stride, so
    /// it is read separately.
    fn elements(
        &self,
        span: &AccessorSpan,
        parts: usize,
        first: u64,
        count: usize,
        mut each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let Some(last) = count.checked_sub(1) else { return Ok(()) };
        let (offset, stride) = match &span.place {
            AccessorLocation::Plain { offset, stride } => (offset, *stride),
            AccessorLocation::Packed(place) => {
                return place.elements(&self.input, first, count, each);
            }
        };
        let start = offset + first * stride;
        let end = start + last as u64 * stride;
        let size = (span.width * parts) as u64;
        self.input.records(start..end, stride, &mut each)?;
        self.input.records(end..end + size, size, |_, record| each(last, record))
    }
}

fn position(record: &[u8]) -> Option<[f64; 3]> {
    let (values, _) = record.as_chunks::<4>();
    let &[x, y, z] = values.first_chunk::<3>()?;
    Some([x, y, z].map(|value| f32::from_le_bytes(value).into()))
}

/// The integer in the first `width` bytes.
fn index(record: &[u8], width: usize) -> u64 {
    let bytes = record.iter().take(width).rev();
    bytes.fold(0, |value, &byte| value << 8 | u64::from(byte))
}

impl MeshSource for GlbSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let Some(span) = &self.positions else { return Ok(()) };
        self.elements(span, 3, first, out.len(), |place, record| {
            let local = position(record).unwrap_or([f64::NAN; 3]);
            out[place] = to_world(to_z_up(local), self.info.origin, self.info.scale);
            check_position(first + place as u64, &out[place])
        })
    }

    fn stated_bounds(&self) -> Option<[Point3; 2]> {
        // Values rounded to single precision are stored exactly.
        let stored = self.bounds?.map(|corner| corner.map(|v| f64::from(v as f32)));
        let [a, b] = stored.map(|at| to_world(to_z_up(at), self.info.origin, self.info.scale));
        // Turning the axes or a negative scale may exchange the ends.
        let low = std::array::from_fn(|i| a[i].min(b[i]));
        Some([low, std::array::from_fn(|i| a[i].max(b[i]))])
    }

    fn read_channels(&self, first: u64, out: &mut [f64]) -> Result<()> {
        let vertices = out.len() / self.parts.max(1);
        check_range("vertices", first, vertices, self.info.vertices)?;
        let Some(span) = &self.colours else { return Ok(()) };
        self.elements(span, self.parts, first, vertices, |place, record| {
            let (shares, _) = record.as_chunks::<4>();
            let values = out[place * self.parts..].iter_mut().zip(shares).take(self.parts);
            for (channel, (value, share)) in values.enumerate() {
                let share = f32::from_le_bytes(*share);
                let is_light = channel < 3;
                *value =
                    if is_light { from_linear(share, &self.light) } else { from_opacity(share) };
            }
            Ok(())
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        match &self.indices {
            Some(AccessorSpan { place: AccessorLocation::Packed(place), .. }) => {
                place.triangles(&self.input, first, out)?;
            }
            Some(span) => {
                let ids = out.as_flattened_mut();
                self.elements(span, 1, 3 * first, ids.len(), |place, record| {
                    ids[place] = index(record, span.width);
                    Ok(())
                })?;
            }
            None => {
                for (triangle, ids) in (first..).zip(out.iter_mut()) {
                    *ids = [0, 1, 2].map(|corner| 3 * triangle + corner);
                }
            }
        }
        let mut all = (first..).zip(out.iter());
        all.try_for_each(|(index, ids)| check_corners(index, ids, self.info.vertices))
            .map_err(|e| e.in_file(self.input.path()))
    }
}
