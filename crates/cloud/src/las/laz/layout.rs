//! The LASzip VLR: compressor, chunk size and items.

use laz::{LazItemType, LazVlr};

use crate::las::bytes::LasHeaderBytes;
use crate::las::header::LasHeader;
use crate::lazip::{LaszipItem, LaszipSchema};
use terrane_base::error::{Error, Result};

/// Bytes before the items, and bytes of an item.
const HEAD_BYTES: usize = 34;
const ITEM_BYTES: usize = 6;
/// Maximum number of items: point, time, colours, waveform packet and extra bytes.
const MAX_ITEMS: usize = 8;
/// Chunk sizes for chunks of variable size, whose numbers of points are in the chunk table.
const VARIABLE: [u32; 2] = [0, u32::MAX];

/// Compressor type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LazCompressor {
    /// All points in one stream.
    Stream,
    /// Chunks, each one stream.
    Chunks,
    /// Chunks, each with a stream for every field.
    Layers,
}

impl LazCompressor {
    /// Name for people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Stream => "point by point in one stream",
            Self::Chunks => "point by point",
            Self::Layers => "by layers",
        }
    }
}

/// Compression parameters of a file.
#[derive(Clone, Debug)]
pub(crate) struct LazLayout {
    pub(crate) compressor: LazCompressor,
    /// Points of each chunk but the last; `None` if they are in the chunk table.
    pub(crate) chunk_points: Option<u32>,
    /// Bytes of a decompressed point.
    pub(crate) record: usize,
    /// Streams of a layered chunk.
    pub(super) layers: usize,
    /// Schema for the decoder.
    pub(super) schema: LaszipSchema,
}

impl LazLayout {
    /// From the data of the LASzip VLR of a file with this header.
    pub(crate) fn parse(data: &[u8], header: &LasHeader) -> Result<Self> {
        let b = LasHeaderBytes(data);
        let compressor = match (b.u16(0), b.u16(2)) {
            (1, 0) => LazCompressor::Stream,
            (2, 0) => LazCompressor::Chunks,
            (3, 0) => LazCompressor::Layers,
            (kind, coder) => {
                let message = format!("unknown compressor {kind} with coder {coder}");
                return Err(unsupported(message));
            }
        };
        let schema = schema(&items(b, data.len(), compressor, header)?)?;
        let vlr = LazVlr::from_buffer(data).map_err(|e| damaged(e.to_string()))?;
        let layers = vlr.items().iter().map(|item| layers(item.item_type())).sum();
        let chunk_points = Some(b.u32(12)).filter(|points| !VARIABLE.contains(points));
        Ok(Self { compressor, chunk_points, record: header.record.into(), layers, schema })
    }
}

/// Fails if the decoder does not support an item.
fn schema(items: &[[u16; 3]]) -> Result<LaszipSchema> {
    let items = items.iter().map(|&[kind, size, version]| LaszipItem { kind, size, version });
    LaszipSchema::new(&items.collect::<Vec<_>>())
        .map_err(|item| unsupported(format!("unknown compression of {item}")))
}

fn unsupported(what: String) -> Error {
    Error::unsupported(what).remedy("decompress it with laszip first")
}

/// Type, bytes and version of each item. Fails unless the items match the point format of the header, in order, with
/// versions of the compressor.
fn items(
    b: LasHeaderBytes<'_>,
    len: usize,
    compressor: LazCompressor,
    header: &LasHeader,
) -> Result<Vec<[u16; 3]>> {
    let count = usize::from(b.u16(32));
    if count == 0 || count > MAX_ITEMS || HEAD_BYTES + count * ITEM_BYTES > len {
        return Err(damaged(format!("{count} items do not fit into {len} bytes")));
    }
    let items: Vec<[u16; 3]> = (0..count)
        .map(|i| [0, 2, 4].map(|field| b.u16(HEAD_BYTES + i * ITEM_BYTES + field)))
        .collect();
    let kinds: Vec<[u16; 2]> = items.iter().map(|[kind, bytes, _]| [*kind, *bytes]).collect();
    if kinds != expected(header) {
        return Err(damaged(format!("the items do not match point format {}", header.format)));
    }
    let versions = if compressor == LazCompressor::Layers { 3..=4 } else { 1..=2 };
    let version = items[0][2];
    // Waveform items have no second version.
    let is_mixed = items.iter().any(|&[kind, _, v]| v != version && !(kind == 9 && v == 1));
    if !versions.contains(&version) || is_mixed {
        return Err(unsupported(format!("unknown item version {version}")));
    }
    Ok(items)
}

/// Type and bytes of the items of a point format.
fn expected(header: &LasHeader) -> Vec<[u16; 2]> {
    let (point, time, colour, wave) = ([6, 20], [7, 8], [8, 6], [9, 29]);
    let (point14, colour14, nir14, wave14) = ([10, 30], [11, 6], [12, 8], [13, 29]);
    let mut items = match header.format {
        0 => vec![point],
        1 => vec![point, time],
        2 => vec![point, colour],
        3 => vec![point, time, colour],
        4 => vec![point, time, wave],
        5 => vec![point, time, colour, wave],
        6 => vec![point14],
        7 => vec![point14, colour14],
        8 => vec![point14, nir14],
        9 => vec![point14, wave14],
        _ => vec![point14, nir14, wave14],
    };
    let extra = header.extra_bytes();
    if extra > 0 {
        items.push([if header.is_new() { 14 } else { 0 }, extra]);
    }
    items
}

fn layers(kind: LazItemType) -> usize {
    match kind {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(bytes) => bytes.into(),
        _ => 1,
    }
}

fn damaged(what: String) -> Error {
    Error::bad_input(format!("the LASzip VLR is damaged: {what}")).remedy("copy the file again")
}
