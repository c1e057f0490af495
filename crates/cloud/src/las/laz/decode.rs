//! Decoding of chunks and streams: bytes and a number of points in, fields of points out, in blocks of some thousand,
//! so that memory is bounded whatever a file states.
//!
//! Streams have no checksum, and a damaged one continues to yield plausible points. Damage is detected at the end of
//! a stream: encoders leave it in one of few states, at the last byte, and a wrongly decoded stream hardly ever ends
//! there.

use crate::lazip::{
    self, ChunkStream, CompressedChunk, DecodedFields, FieldSelection, LazDecoder, UnchunkedStream,
};
use terrane_base::error::Result;
use terrane_files::RawFile;

use super::{LazCompressor, LazLayout, layers};

/// Maximum points of a block, and bytes of their records.
const BLOCK: u64 = 8192;
const BLOCK_BYTES: usize = 1 << 20;
/// Bytes of the window of a stream, unless the stream is shorter.
const WINDOW: usize = 1 << 20;
/// Maximum symbols of a point in addition to one for each byte of its record, and bytes of a symbol.
const MAX_SYMBOLS: usize = 128;
const MAX_SYMBOL_BYTES: usize = 3;

/// The result, or a description of the damage.
pub(crate) type Decoded<T> = Result<std::result::Result<T, String>>;

/// Consumer of blocks of points.
type Each<'a> = dyn FnMut(&DecodedFields) -> Result<()> + 'a;

/// A decoder with its buffers, reused between chunks.
#[derive(Default)]
pub(crate) struct ChunkDecoder {
    decoder: LazDecoder,
    fields: DecodedFields,
    window: Vec<u8>,
}

impl ChunkDecoder {
    /// Decodes a chunk of `count` points. Unselected fields have arbitrary values.
    ///
    /// # Errors
    /// Errors of `each`.
    pub(crate) fn chunk(
        &mut self,
        layout: &LazLayout,
        bytes: &[u8],
        count: u64,
        wanted: FieldSelection,
        each: &mut Each<'_>,
    ) -> Decoded<()> {
        if layout.compressor == LazCompressor::Layers
            && let Err(what) = check(layout, bytes, count)
        {
            return Ok(Err(what));
        }
        let chunk = CompressedChunk { bytes, count: count as usize };
        let block = if wanted.records { records_at_once(layout) } else { BLOCK };
        match self.decoder.stream(&layout.schema, chunk, wanted) {
            Ok(stream) => go(stream, count, block, &mut self.fields, each),
            Err(what) => Ok(Err(what.to_string())),
        }
    }

    /// Decodes the `count` points of the stream at byte `at` of `file`; returns its length in bytes. Unselected
    /// fields have arbitrary values.
    ///
    /// # Errors
    /// Errors of `each` and of reading.
    pub(crate) fn stream(
        &mut self,
        layout: &LazLayout,
        file: &RawFile,
        at: u64,
        count: u64,
        wanted: FieldSelection,
        each: &mut Each<'_>,
    ) -> Decoded<u64> {
        let Self { decoder, fields, window } = self;
        window.clear();
        let mut window = LazStreamWindow { file, end: at, bytes: window };
        window.fill()?;
        let mut flow = match decoder.flow(&layout.schema, window.bytes, wanted) {
            Ok((flow, left)) => window.keep(left, flow),
            Err(what) => return Ok(Err(what.to_string())),
        };
        let mut left = count;
        while left > 0 {
            window.fill()?;
            fields.clear();
            let points = points_at_once(layout).min(left);
            if let Err(what) = window.read(&mut flow, points, fields) {
                return Ok(Err(what.to_string()));
            }
            each(fields)?;
            left -= points;
        }
        window.fill()?;
        let end = flow.end(window.bytes);
        Ok(end.map(|behind| window.end - behind as u64 - at).map_err(|what| what.to_string()))
    }
}

/// Number of points of a block with records.
fn records_at_once(layout: &LazLayout) -> u64 {
    (BLOCK_BYTES / layout.record.max(1)).clamp(1, BLOCK as usize) as u64
}

/// Number of points that a full window certainly holds.
fn points_at_once(layout: &LazLayout) -> u64 {
    let max_bytes = MAX_SYMBOL_BYTES * (MAX_SYMBOLS + layout.record);
    (WINDOW / max_bytes).max(1).min(BLOCK as usize) as u64
}

/// A window of a stream.
struct LazStreamWindow<'a> {
    file: &'a RawFile,
    /// Offset in the file of the end of `bytes`.
    end: u64,
    bytes: &'a mut Vec<u8>,
}

impl LazStreamWindow<'_> {
    /// Reads until the window is full or the file ends.
    fn fill(&mut self) -> Result<()> {
        let there = self.bytes.len();
        let more = (self.file.size() - self.end).min(WINDOW.saturating_sub(there) as u64);
        self.bytes.resize(there + more as usize, 0);
        self.file.read_at(self.end, &mut self.bytes[there..])?;
        self.end += more;
        Ok(())
    }

    /// Drops all but the last `left` bytes.
    fn keep<T>(&mut self, left: usize, result: T) -> T {
        self.bytes.drain(..self.bytes.len() - left);
        result
    }

    fn read(
        &mut self,
        flow: &mut UnchunkedStream<'_>,
        points: u64,
        fields: &mut DecodedFields,
    ) -> std::result::Result<(), lazip::ChunkDamage> {
        let left = flow.read(self.bytes, points as usize, fields)?;
        self.keep(left, Ok(()))
    }
}

/// Passes on `count` points of a chunk in blocks of `block`.
fn go(
    mut stream: ChunkStream<'_, '_>,
    count: u64,
    block: u64,
    fields: &mut DecodedFields,
    each: &mut Each<'_>,
) -> Decoded<()> {
    let mut left = count;
    while left > 0 {
        fields.clear();
        let points = block.min(left);
        if let Err(what) = stream.read(points as usize, fields) {
            return Ok(Err(what.to_string()));
        }
        each(fields)?;
        left -= points;
    }
    Ok(match stream.end() {
        Ok(0) => Ok(()),
        Ok(bytes) => Err(format!("{bytes} bytes follow the last point")),
        Err(what) => Err(what.to_string()),
    })
}

/// Checks that the layers lie in the chunk, and that the number of points matches the file.
fn check(layout: &LazLayout, bytes: &[u8], count: u64) -> std::result::Result<(), String> {
    if (bytes.len() as u64) < layers::head_bytes(layout) {
        return Err(format!("{} bytes are too short for the chunk header", bytes.len()));
    }
    let (points, claimed) = layers::claims(layout, bytes);
    if claimed > bytes.len() as u64 {
        return Err(format!("the layers state {claimed} bytes, the chunk has {}", bytes.len()));
    }
    if points != count {
        return Err(format!("the chunk states {points} points, expected {count}"));
    }
    Ok(())
}
