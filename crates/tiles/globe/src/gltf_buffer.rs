//! The buffer of a glTF file and its views: uncompressed, or compressed losslessly (EXT_meshopt_compression).

use meshoptimizer_rs::{self as meshopt, codec};
use terrane_base::error::{Error, ErrorKind, Result};

/// Name of the extension.
pub(crate) const MESHOPT: &str = "EXT_meshopt_compression";

pub(crate) const ARRAYS: u32 = 34962;
pub(crate) const INDICES: u32 = 34963;
const I8: u32 = 5120;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const FLOAT: u32 = 5126;

/// Bits of a normal's component.
const NORMAL_BITS: u32 = 8;

/// The buffer and its views.
#[derive(Default)]
pub(crate) struct TileBufferBuilder {
    is_packed: bool,
    pub(crate) bytes: Vec<u8>,
    /// Size in bytes of all views after decompression.
    unpacked: usize,
    pub(crate) views: Vec<String>,
    pub(crate) accessors: Vec<String>,
}

/// Elements of a view: their bytes, and how these are compressed.
struct BufferElements<'a> {
    bytes: &'a [u8],
    stride: usize,
    mode: TilePartMode<'a>,
}

#[derive(Clone, Copy)]
enum TilePartMode<'a> {
    Attributes { is_octahedral: bool },
    Triangles(&'a [u32]),
    Sequence(&'a [u32]),
}

impl TileBufferBuilder {
    /// Empty; added data is compressed if `is_packed`.
    pub(crate) fn new(is_packed: bool) -> Self {
        Self { is_packed, ..Self::default() }
    }

    /// JSON of the buffers.
    pub(crate) fn buffers(&self) -> String {
        let (bytes, unpacked) = (self.bytes.len(), self.unpacked);
        let fallback = format!(
            r#",{{"byteLength":{unpacked},"extensions":{{"{MESHOPT}":{{"fallback":true}}}}}}"#
        );
        format!(r#"{{"byteLength":{bytes}}}{}"#, if self.is_packed { &fallback } else { "" })
    }

    /// Adds a view and an accessor for all of it; returns its index.
    fn add(&mut self, elements: &BufferElements<'_>, target: u32, what: &str) -> Result<usize> {
        let target = if target == 0 { String::new() } else { format!(r#","target":{target}"#) };
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, number) = (self.bytes.len(), self.views.len());
        let view = match self.is_packed {
            true => self.pack(elements, offset, &target)?,
            false => {
                let length = elements.bytes.len();
                self.bytes.extend_from_slice(elements.bytes);
                format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{target}}}"#)
            }
        };
        self.views.push(view);
        self.accessors.push(format!(r#"{{"bufferView":{number},{what}}}"#));
        Ok(number)
    }

    /// Compresses elements; returns the JSON of their view.
    fn pack(&mut self, elements: &BufferElements<'_>, at: usize, target: &str) -> Result<String> {
        let BufferElements { bytes, stride, mode } = elements;
        let packed = mode.pack(bytes, *stride).map_err(|error| {
            Error::new(ErrorKind::Internal, format!("a tile cannot be compressed: {error}"))
        })?;
        let (length, count) = (bytes.len(), bytes.len() / stride);
        let (name, filter, of_vertices) = match mode {
            TilePartMode::Attributes { is_octahedral: true } => {
                ("ATTRIBUTES", r#","filter":"OCTAHEDRAL""#, true)
            }
            TilePartMode::Attributes { .. } => ("ATTRIBUTES", "", true),
            TilePartMode::Triangles(_) => ("TRIANGLES", "", false),
            TilePartMode::Sequence(_) => ("INDICES", "", false),
        };
        let gap = if of_vertices { format!(r#","byteStride":{stride}"#) } else { String::new() };
        self.unpacked = self.unpacked.next_multiple_of(4);
        let (offset, size) = (self.unpacked, packed.len());
        self.unpacked += length;
        self.bytes.extend(packed);
        Ok(format!(
            r#"{{"buffer":1,"byteOffset":{offset},"byteLength":{length}{gap}{target},"extensions":{{"{MESHOPT}":{{"buffer":0,"byteOffset":{at},"byteLength":{size},"byteStride":{stride},"count":{count},"mode":"{name}"{filter}}}}}}}"#
        ))
    }

    /// Adds attributes; with `has_ends`, with minimum and maximum.
    pub(crate) fn floats<const N: usize>(
        &mut self,
        kind: &str,
        values: &[[f32; N]],
        has_ends: bool,
    ) -> Result<usize> {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let count = values.len();
        let ends = if has_ends { ends(values) } else { String::new() };
        let what = format!(r#""componentType":{FLOAT},"count":{count},"type":"{kind}"{ends}"#);
        let mode = TilePartMode::Attributes { is_octahedral: false };
        self.add(&BufferElements { bytes: &bytes, stride: 4 * N, mode }, ARRAYS, &what)
    }

    /// Adds integer positions; normalized if `is_part`.
    pub(crate) fn positions(&mut self, values: &[[u16; 3]], is_part: bool) -> Result<usize> {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|[x, y, z]| [*x, *y, *z, 0])
            .flat_map(u16::to_le_bytes)
            .collect();
        let (count, ends) = (values.len(), ends(values));
        let part = if is_part { r#","normalized":true"# } else { "" };
        let what = format!(r#""componentType":{U16}{part},"count":{count},"type":"VEC3"{ends}"#);
        let mode = TilePartMode::Attributes { is_octahedral: false };
        self.add(&BufferElements { bytes: &bytes, stride: 8, mode }, ARRAYS, &what)
    }

    /// Adds fractions of 32,767.
    pub(crate) fn shares(&mut self, values: &[[i16; 2]]) -> Result<usize> {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let count = values.len();
        let what =
            format!(r#""componentType":{I16},"normalized":true,"count":{count},"type":"VEC2""#);
        let mode = TilePartMode::Attributes { is_octahedral: false };
        self.add(&BufferElements { bytes: &bytes, stride: 4, mode }, ARRAYS, &what)
    }

    /// Adds directions with one byte per component.
    pub(crate) fn directions(&mut self, values: &[[f32; 3]]) -> Result<usize> {
        let four: Vec<f32> = values.iter().flat_map(|[x, y, z]| [*x, *y, *z, 0.0]).collect();
        let count = values.len();
        let mut space = meshopt::Workspace::default();
        let bytes = codec::encode_filter_oct(count, 4, NORMAL_BITS, &four, &mut space)
            .map_err(|error| Error::new(ErrorKind::Internal, error.to_string()))?;
        let what =
            format!(r#""componentType":{I8},"normalized":true,"count":{count},"type":"VEC3""#);
        let mode = TilePartMode::Attributes { is_octahedral: true };
        self.add(&BufferElements { bytes: &bytes, stride: 4, mode }, ARRAYS, &what)
    }

    /// Adds the corners of triangles.
    pub(crate) fn triangles(&mut self, corners: &[u32], is_short: bool) -> Result<usize> {
        self.indices(corners, TilePartMode::Triangles(corners), is_short, INDICES)
    }

    /// Adds numbers of vertices in any order.
    pub(crate) fn vertices(&mut self, numbers: &[u32], is_short: bool) -> Result<usize> {
        self.indices(numbers, TilePartMode::Sequence(numbers), is_short, 0)
    }

    fn indices(
        &mut self,
        indices: &[u32],
        mode: TilePartMode<'_>,
        is_short: bool,
        target: u32,
    ) -> Result<usize> {
        let (kind, stride, count) =
            if is_short { (U16, 2, indices.len()) } else { (U32, 4, indices.len()) };
        let bytes: Vec<u8> =
            indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect();
        let what = format!(r#""componentType":{kind},"count":{count},"type":"SCALAR""#);
        self.add(&BufferElements { bytes: &bytes, stride, mode }, target, &what)
    }
}

impl TilePartMode<'_> {
    fn pack(self, bytes: &[u8], stride: usize) -> std::result::Result<Vec<u8>, meshopt::Error> {
        // The versions of the extension.
        let (vertices, indices) =
            (codec::VertexEncoding::new(0, 2)?, codec::IndexEncoding::new(1)?);
        let space = &mut meshopt::Workspace::default();
        match self {
            Self::Attributes { .. } => {
                let count = bytes.len() / stride;
                codec::encode_vertex_buffer(bytes, count, stride, vertices, space)
            }
            Self::Triangles(corners) => codec::encode_index_buffer(corners, indices, space),
            Self::Sequence(numbers) => codec::encode_index_sequence(numbers, indices, space),
        }
    }
}

/// Minimum and maximum of elements along each axis, for an accessor.
fn ends<T: Copy + PartialOrd + std::fmt::Display, const N: usize>(values: &[[T; N]]) -> String {
    let [min, max] = [T::lt as fn(&T, &T) -> bool, T::gt].map(|is_before| {
        let ends = std::array::from_fn::<String, N, _>(|axis| {
            let along = values.iter().map(|value| value[axis]);
            let end = along.reduce(|a, b| if is_before(&b, &a) { b } else { a });
            end.map_or("0".to_owned(), |end| end.to_string())
        });
        ends.join(",")
    });
    format!(r#","min":[{min}],"max":[{max}]"#)
}
