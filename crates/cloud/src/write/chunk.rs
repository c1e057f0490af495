//! Chunks: runs of stored points, compressed for LAZ.

use std::cell::RefCell;
use std::io::{self, Cursor};
use std::sync::Arc;

use laz::compressors::IntegerCompressorBuilder;
use laz::encoders::ArithmeticEncoder;
use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};

use super::header_statistics::PointTally;
use super::record::PointRecord;
use crate::format::PointFormat;
use crate::lazip::{LaszipItem, LaszipSchema, LazEncoder};
use crate::version::PointPacking;
use terrane_base::error::{Error, ErrorKind, Result};

/// Points per chunk, the usual number in LAZ files.
pub const CHUNK: usize = 50_000;

/// Encoding of points.
#[derive(Clone, Debug)]
pub struct PointLayout {
    format: PointFormat,
    /// Record length.
    size: usize,
    packing: PointPacking,
    /// Compression, if any.
    laz: Option<Arc<LazVlr>>,
    /// The schema of records that [`LazEncoder`] compresses; others are for the crate `laz`.
    schema: Option<Arc<LaszipSchema>>,
}

/// Encoded points, ready for writing.
#[derive(Clone, Debug)]
pub struct PointChunk {
    pub(super) bytes: Vec<u8>,
    pub(super) tally: PointTally,
}

impl PointChunk {
    /// Number of points.
    pub fn points(&self) -> usize {
        self.tally.count() as usize
    }
}

impl PointLayout {
    pub(super) fn new(
        format: PointFormat,
        extra_bytes: u16,
        packing: PointPacking,
    ) -> Result<Self> {
        let laz = match packing {
            PointPacking::Plain | PointPacking::Text => None,
            PointPacking::Chunks => Some(vlr(format, extra_bytes, CHUNK as u32)?),
            PointPacking::Nodes => Some(vlr(format, extra_bytes, u32::MAX)?),
        };
        let size = format.size() + usize::from(extra_bytes);
        let schema = laz.as_ref().and_then(schema).map(Arc::new);
        Ok(Self { format, size, packing, laz: laz.map(Arc::new), schema })
    }

    /// Record length.
    pub fn size(&self) -> usize {
        self.size
    }

    pub(super) fn packing(&self) -> PointPacking {
        self.packing
    }

    /// The LASzip VLR.
    pub(super) fn vlr(&self) -> Option<&LazVlr> {
        self.laz.as_deref()
    }

    pub(super) fn format(&self) -> PointFormat {
        self.format
    }

    /// Encodes at most [`CHUNK`] points: a pure function.
    ///
    /// # Errors
    /// [`ErrorKind::Internal`] if the compressor fails.
    ///
    /// # Panics
    /// With more points than that.
    pub fn chunk(&self, records: &[PointRecord]) -> Result<PointChunk> {
        self.pack(self.records(records))
    }

    /// Uncompressed records of points, without extra bytes.
    pub fn records(&self, records: &[PointRecord]) -> Vec<u8> {
        let mut raw = Vec::new();
        self.format.encode(records, &mut raw);
        raw
    }

    /// Makes a chunk of uncompressed records: a pure function.
    ///
    /// # Errors
    /// [`ErrorKind::Internal`] if the compressor fails.
    ///
    /// # Panics
    /// With more than [`CHUNK`] records, if chunks have a fixed size.
    pub fn pack(&self, records: Vec<u8>) -> Result<PointChunk> {
        let tally = PointTally::of(&records, self.size, self.format.is_new());
        let fits = self.packing == PointPacking::Nodes || tally.count() <= CHUNK as u64;
        assert!(fits, "{} points are too many for a chunk", tally.count());
        let Some(vlr) = &self.laz else { return Ok(PointChunk { bytes: records, tally }) };
        let encoded = self.schema.as_ref().and_then(|schema| encode(&records, schema));
        let bytes = match encoded {
            Some(bytes) => bytes,
            None => compress(&records, vlr).map_err(|e| fault(&e))?,
        };
        Ok(PointChunk { bytes, tally })
    }
}

fn vlr(format: PointFormat, extra_bytes: u16, chunk: u32) -> Result<LazVlr> {
    let builder = LazVlrBuilder::default().with_fixed_chunk_size(chunk);
    let builder = builder.with_point_format(format.number(), extra_bytes).map_err(|e| fault(&e))?;
    Ok(builder.build())
}

/// The schema of records that [`LazEncoder`] compresses.
fn schema(vlr: &LazVlr) -> Option<LaszipSchema> {
    let items = vlr.items().iter().map(|item| LaszipItem {
        kind: item.item_type().into(),
        size: item.size(),
        version: item.version(),
    });
    LaszipSchema::new(&items.collect::<Vec<_>>()).ok().filter(LaszipSchema::is_encoded)
}

thread_local! {
    /// The models of an encoder are large, and take long to make for the small chunks of an octree.
    static ENCODER: RefCell<Option<Box<LazEncoder>>> = const { RefCell::new(None) };
}

/// Compresses one chunk; `None` for one without points.
fn encode(raw: &[u8], schema: &LaszipSchema) -> Option<Vec<u8>> {
    ENCODER.with_borrow_mut(|encoder| {
        encoder.get_or_insert_with(|| Box::new(LazEncoder::new())).chunk(schema, raw)
    })
}

fn fault(error: &dyn std::fmt::Display) -> Error {
    Error::new(ErrorKind::Internal, format!("the points cannot be compressed: {error}"))
}

/// Bytes of the chunk table offset, which the compressor writes first.
const OFFSET: usize = 8;

/// Compresses one chunk with the `laz` writer, which makes a whole stream: offset, chunk, and table.
fn compress(raw: &[u8], vlr: &LazVlr) -> laz::Result<Vec<u8>> {
    let packed = Vec::with_capacity(raw.len() / 2);
    let mut compressor = LasZipCompressor::new(Cursor::new(packed), vlr.clone())?;
    compressor.compress_many(raw)?;
    compressor.done()?;
    let mut bytes = compressor.into_inner().into_inner();
    let (offset, _) =
        bytes.split_first_chunk::<OFFSET>().ok_or(laz::LasZipError::MissingChunkTable)?;
    bytes.truncate(u64::from_le_bytes(*offset) as usize);
    bytes.drain(..OFFSET);
    Ok(bytes)
}

/// Points and bytes of a chunk.
pub(super) type Entry = [u32; 2];

/// The chunk table of a LAZ file: version, number of chunks, and arithmetically coded differences of their sizes,
/// with numbers of points if these vary.
pub(super) fn table(entries: &[Entry], packing: PointPacking) -> io::Result<Vec<u8>> {
    /// Contexts of numbers of points and of sizes.
    const MODELS: [u32; 2] = [0, 1];
    let mut table = [0_u32.to_le_bytes(), (entries.len() as u32).to_le_bytes()].concat();
    if entries.is_empty() {
        return Ok(table);
    }
    let mut encoder = ArithmeticEncoder::new(&mut table);
    let mut compressor = IntegerCompressorBuilder::new().bits(32).contexts(2).build_initialized();
    let first = if packing == PointPacking::Nodes { 0 } else { 1 };
    let mut last = [0; 2];
    for entry in entries {
        for field in first..2 {
            let value = entry[field] as i32;
            compressor.compress(&mut encoder, last[field], value, MODELS[field])?;
            last[field] = value;
        }
    }
    encoder.done()?;
    Ok(table)
}
