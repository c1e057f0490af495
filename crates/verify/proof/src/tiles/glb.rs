//! The file of a tile: binary glTF 2.0, and the numbers of its accessors, plain or compressed
//! (EXT_meshopt_compression, KHR_mesh_quantization). What a client of terrain cannot take is refused.

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
/// Extensions that a file may need.
const KNOWN: [&str; 2] = ["EXT_meshopt_compression", "KHR_mesh_quantization"];

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

/// How a tile is drawn: as it is, lit from outside, and with nothing behind it seen.
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

/// What is said of a view that is compressed.
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
    /// The whole number that stands for 1, if one does.
    pub(super) whole: Option<f64>,
}

impl<const N: usize> ProofAccessorNumbers<N> {
    pub(super) fn into_values(self) -> Vec<[f64; N]> {
        match self.whole {
            Some(whole) => {
                // The least signed number has no positive twin: glTF takes it for -1 as well.
                self.stored.into_iter().map(|e| e.map(|value| (value / whole).max(-1.0))).collect()
            }
            None => self.stored,
        }
    }
}

/// The two parts of a file, and what the first says of the second.
pub(super) struct ProofGlbFile<'a> {
    gltf: ProofGltf,
    bytes: &'a [u8],
}

impl<'a> ProofGlbFile<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self> {
        let number = |at: usize| {
            let found = bytes.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
            found.map(|bytes| u32::from_le_bytes(bytes) as usize)
        };
        if bytes.get(..4) != Some(b"glTF") || number(4) != Some(2) {
            return Err(bad("is no binary glTF 2.0".to_owned()));
        }
        if number(8) != Some(bytes.len()) {
            return Err(bad(format!("has {} bytes, and says otherwise", bytes.len())));
        }
        let chunk = |at: usize, kind: &[u8]| {
            let end = number(at)?.checked_add(at + 8)?;
            let is_kind = bytes.get(at + 4..at + 8) == Some(kind);
            bytes.get(at + 8..end).filter(|_| is_kind)
        };
        let torn = || bad("has not the two chunks that it should".to_owned());
        let text = chunk(12, b"JSON").ok_or_else(torn)?;
        let at = 20 + text.len();
        let buffer = chunk(at, b"BIN\0").ok_or_else(torn)?;
        if at + 8 + buffer.len() != bytes.len() || !text.len().is_multiple_of(4) {
            return Err(torn());
        }
        let gltf: ProofGltf = serde_json::from_slice(text)
            .map_err(|e| bad(format!("has a text that is not understood: {e}")))?;
        let file = Self { gltf, bytes: buffer };
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<()> {
        if !self.gltf.asset.version.starts_with("2.") {
            return Err(refuse("is of another version than 2"));
        }
        let is_other = |name: &&String| !KNOWN.contains(&&***name);
        if let Some(name) = self.gltf.extensions_required.iter().find(is_other) {
            return Err(refuse(&format!("needs the extension {name:?}")));
        }
        self.check_extensions()?;
        self.check_targets()?;
        let is_here = |buffer: &ProofGltfBuffer| {
            buffer.uri.is_none() && buffer.byte_length.next_multiple_of(4) == self.bytes.len()
        };
        let is_fallback = |buffer: &ProofGltfBuffer| {
            let is_told = buffer.extensions.packed.as_ref().is_some_and(|packed| packed.fallback);
            is_told && buffer.uri.is_none()
        };
        match self.gltf.buffers.split_first() {
            Some((first, others)) if is_here(first) && others.iter().all(is_fallback) => Ok(()),
            _ => Err(bad("has another buffer than its second chunk".to_owned())),
        }
    }

    /// Clients go by the lists of extensions.
    fn check_extensions(&self) -> Result<()> {
        let ProofGltf { extensions_used: used, extensions_required: required, .. } = &self.gltf;
        let is_packed = self.gltf.buffer_views.iter().any(|view| view.extensions.packed.is_some());
        let primitives = || self.gltf.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let is_short = primitives().any(|primitive| {
            let position = self.gltf.accessors.get(primitive.attributes.position);
            position.is_some_and(|position| position.component_type != FLOAT)
        });
        let has_edges = primitives().any(|primitive| primitive.extensions.edges.is_some());
        let has = |list: &[String], name: &str| list.iter().any(|own| own == name);
        let needs = [(is_packed, KNOWN[0]), (is_short, KNOWN[1])];
        if let Some((_, name)) = needs.iter().find(|(is, name)| *is && !has(required, name)) {
            return Err(refuse(&format!("does not say that it needs the extension {name:?}")));
        }
        let mut uses =
            required.iter().map(|name| (true, name.as_str())).chain([(has_edges, EDGES)]);
        match uses.find(|(is, name)| *is && !has(used, name)) {
            Some((_, name)) => {
                Err(refuse(&format!("does not say that it uses the extension {name:?}")))
            }
            None => Ok(()),
        }
    }

    /// Clients put views where they are said to belong.
    fn check_targets(&self) -> Result<()> {
        let target = |number: usize| {
            let view = self.gltf.accessors.get(number)?.buffer_view?;
            self.gltf.buffer_views.get(view)?.target
        };
        let is_odd = |ProofGltfPrimitive { attributes, indices, .. }: &ProofGltfPrimitive| {
            let ProofGltfAttributes { position, place, normal } = attributes;
            let of_vertices = [Some(*position), *place, *normal].into_iter().flatten();
            let is_other = |number, known| target(number).is_some_and(|target| target != known);
            indices.is_some_and(|number| is_other(number, OF_INDICES))
                || of_vertices.into_iter().any(|number| is_other(number, OF_VERTICES))
        };
        match self.gltf.meshes.iter().flat_map(|mesh| &mesh.primitives).any(is_odd) {
            true => Err(refuse("has a buffer view for something else than what is in it")),
            false => Ok(()),
        }
    }

    pub(super) fn node(&self) -> Result<&ProofGltfNode> {
        let gltf = &self.gltf;
        let is_one = gltf.nodes.len() == 1 && gltf.meshes.len() == 1;
        let is_shown = gltf.scenes.get(gltf.scene).is_some_and(|scene| scene.nodes == [0]);
        match is_one && is_shown {
            true => Ok(&gltf.nodes[0]),
            false => Err(refuse("has not one node with one mesh")),
        }
    }

    pub(super) fn primitive(&self, node: &ProofGltfNode) -> Result<&ProofGltfPrimitive> {
        let mesh = node.mesh.and_then(|mesh| self.gltf.meshes.get(mesh));
        match mesh.map(|mesh| &mesh.primitives[..]) {
            Some([primitive]) if primitive.mode.is_none_or(|mode| mode == 4) => Ok(primitive),
            _ => Err(refuse("has not one mesh of one set of triangles")),
        }
    }

    pub(super) fn accessor(&self, number: usize) -> Result<&ProofGltfAccessor> {
        let none = || bad(format!("names accessor {number} of {}", self.gltf.accessors.len()));
        self.gltf.accessors.get(number).ok_or_else(none)
    }

    /// Bytes of the buffer.
    fn part(&self, buffer: usize, at: usize, length: usize) -> Option<&[u8]> {
        self.bytes.get(at..at.checked_add(length)?).filter(|_| buffer == 0)
    }

    /// The bytes of a view.
    fn view(&self, view: &ProofBufferView) -> Result<Cow<'_, [u8]>> {
        let outside = || bad("has a buffer view outside of its buffer".to_owned());
        match &view.extensions.packed {
            None => {
                let found = self.part(view.buffer, view.byte_offset, view.byte_length);
                found.map(Cow::Borrowed).ok_or_else(outside)
            }
            Some(packed) => {
                let ProofPackedView { buffer, byte_offset, byte_length, .. } = packed;
                let found = self.part(*buffer, *byte_offset, *byte_length).ok_or_else(outside)?;
                let unpacked = packed.unpack(found)?;
                match unpacked.len() == view.byte_length {
                    true => Ok(Cow::Owned(unpacked)),
                    false => Err(bad("has a compressed view of another length".to_owned())),
                }
            }
        }
    }

    /// The bytes of elements of an accessor, each at the start of so many.
    fn elements(
        &self,
        number: usize,
        (kind, bytes): (&str, usize),
    ) -> Result<(Cow<'_, [u8]>, usize)> {
        let accessor = self.accessor(number)?;
        if accessor.kind != kind || accessor.sparse.is_some() {
            return Err(refuse(&format!("has an accessor {number} of another kind than {kind}")));
        }
        let view = accessor.buffer_view.and_then(|view| self.gltf.buffer_views.get(view));
        let view = view.ok_or_else(|| bad(format!("has accessor {number} in no buffer view")))?;
        let stride = view.byte_stride.unwrap_or(bytes);
        let is_plain = view.extensions.packed.is_none();
        if stride < bytes || is_plain && stride != bytes {
            return Err(refuse(&format!("has an accessor {number} with gaps")));
        }
        let found = self.view(view)?;
        let reach = accessor.count.checked_mul(stride).and_then(|length| {
            let end = accessor.byte_offset.checked_add(length)?;
            (end <= found.len()).then_some(accessor.byte_offset..end)
        });
        let outside = || bad(format!("has accessor {number} outside of its buffer"));
        let reach = reach.ok_or_else(outside)?;
        Ok(match found {
            Cow::Borrowed(found) => (Cow::Borrowed(&found[reach]), stride),
            Cow::Owned(found) => (Cow::Owned(found[reach].to_vec()), stride),
        })
    }

    pub(super) fn vectors<const N: usize>(
        &self,
        number: usize,
        kind: &str,
        count: usize,
    ) -> Result<ProofAccessorNumbers<N>> {
        let accessor = self.accessor(number)?;
        let (width, most) = match (accessor.component_type, accessor.normalized) {
            (FLOAT, false) => (4, None),
            (U16, false) => (2, None),
            (U16, true) => (2, Some(f64::from(u16::MAX))),
            (I16, true) => (2, Some(f64::from(i16::MAX))),
            (I8, true) => (1, Some(f64::from(i8::MAX))),
            _ => return Err(refuse(&format!("has numbers of another type in accessor {number}"))),
        };
        if accessor.count != count {
            let found = accessor.count;
            return Err(bad(format!("has {found} elements in accessor {number}, not {count}")));
        }
        let (bytes, stride) = self.elements(number, (kind, width * N))?;
        let value = |bytes: &[u8]| match (accessor.component_type, bytes) {
            (I8, [a]) => f64::from(*a as i8),
            (I16, [a, b]) => f64::from(i16::from_le_bytes([*a, *b])),
            (_, [a, b]) => f64::from(u16::from_le_bytes([*a, *b])),
            (_, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            _ => f64::NAN,
        };
        let element = |bytes: &[u8]| {
            std::array::from_fn(|axis| value(&bytes[axis * width..(axis + 1) * width]))
        };
        let stored: Vec<[f64; N]> = bytes.chunks_exact(stride).map(element).collect();
        if stored.as_flattened().iter().any(|value| !value.is_finite()) {
            return Err(bad(format!("has a number in accessor {number} that is not finite")));
        }
        Ok(ProofAccessorNumbers { stored, whole: most })
    }

    pub(super) fn indices(&self, number: usize, count: usize) -> Result<Vec<u32>> {
        let found: Vec<u32> = match self.accessor(number)?.component_type {
            U16 => {
                let (bytes, _) = self.elements(number, ("SCALAR", 2))?;
                bytes.as_chunks().0.iter().map(|bytes| u16::from_le_bytes(*bytes).into()).collect()
            }
            U32 => {
                let (bytes, _) = self.elements(number, ("SCALAR", 4))?;
                bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
            }
            _ => return Err(refuse(&format!("has indices of another type in accessor {number}"))),
        };
        match found.iter().find(|&&index| index as usize >= count) {
            Some(index) => Err(bad(format!("names vertex {index} of {count}"))),
            None => Ok(found),
        }
    }
}

impl ProofPackedView {
    fn unpack(&self, bytes: &[u8]) -> Result<Vec<u8>> {
        let Self { byte_stride: stride, count, filter, mode, .. } = self;
        let of_vertices = |found: Vec<u32>| {
            let bytes =
                found.iter().flat_map(|vertex| vertex.to_le_bytes().into_iter().take(*stride));
            let fits = found.iter().all(|vertex| *stride == 4 || *vertex <= u16::MAX.into());
            match [2, 4].contains(stride) && fits {
                true => Ok(bytes.collect()),
                false => Err(bad("has compressed numbers of vertices of another size".to_owned())),
            }
        };
        match (&mode[..], filter.as_deref().unwrap_or("NONE")) {
            ("ATTRIBUTES", "NONE") => meshopt::attributes(bytes, *stride, *count),
            ("ATTRIBUTES", "OCTAHEDRAL") if *stride == 4 => {
                let mut found = meshopt::attributes(bytes, *stride, *count)?;
                meshopt::directions(&mut found);
                Ok(found)
            }
            ("TRIANGLES", "NONE") => of_vertices(meshopt::triangles(bytes, *count)?),
            ("INDICES", "NONE") => of_vertices(meshopt::list(bytes, *count)?),
            _ => Err(refuse("is compressed in another way")),
        }
    }
}

impl ProofGltfAccessor {
    /// Whether it says the ends of its elements.
    pub(super) fn has_ends(&self, elements: &[Vector]) -> bool {
        let along = |axis: usize| elements.iter().map(move |element| element[axis]);
        let is = |said: &Option<Vec<f64>>, choose: fn(f64, f64) -> f64| {
            let said = said.as_deref().unwrap_or_default();
            let found = (0..3).map(|axis| along(axis).reduce(choose));
            said.len() == 3
                && found.zip(said).all(|(end, said)| end == Some(f64::from(*said as f32)))
        };
        is(&self.min, f64::min) && is(&self.max, f64::max)
    }
}

pub(super) fn bad(message: String) -> Error {
    Error::bad_input(message)
}

pub(super) fn refuse(message: &str) -> Error {
    Error::unsupported(message.to_owned())
}
