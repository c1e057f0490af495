//! The header of a binary PLY file: elements, and the location of vertices and faces.

use crate::channels::{BAND, COLOURS};
use crate::input::{MeshFile, MeshFileLines};
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Maximum number of elements, and of properties of an element.
const MAX_ENTRIES: u64 = 1024;

/// A scalar type of PLY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlyScalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl PlyScalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_real(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// The number at the start of `bytes`; NaN if they are too few. Exact for every type.
    pub(super) fn read(self, bytes: &[u8], big: bool) -> f64 {
        match self {
            Self::I8 => number(bytes, big, |b: [u8; 1]| i8::from_le_bytes(b).into()),
            Self::U8 => number(bytes, big, |b: [u8; 1]| b[0].into()),
            Self::I16 => number(bytes, big, |b| i16::from_le_bytes(b).into()),
            Self::U16 => number(bytes, big, |b| u16::from_le_bytes(b).into()),
            Self::I32 => number(bytes, big, |b| i32::from_le_bytes(b).into()),
            Self::U32 => number(bytes, big, |b| u32::from_le_bytes(b).into()),
            Self::F32 => number(bytes, big, |b| f32::from_le_bytes(b).into()),
            Self::F64 => number(bytes, big, f64::from_le_bytes),
        }
    }
}

fn number<const N: usize>(bytes: &[u8], big: bool, decode: impl Fn([u8; N]) -> f64) -> f64 {
    let Some(&(mut bytes)) = bytes.first_chunk::<N>() else { return f64::NAN };
    if big {
        bytes.reverse();
    }
    decode(bytes)
}

/// A property of an element: a number, or a list if it has a type for the list's length.
struct PlyProperty {
    name: String,
    length: Option<PlyScalar>,
    item: PlyScalar,
}

struct PlyElement {
    name: String,
    count: u64,
    properties: Vec<PlyProperty>,
}

/// Location of the records of an element.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PlyElementSpan {
    pub(super) offset: u64,
    pub(super) stride: u64,
    pub(super) count: u64,
}

/// A number inside a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlyField {
    pub(super) offset: u64,
    pub(super) scalar: PlyScalar,
}

/// Storage of vertices and triangles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlyHeader {
    pub(super) big: bool,
    pub(super) vertices: PlyElementSpan,
    pub(super) xyz: [PlyField; 3],
    /// Vertex channels: bytes of a colour, and bands.
    pub(super) channels: Vec<(String, PlyField)>,
    pub(super) faces: PlyElementSpan,
    /// The length of a face's list, which must be 3.
    pub(super) length: PlyField,
    /// The first of its three items; the others follow.
    pub(super) item: PlyField,
    pub(super) comments: Vec<String>,
}

/// Reads the header and checks it against the file length.
pub(super) fn read(input: &MeshFile) -> Result<PlyHeader> {
    let mut lines = input.lines(0, 1);
    if !lines.advance()? || lines.text() != b"ply" {
        return Err(lines.bad("the signature \"ply\" is missing"));
    }
    let mut parser = PlyHeaderParser::default();
    while !parser.line(input, &mut lines)? {}
    parser.layout(input, lines.end())
}

#[derive(Default)]
struct PlyHeaderParser {
    big: Option<bool>,
    elements: Vec<PlyElement>,
    comments: Vec<String>,
}

impl PlyHeaderParser {
    /// Reads a line; true for the last one of the header.
    fn line(&mut self, input: &MeshFile, lines: &mut MeshFileLines<'_>) -> Result<bool> {
        if !lines.advance()? {
            return Err(input
                .bad("the header is truncated")
                .remedy("write or copy the file again"));
        }
        limits::check("PLY header length", lines.end(), limits::MAX_HEADER_BYTES)
            .map_err(|e| e.in_file(input.path()))?;
        // Comments may be in any encoding.
        let text = String::from_utf8_lossy(lines.text()).into_owned();
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => return Ok(true),
            ["format", format, "1.0"] => self.big = Some(is_big(format, lines)?),
            ["comment", ..] => self.comment(text.trim_start()["comment".len()..].trim()),
            ["obj_info", ..] | [] => {}
            ["element", "tristrips", ..] => {
                return Err(lines.unsupported("triangle strips are not supported"));
            }
            ["element", name, count] => self.element(name, count, lines)?,
            ["property", rest @ ..] => self.property(rest, lines)?,
            _ => return Err(lines.bad(format!("invalid PLY header line \"{}\"", text.trim()))),
        }
        Ok(false)
    }

    fn comment(&mut self, text: &str) {
        if !text.starts_with(PADDING) && self.comments.len() < MAX_ENTRIES as usize {
            self.comments.push(text.to_owned());
        }
    }

    fn element(&mut self, name: &str, count: &str, lines: &MeshFileLines<'_>) -> Result<()> {
        limits::check("number of PLY elements", self.elements.len() as u64 + 1, MAX_ENTRIES)?;
        let count = count.parse().map_err(|_| lines.bad(format!("\"{count}\" is not a count")))?;
        self.elements.push(PlyElement { name: name.to_owned(), count, properties: Vec::new() });
        Ok(())
    }

    fn property(&mut self, words: &[&str], lines: &MeshFileLines<'_>) -> Result<()> {
        let (length, item, name) = match *words {
            ["list", length, item, name] => (Some(scalar(length, lines)?), item, name),
            [item, name] => (None, item, name),
            _ => return Err(lines.bad("a property needs a type and a name")),
        };
        let property = PlyProperty { name: name.to_owned(), length, item: scalar(item, lines)? };
        let element = self.elements.last_mut();
        let element = element.ok_or_else(|| lines.bad("property without an element"))?;
        let count = element.properties.len() as u64 + 1;
        limits::check("number of PLY properties", count, MAX_ENTRIES)?;
        element.properties.push(property);
        Ok(())
    }

    fn layout(self, input: &MeshFile, start: u64) -> Result<PlyHeader> {
        let big = self.big.ok_or_else(|| input.bad("the header has no format line"))?;
        let nowhere = PlyField { offset: 0, scalar: PlyScalar::U8 };
        let mut header = PlyHeader {
            big,
            vertices: PlyElementSpan::default(),
            xyz: [nowhere; 3],
            channels: Vec::new(),
            faces: PlyElementSpan::default(),
            length: nowhere,
            item: nowhere,
            comments: self.comments.clone(),
        };
        header.place(input, &self.elements, start)?;
        Ok(header)
    }
}

/// Prefix of the comment that pads the header.
pub(super) const PADDING: &str = "padding";

fn scalar(name: &str, lines: &MeshFileLines<'_>) -> Result<PlyScalar> {
    PlyScalar::parse(name).ok_or_else(|| lines.bad(format!("\"{name}\" is not a PLY type")))
}

fn is_big(format: &str, lines: &MeshFileLines<'_>) -> Result<bool> {
    match format {
        "binary_little_endian" => Ok(false),
        "binary_big_endian" => Ok(true),
        "ascii" => {
            Err(lines.unsupported("is an ASCII PLY file").remedy("convert it to binary PLY"))
        }
        other => Err(lines.bad(format!("\"{other}\" is not a PLY format"))),
    }
}

impl PlyHeader {
    /// Locates the elements, which are consecutive from byte `start`.
    fn place(&mut self, input: &MeshFile, elements: &[PlyElement], start: u64) -> Result<()> {
        if !elements.iter().any(|element| element.name == "vertex") {
            return Err(input.bad("has no vertices"));
        }
        let mut offset = start;
        for (i, element) in elements.iter().enumerate() {
            // Lists behind all that is needed: where they end is known only by reading them.
            if element.scalars().is_none() && !elements[i..].iter().any(PlyElement::is_needed) {
                return Ok(());
            }
            let span = self.element(input, element, offset)?;
            offset = end(input, element, span)?;
        }
        if offset == input.bytes() { Ok(()) } else { Err(self.surplus(input, offset)?) }
    }

    /// The error for bytes after the last record: polygons, or surplus data.
    fn surplus(&self, input: &MeshFile, end: u64) -> Result<Error> {
        let bytes = input.bytes() - end;
        let message = format!("has {bytes} surplus bytes after the last element");
        let remedy = match self.first_polygon(input)? {
            Some((face, corners)) => {
                format!("triangulate the mesh first (face {face} has {corners} corners)")
            }
            None => "write or copy the file again".to_owned(),
        };
        Ok(input.bad(message).remedy(remedy))
    }

    /// Index and number of corners of the first face other than a triangle.
    fn first_polygon(&self, input: &MeshFile) -> Result<Option<(u64, f64)>> {
        let (PlyElementSpan { offset, stride, count }, mut first) = (self.faces, None);
        if count == 0 {
            return Ok(None);
        }
        input.records(offset..offset + stride * count, stride, |place, record| {
            let bytes = record.get(self.length.offset as usize..).unwrap_or_default();
            let corners = self.length.scalar.read(bytes, self.big);
            if corners != 3.0 && first.is_none() {
                first = Some((place as u64, corners));
            }
            Ok(())
        })?;
        Ok(first)
    }

    /// Reads the element that begins at byte `offset`.
    fn element(
        &mut self,
        input: &MeshFile,
        element: &PlyElement,
        offset: u64,
    ) -> Result<PlyElementSpan> {
        let name = element.name.as_str();
        let stride = match name {
            "vertex" => self.vertex(input, element)?,
            "face" => self.face(input, element)?,
            _ => element.scalars().ok_or_else(|| element.refused(input))?,
        };
        let span = PlyElementSpan { offset, stride, count: element.count };
        match name {
            "vertex" => self.vertices = span,
            "face" => self.faces = span,
            _ => {}
        }
        Ok(span)
    }

    fn vertex(&mut self, input: &MeshFile, element: &PlyElement) -> Result<u64> {
        let stride = element.scalars().ok_or_else(|| element.refused(input))?;
        for (field, name) in self.xyz.iter_mut().zip(["x", "y", "z"]) {
            *field = element
                .field(name)
                .ok_or_else(|| input.bad(format!("vertices have no property \"{name}\"")))?;
            if !field.scalar.is_real() {
                return Err(input.unsupported(format!(
                    "integer vertex coordinates ({name}) are not supported"
                )));
            }
        }
        self.channels = element.channels();
        Ok(stride)
    }

    /// Record length of triangles; other polygons are detected when reading.
    fn face(&mut self, input: &MeshFile, element: &PlyElement) -> Result<u64> {
        let mut names = element.properties.iter().map(|property| property.name.as_str());
        let list = names
            .position(|name| matches!(name, "vertex_indices" | "vertex_index"))
            .and_then(|at| Some((at, element.properties[at].length?)));
        let (at, length) =
            list.ok_or_else(|| input.bad("faces have no property list \"vertex_indices\""))?;
        let item = element.properties[at].item;
        if length.is_real() || item.is_real() {
            return Err(input.bad("vertex indices are not integers"));
        }
        let (before, after) = (&element.properties[..at], &element.properties[at + 1..]);
        let sizes = scalars(before).zip(scalars(after));
        let (before, after) = sizes.ok_or_else(|| element.refused(input))?;
        self.length = PlyField { offset: before, scalar: length };
        self.item = PlyField { offset: before + length.bytes(), scalar: item };
        Ok(self.item.offset + 3 * item.bytes() + after)
    }
}

impl PlyElement {
    fn is_needed(&self) -> bool {
        matches!(self.name.as_str(), "vertex" | "face")
    }

    /// Record length, unless the element has lists.
    fn scalars(&self) -> Option<u64> {
        scalars(&self.properties)
    }

    /// The first property of this name of an element without lists.
    fn field(&self, name: &str) -> Option<PlyField> {
        let at = self.properties.iter().position(|property| property.name == name)?;
        let offset = scalars(&self.properties[..at])?;
        Some(PlyField { offset, scalar: self.properties[at].item })
    }

    fn channel(&self, name: &str) -> Option<(String, PlyField)> {
        self.field(name).map(|field| (name.to_owned(), field))
    }

    /// Channels of an element without lists: red, green, blue and optionally alpha if they are bytes, and bands.
    fn channels(&self) -> Vec<(String, PlyField)> {
        let [red, green, blue, alpha] = COLOURS
            .map(|name| self.channel(name).filter(|(_, field)| field.scalar == PlyScalar::U8));
        let colour = red.zip(green).zip(blue).map(|((red, green), blue)| [red, green, blue]);
        let alpha = alpha.filter(|_| colour.is_some());
        let bands = self.properties.iter().filter(|p| p.name.starts_with(BAND));
        let bands = bands.filter_map(|p| self.channel(&p.name));
        colour.into_iter().flatten().chain(alpha).chain(bands).collect()
    }

    fn refused(&self, input: &MeshFile) -> Error {
        let list = self.properties.iter().filter(|p| p.length.is_some());
        let names: Vec<&str> = list.map(|p| p.name.as_str()).collect();
        input.unsupported(format!(
            "list properties of element \"{}\" are not supported: {}",
            self.name,
            names.join(", ")
        ))
    }
}

fn scalars(properties: &[PlyProperty]) -> Option<u64> {
    properties.iter().map(|p| p.length.is_none().then_some(p.item.bytes())).sum()
}

/// End of the records, if the file is long enough.
fn end(input: &MeshFile, element: &PlyElement, span: PlyElementSpan) -> Result<u64> {
    let end = span.count.checked_mul(span.stride).and_then(|bytes| bytes.checked_add(span.offset));
    end.filter(|&end| end <= input.bytes()).ok_or_else(|| {
        let (count, bytes) = (element.count, input.bytes());
        let message =
            format!("{count} elements \"{}\" do not fit into {bytes} bytes", element.name);
        input.bad(message).remedy("write or copy the file again")
    })
}
