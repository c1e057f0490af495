//! Chunks: runs of points as they are stored, compressed for LAZ.

use std::io::{self, Cursor};
use std::sync::Arc;

use laz::compressors::IntegerCompressorBuilder;
use laz::encoders::ArithmeticEncoder;
use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};

use super::tally::Tally;
use super::{PointFormat, Record};
use terrane_base::error::{Error, ErrorKind, Result};

/// Points of a chunk, the usual number in LAZ files.
pub const CHUNK: usize = 50_000;

/// How points become bytes.
#[derive(Clone, Debug)]
pub struct Layout {
    format: PointFormat,
    /// How they are compressed, if they are.
    laz: Option<Arc<LazVlr>>,
}

/// Points ready to be written.
#[derive(Clone, Debug)]
pub struct Chunk {
    pub(super) bytes: Vec<u8>,
    pub(super) tally: Tally,
}

impl Chunk {
    /// How many points it holds.
    pub fn points(&self) -> usize {
        self.tally.count() as usize
    }
}

impl Layout {
    pub(super) fn new(format: PointFormat, compress: bool) -> Result<Self> {
        let laz = compress.then(|| vlr(format)).transpose()?;
        Ok(Self { format, laz: laz.map(Arc::new) })
    }

    pub(super) fn is_compressed(&self) -> bool {
        self.laz.is_some()
    }

    /// The record that tells how points are compressed.
    pub(super) fn vlr(&self) -> Option<&LazVlr> {
        self.laz.as_deref()
    }

    pub(super) fn format(&self) -> PointFormat {
        self.format
    }

    /// Makes a chunk of at most [`CHUNK`] points: a pure function of them.
    ///
    /// # Errors
    /// [`ErrorKind::Internal`] when the compressor fails, which it has no reason to.
    ///
    /// # Panics
    /// With more points than that.
    pub fn chunk(&self, records: &[Record]) -> Result<Chunk> {
        assert!(records.len() <= CHUNK, "{} points are too many for a chunk", records.len());
        let mut raw = Vec::new();
        self.format.encode(records, &mut raw);
        let tally = Tally::of(records);
        let Some(vlr) = &self.laz else { return Ok(Chunk { bytes: raw, tally }) };
        let bytes = compress(&raw, vlr).map_err(|e| fault(&e))?;
        Ok(Chunk { bytes, tally })
    }
}

fn vlr(format: PointFormat) -> Result<LazVlr> {
    let builder = LazVlrBuilder::default().with_fixed_chunk_size(CHUNK as u32);
    let builder = builder.with_point_format(format.number(), 0).map_err(|e| fault(&e))?;
    Ok(builder.build())
}

fn fault(error: &dyn std::fmt::Display) -> Error {
    Error::new(ErrorKind::Internal, format!("the points cannot be compressed: {error}"))
}

/// Bytes of the offset to the table of chunks, which the compressor puts first.
const OFFSET: usize = 8;

/// One chunk by the compressor, which makes a whole stream of it: an offset, the chunk, and a table.
fn compress(raw: &[u8], vlr: &LazVlr) -> laz::Result<Vec<u8>> {
    let room = Vec::with_capacity(raw.len() / 2);
    let mut compressor = LasZipCompressor::new(Cursor::new(room), vlr.clone())?;
    compressor.compress_many(raw)?;
    compressor.done()?;
    let mut bytes = compressor.into_inner().into_inner();
    let (offset, _) =
        bytes.split_first_chunk::<OFFSET>().ok_or(laz::LasZipError::MissingChunkTable)?;
    bytes.truncate(u64::from_le_bytes(*offset) as usize);
    bytes.drain(..OFFSET);
    Ok(bytes)
}

/// The table of chunks of a LAZ file: version, number, and their sizes, coded arithmetically as
/// differences.
pub(super) fn table(sizes: &[u32]) -> io::Result<Vec<u8>> {
    /// Model of sizes; the other one is for numbers of points, which chunks of one number need not.
    const SIZES: u32 = 1;
    let mut table = [0_u32.to_le_bytes(), (sizes.len() as u32).to_le_bytes()].concat();
    if sizes.is_empty() {
        return Ok(table);
    }
    let mut encoder = ArithmeticEncoder::new(&mut table);
    let mut compressor = IntegerCompressorBuilder::new().bits(32).contexts(2).build_initialized();
    let mut last = 0;
    for size in sizes.iter().map(|size| *size as i32) {
        compressor.compress(&mut encoder, last, size, SIZES)?;
        last = size;
    }
    encoder.done()?;
    Ok(table)
}
