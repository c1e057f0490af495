//! Reader of binary glTF 2.0, and of its accessors, plain or compressed (EXT_meshopt_compression,
//! KHR_mesh_quantization). Content that terrain clients do not support is refused.

use std::borrow::Cow;

use serde::Deserialize;

use super::ellipsoid::Vector;
use super::meshopt;
use terrane_base::error::{Error, Result};

const I8: u32 = 5120;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const FLOAT: u32 = 5126;

/// Targets of buffer views.
const OF_VERTICES: u32 = 34_962;
const OF_INDICES: u32 = 34_963;
/// The extension that lists the vertices of sides.
const EDGES: &str = "CESIUM_tile_edges";
const COMPRESSION: &str = "EXT_meshopt_compression";
const QUANTIZATION: &str = "KHR_mesh_quantization";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub(super) struct ProofGltf {
    asset: ProofGltfAsset,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    scene: usize,
    scenes: Vec<GltfScene>,
    nodes: Vec<ProofGltfNode>,
    meshes: Vec<ProofGltfMesh>,
    #[serde(default, rename = "materials")]
    _materials: Vec<GltfMaterial>,
    accessors: Vec<ProofGltfAccessor>,
    buffer_views: Vec<ProofBufferView>,
    buffers: Vec<ProofGltfBuffer>,
}

#[derive(Deserialize)]
struct ProofGltfAsset {
    version: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GltfScene {
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProofGltfNode {
    mesh: Option<usize>,
    pub(super) matrix: Option<[f64; 16]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProofGltfMesh {
    primitives: Vec<ProofGltfPrimitive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProofGltfPrimitive {
    pub(super) attributes: ProofGltfAttributes,
    pub(super) indices: Option<usize>,
    #[serde(rename = "material")]
    _material: Option<usize>,
    mode: Option<u32>,
    #[serde(default)]
    pub(super) extensions: ProofGltfExtensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE", deny_unknown_fields)]
pub(super) struct ProofGltfAttributes {
    pub(super) position: usize,
    #[serde(rename = "TEXCOORD_0")]
    pub(super) place: Option<usize>,
    pub(super) normal: Option<usize>,
}

/// A material: opaque, single-sided and without textures.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct GltfMaterial {
    #[serde(rename = "pbrMetallicRoughness")]
    _surface: Option<LitMaterial>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct LitMaterial {
    #[serde(rename = "metallicFactor")]
    _metallic: Option<f64>,
    #[serde(rename = "roughnessFactor")]
    _roughness: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProofGltfExtensions {
    #[serde(rename = "CESIUM_tile_edges")]
    pub(super) edges: Option<TileEdgeAccessors>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TileEdgeAccessors {
    pub(super) left: usize,
    pub(super) bottom: usize,
    pub(super) right: usize,
    pub(super) top: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub(super) struct ProofGltfAccessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    pub(super) count: usize,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    normalized: bool,
    sparse: Option<serde::de::IgnoredAny>,
    min: Option<Vec<f64>>,
    max: Option<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct ProofBufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
    target: Option<u32>,
    #[serde(default)]
    extensions: OfView,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfView {
    #[serde(rename = "EXT_meshopt_compression")]
    packed: Option<ProofPackedView>,
}

/// The extension of a compressed view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct ProofPackedView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    filter: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct ProofGltfBuffer {
    byte_length: usize,
    uri: Option<String>,
    #[serde(default)]
    extensions: OfBuffer,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfBuffer {
    #[serde(rename = "EXT_meshopt_compression")]
    packed: Option<GltfFallback>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GltfFallback {
    fallback: bool,
}

/// The numbers of an accessor.
pub(super) struct ProofAccessorNumbers<const N: usize> {
    pub(super) stored: Vec<[f64; N]>,
    /// The integer that stands for 1, for normalized components.
    pub(super) unit: Option<f64>,
}

impl<const N: usize> ProofAccessorNumbers<N> {
    pub(super) fn into_values(self) -> Vec<[f64; N]> {
        match self.unit {
            Some(unit) => {
                // The lowest signed integer is beyond -1: glTF clamps it.
                self.stored.into_iter().map(|e| e.map(|value| (value / unit).max(-1.0))).collect()
            }
            None => self.stored,
        }
    }
}

/// The JSON and the buffer of a file.
pub(super) struct ProofGlbFile<'a> {
    gltf: ProofGltf,
    bytes: &'a [u8],
}

impl<'a> ProofGlbFile<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self> {
        if bytes.get(..4) != Some(b"glTF") || number(bytes, 4) != Some(2) {
            return Err(bad("not a binary glTF 2.0".to_owned()));
        }
        if number(bytes, 8) != Some(bytes.len()) {
            return Err(bad(format!("{} bytes, unlike the length in the header", bytes.len())));
        }
        let (text, buffer) = chunks(bytes).ok_or_else(|| {
            bad("expected one JSON and one BIN chunk, and nothing else".to_owned())
        })?;
        let gltf: ProofGltf =
            serde_json::from_slice(text).map_err(|e| bad(format!("invalid JSON: {e}")))?;
        let file = Self { gltf, bytes: buffer };
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<()> {
        let version = &self.gltf.asset.version;
        if !version.starts_with("2.") {
            return Err(refuse(&format!("unsupported glTF version {version:?}; supported: 2")));
        }
        let mut required = self.gltf.extensions_required.iter();
        if let Some(name) = required.find(|name| ![COMPRESSION, QUANTIZATION].contains(&&***name)) {
            return Err(refuse(&format!("unsupported extension {name:?} is required")));
        }
        self.check_extensions()?;
        self.check_targets()?;
        match self.gltf.buffers.split_first() {
            Some((first, others))
                if first.is_chunk(self.bytes)
                    && others.iter().all(ProofGltfBuffer::is_fallback) =>
            {
                Ok(())
            }
            _ => Err(bad("buffer is not the BIN chunk".to_owned())),
        }
    }

    fn primitives(&self) -> impl Iterator<Item = &ProofGltfPrimitive> {
        self.gltf.meshes.iter().flat_map(|mesh| &mesh.primitives)
    }

    /// Clients rely on the lists of extensions.
    fn check_extensions(&self) -> Result<()> {
        let ProofGltf { extensions_used: used, extensions_required: required, .. } = &self.gltf;
        let is_packed = self.gltf.buffer_views.iter().any(|view| view.extensions.packed.is_some());
        let is_short = self.primitives().any(|primitive| {
            let position = self.gltf.accessors.get(primitive.attributes.position);
            position.is_some_and(|position| position.component_type != FLOAT)
        });
        for (is_needed, name) in [(is_packed, COMPRESSION), (is_short, QUANTIZATION)] {
            if is_needed && !required.iter().any(|listed| listed == name) {
                return Err(refuse(&format!("extension {name:?} is not listed as required")));
            }
        }
        let has_edges = self.primitives().any(|primitive| primitive.extensions.edges.is_some());
        let edges = has_edges.then_some(EDGES);
        let mut all = required.iter().map(String::as_str).chain(edges);
        match all.find(|name| !used.iter().any(|listed| listed == name)) {
            Some(name) => Err(refuse(&format!("extension {name:?} is not listed as used"))),
            None => Ok(()),
        }
    }

    /// Clients upload views to the stated target.
    fn check_targets(&self) -> Result<()> {
        let is_wrong = self.primitives().any(|primitive| {
            let ProofGltfAttributes { position, place, normal } = primitive.attributes;
            let mut of_vertices = [Some(position), place, normal].into_iter().flatten();
            primitive.indices.is_some_and(|number| self.is_for_another(number, OF_INDICES))
                || of_vertices.any(|number| self.is_for_another(number, OF_VERTICES))
        });
        match is_wrong {
            true => Err(refuse("buffer view has the wrong target")),
            false => Ok(()),
        }
    }

    /// Whether the view of an accessor states another target.
    fn is_for_another(&self, accessor: usize, target: u32) -> bool {
        let view = self.gltf.accessors.get(accessor).and_then(|accessor| accessor.buffer_view);
        let view = view.and_then(|view| self.gltf.buffer_views.get(view));
        view.and_then(|view| view.target).is_some_and(|stated| stated != target)
    }

    pub(super) fn node(&self) -> Result<&ProofGltfNode> {
        let gltf = &self.gltf;
        let is_one = gltf.nodes.len() == 1 && gltf.meshes.len() == 1;
        let is_shown = gltf.scenes.get(gltf.scene).is_some_and(|scene| scene.nodes == [0]);
        match is_one && is_shown {
            true => Ok(&gltf.nodes[0]),
            false => Err(refuse("scene is not one node with one mesh")),
        }
    }

    pub(super) fn primitive(&self, node: &ProofGltfNode) -> Result<&ProofGltfPrimitive> {
        let mesh = node.mesh.and_then(|mesh| self.gltf.meshes.get(mesh));
        match mesh.map(|mesh| &mesh.primitives[..]) {
            Some([primitive]) if primitive.mode.is_none_or(|mode| mode == 4) => Ok(primitive),
            _ => Err(refuse("mesh is not a single primitive of triangles")),
        }
    }

    pub(super) fn accessor(&self, number: usize) -> Result<&ProofGltfAccessor> {
        self.gltf.accessors.get(number).ok_or_else(|| {
            bad(format!("accessor {number} exceeds the {} accessors", self.gltf.accessors.len()))
        })
    }

    /// Bytes of the buffer.
    fn slice(&self, buffer: usize, at: usize, length: usize) -> Option<&[u8]> {
        self.bytes.get(at..at.checked_add(length)?).filter(|_| buffer == 0)
    }

    /// The bytes of a view, decompressed.
    fn view(&self, view: &ProofBufferView) -> Result<Cow<'_, [u8]>> {
        let packed = view.extensions.packed.as_ref();
        let stored = match packed {
            Some(packed) => self.slice(packed.buffer, packed.byte_offset, packed.byte_length),
            None => self.slice(view.buffer, view.byte_offset, view.byte_length),
        };
        let stored = stored.ok_or_else(|| bad("buffer view exceeds the buffer".to_owned()))?;
        let Some(packed) = packed else { return Ok(Cow::Borrowed(stored)) };
        let unpacked = packed.unpack(stored)?;
        match unpacked.len() == view.byte_length {
            true => Ok(Cow::Owned(unpacked)),
            false => Err(bad("wrong length of a compressed view".to_owned())),
        }
    }

    /// The bytes of the elements of an accessor, and their stride; `size` is that of an element.
    fn elements(&self, number: usize, kind: &str, size: usize) -> Result<(Cow<'_, [u8]>, usize)> {
        let accessor = self.accessor(number)?;
        if accessor.kind != kind || accessor.sparse.is_some() {
            return Err(refuse(&format!("accessor {number} is sparse or not of type {kind}")));
        }
        let view = accessor.buffer_view.and_then(|view| self.gltf.buffer_views.get(view));
        let view = view.ok_or_else(|| bad(format!("accessor {number} without buffer view")))?;
        let stride = view.byte_stride.unwrap_or(size);
        let is_plain = view.extensions.packed.is_none();
        if stride < size || is_plain && stride != size {
            return Err(refuse(&format!("stride of accessor {number} is {stride}, not {size}")));
        }
        let bytes = self.view(view)?;
        let range = accessor.count.checked_mul(stride).and_then(|length| {
            let end = accessor.byte_offset.checked_add(length)?;
            (end <= bytes.len()).then_some(accessor.byte_offset..end)
        });
        let range =
            range.ok_or_else(|| bad(format!("accessor {number} exceeds its buffer view")))?;
        Ok(match bytes {
            Cow::Borrowed(bytes) => (Cow::Borrowed(&bytes[range]), stride),
            Cow::Owned(bytes) => (Cow::Owned(bytes[range].to_vec()), stride),
        })
    }

    pub(super) fn vectors<const N: usize>(
        &self,
        number: usize,
        kind: &str,
        count: usize,
    ) -> Result<ProofAccessorNumbers<N>> {
        let accessor = self.accessor(number)?;
        let (width, unit) = match (accessor.component_type, accessor.normalized) {
            (FLOAT, false) => (4, None),
            (U16, false) => (2, None),
            (U16, true) => (2, Some(f64::from(u16::MAX))),
            (I16, true) => (2, Some(f64::from(i16::MAX))),
            (I8, true) => (1, Some(f64::from(i8::MAX))),
            _ => return Err(refuse(&format!("unsupported component type in accessor {number}"))),
        };
        if accessor.count != count {
            let found = accessor.count;
            return Err(bad(format!("{found} elements in accessor {number}, expected {count}")));
        }
        let (bytes, stride) = self.elements(number, kind, width * N)?;
        let elements = bytes.chunks_exact(stride).map(|element| {
            std::array::from_fn(|axis| {
                component(accessor.component_type, &element[axis * width..(axis + 1) * width])
            })
        });
        let stored: Vec<[f64; N]> = elements.collect();
        if stored.as_flattened().iter().any(|value| !value.is_finite()) {
            return Err(bad(format!("accessor {number} contains a number that is not finite")));
        }
        Ok(ProofAccessorNumbers { stored, unit })
    }

    pub(super) fn indices(&self, number: usize, count: usize) -> Result<Vec<u32>> {
        let found: Vec<u32> = match self.accessor(number)?.component_type {
            U16 => {
                let (bytes, _) = self.elements(number, "SCALAR", 2)?;
                bytes.as_chunks().0.iter().map(|bytes| u16::from_le_bytes(*bytes).into()).collect()
            }
            U32 => {
                let (bytes, _) = self.elements(number, "SCALAR", 4)?;
                bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
            }
            _ => return Err(refuse(&format!("unsupported index type in accessor {number}"))),
        };
        match found.iter().find(|&&index| index as usize >= count) {
            Some(index) => Err(bad(format!("index {index} exceeds the {count} vertices"))),
            None => Ok(found),
        }
    }
}

impl ProofPackedView {
    fn unpack(&self, bytes: &[u8]) -> Result<Vec<u8>> {
        let Self { byte_stride: stride, count, filter, mode, .. } = self;
        match (&mode[..], filter.as_deref().unwrap_or("NONE")) {
            ("ATTRIBUTES", "NONE") => meshopt::attributes(bytes, *stride, *count),
            ("ATTRIBUTES", "OCTAHEDRAL") if *stride == 4 => {
                let mut directions = meshopt::attributes(bytes, *stride, *count)?;
                meshopt::directions(&mut directions);
                Ok(directions)
            }
            ("TRIANGLES", "NONE") => index_bytes(&meshopt::triangles(bytes, *count)?, *stride),
            ("INDICES", "NONE") => index_bytes(&meshopt::list(bytes, *count)?, *stride),
            _ => Err(refuse("unsupported mode or filter of EXT_meshopt_compression")),
        }
    }
}

/// Indices as bytes, little-endian, of 2 or 4 bytes each.
fn index_bytes(indices: &[u32], stride: usize) -> Result<Vec<u8>> {
    let fits = indices.iter().all(|index| stride == 4 || *index <= u16::MAX.into());
    match [2, 4].contains(&stride) && fits {
        true => Ok(indices
            .iter()
            .flat_map(|index| index.to_le_bytes().into_iter().take(stride))
            .collect()),
        false => Err(bad(format!(
            "compressed indices of {stride} bytes; expected 2 or 4 bytes that hold them"
        ))),
    }
}

impl ProofGltfBuffer {
    /// Whether it is the BIN chunk.
    fn is_chunk(&self, chunk: &[u8]) -> bool {
        self.uri.is_none() && self.byte_length.next_multiple_of(4) == chunk.len()
    }

    /// Whether it is a placeholder for decompressed views.
    fn is_fallback(&self) -> bool {
        self.uri.is_none() && self.extensions.packed.as_ref().is_some_and(|packed| packed.fallback)
    }
}

impl ProofGltfAccessor {
    /// Whether its minimum and maximum are those of its elements.
    pub(super) fn has_ends(&self, elements: &[Vector]) -> bool {
        is_end(self.min.as_deref(), elements, f64::min)
            && is_end(self.max.as_deref(), elements, f64::max)
    }
}

/// Whether a stated minimum or maximum, in single precision, is that of elements.
fn is_end(stated: Option<&[f64]>, elements: &[Vector], choose: fn(f64, f64) -> f64) -> bool {
    let Some(&[x, y, z]) = stated else { return false };
    [x, y, z].into_iter().enumerate().all(|(axis, stated)| {
        let end = elements.iter().map(|element| element[axis]).reduce(choose);
        end == Some(f64::from(stated as f32))
    })
}

/// The number stored at a byte.
fn number(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize)
}

/// The contents of the JSON and the BIN chunk, which are all chunks of the file.
fn chunks(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let text = chunk(bytes, 12, b"JSON")?;
    let at = 20 + text.len();
    let buffer = chunk(bytes, at, b"BIN\0")?;
    let is_end = at + 8 + buffer.len() == bytes.len();
    (is_end && text.len().is_multiple_of(4)).then_some((text, buffer))
}

fn chunk<'a>(bytes: &'a [u8], at: usize, kind: &[u8]) -> Option<&'a [u8]> {
    let end = number(bytes, at)?.checked_add(at + 8)?;
    let is_kind = bytes.get(at + 4..at + 8) == Some(kind);
    bytes.get(at + 8..end).filter(|_| is_kind)
}

/// A component of an element, by its type.
fn component(component_type: u32, bytes: &[u8]) -> f64 {
    match (component_type, bytes) {
        (I8, [a]) => f64::from(*a as i8),
        (I16, [a, b]) => f64::from(i16::from_le_bytes([*a, *b])),
        (_, [a, b]) => f64::from(u16::from_le_bytes([*a, *b])),
        (_, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => f64::NAN,
    }
}

pub(super) fn bad(message: String) -> Error {
    Error::bad_input(message)
}

pub(super) fn refuse(message: &str) -> Error {
    Error::unsupported(message.to_owned())
}
