//! A decoder of compressed chunks of points (LASzip): selected fields, or whole records, byte for byte as in an
//! uncompressed file. And an encoder of the layered chunks of formats 6 to 8, which writes the bytes that the crate
//! `laz` writes.
//!
//! Pure functions on bytes, without files and threads. Input may be hostile: the decoder yields the requested points
//! or reports the damage, in time and memory proportional to the given bytes and points.
//!
//! Decoding is bound by latency: each symbol narrows an interval that the next one depends on. So symbols are found
//! without branches that depend on them, and each layer is decoded in a loop of its own, with its state in registers.
//!
//! Layers for filters are decoded into columns in blocks of some thousand points, so that memory does not depend on
//! the stated size of a chunk. Layers for whole records only are decoded afterwards, when positions and changes of a
//! block are known, at no cost for others. Files with a single stream (before LASzip had chunks) are read through a
//! window, as they need not fit in memory; so are chunks without a chunk table, to find their ends.
//!
//! **Why a damaged chunk is dropped as a whole.** Chunks have no checksum, and damaged bytes decode to plausible
//! points: the first impossible point is far behind the first wrong one. Damage is detected at the end. An arithmetic
//! encoder leaves its stream in one of a few states, at the last byte; a decoder that went wrong anywhere is in
//! another state. The contexts of heights depend on x and y, so damage to one layer shows in the other, too. Salvage
//! therefore decodes a chunk twice: first to check its end, bounds and returns, then to pass it on. Without salvage
//! the end is checked as well, and a chunk with a wrong end is an error. The crate `laz` does not check the end of
//! its streams; it compresses what the encoder does not, and is the reference in tests.

mod attributes;
mod body;
mod channels;
mod chunk;
mod class_flags;
mod coder;
mod colour;
mod coordinates;
mod extended_items;
mod fields;
mod heights;
mod integer;
mod layered;
mod layered_encoder;
mod machine;
mod median;
mod model;
mod old;
mod packet;
mod point;
mod pointwise;
mod range_encoder;
mod record_items;
mod record_layers;
mod returns;
mod schema;
mod streams;
mod time;
mod trace;

use layered::LayeredState;
use pointwise::Pointwise;
use schema::ChunkLayout;

pub use chunk::{ChunkDamage, CompressedChunk, LazLayer};
pub use fields::{DecodedFields, FieldSelection};
pub(crate) use layered_encoder::LazEncoder;
pub use schema::{LaszipItem, LaszipSchema};

/// Decodes chunks; one per thread, reused. It takes some 1 MiB, with whole records some 2 MiB, and for each extra
/// byte a KiB for each scanner channel.
#[derive(Default)]
pub struct LazDecoder {
    layered: LayeredState,
    pointwise: Pointwise,
}

impl LazDecoder {
    /// A new decoder.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends the points of a chunk to `fields`.
    ///
    /// # Errors
    /// Damage anywhere in the chunk; then no points are appended.
    pub fn chunk(
        &mut self,
        schema: &LaszipSchema,
        chunk: CompressedChunk,
        wanted: FieldSelection,
        fields: &mut DecodedFields,
    ) -> Result<(), ChunkDamage> {
        match chunk.count {
            0 => Ok(()),
            count => self.stream(schema, chunk, wanted)?.read(count, fields),
        }
    }

    /// The points of a chunk, for reading in batches.
    ///
    /// # Errors
    /// Damage to the chunk header.
    pub fn stream<'d, 'a>(
        &'d mut self,
        schema: &LaszipSchema,
        chunk: CompressedChunk<'a>,
        wanted: FieldSelection,
    ) -> Result<ChunkStream<'d, 'a>, ChunkDamage> {
        Ok(ChunkStream(match &schema.layout {
            ChunkLayout::Layered(layers) => ChunkStreamKind::Layered(
                layered::LayeredChunkDecoder::new(&mut self.layered, layers, chunk, wanted)?,
            ),
            ChunkLayout::Pointwise(records) => {
                let run = pointwise::PointwiseStream::new(
                    &mut self.pointwise,
                    records,
                    chunk.bytes,
                    wanted,
                )?;
                ChunkStreamKind::Pointwise(&mut self.pointwise, run)
            }
        }))
    }

    /// The points of a stream that begins with `bytes`, for reading in batches from windows, and the number of unused
    /// bytes. Fields must share one stream.
    ///
    /// # Errors
    /// Bytes too few for the first point.
    pub fn flow(
        &mut self,
        schema: &LaszipSchema,
        bytes: &[u8],
        wanted: FieldSelection,
    ) -> Result<(UnchunkedStream<'_>, usize), ChunkDamage> {
        let ChunkLayout::Pointwise(records) = &schema.layout else {
            return Err(ChunkDamage::Layer(LazLayer::Records));
        };
        let run = pointwise::PointwiseStream::new(&mut self.pointwise, records, bytes, wanted)?;
        Ok((UnchunkedStream(&mut self.pointwise, run.with(&[])), run.left()))
    }
}

/// Points of a chunk in batches.
pub struct ChunkStream<'d, 'a>(ChunkStreamKind<'d, 'a>);

enum ChunkStreamKind<'d, 'a> {
    Layered(layered::LayeredChunkDecoder<'d, 'a>),
    Pointwise(&'d mut Pointwise, pointwise::PointwiseStream<'a>),
}

impl ChunkStream<'_, '_> {
    /// Appends the next `count` points to `fields`.
    ///
    /// # Errors
    /// Damage so far; then none of the `count` points are appended.
    pub fn read(&mut self, count: usize, fields: &mut DecodedFields) -> Result<(), ChunkDamage> {
        let before = fields.mark();
        fields.reserve(count);
        let done = match &mut self.0 {
            ChunkStreamKind::Layered(run) => run.read(count, fields),
            ChunkStreamKind::Pointwise(pointwise, run) => run.read(pointwise, count, fields),
        };
        done.inspect_err(|_| fields.truncate(before))
    }

    /// Bytes of the chunk after its only stream, or 0 with layers; all of its points must have been read.
    ///
    /// # Errors
    /// A stream that does not end here as encoders end it, or a layer with surplus bytes: some points are wrong, and
    /// it is unknown from which one on.
    pub fn end(&self) -> Result<usize, ChunkDamage> {
        match &self.0 {
            ChunkStreamKind::Layered(run) => run.end().map(|()| 0),
            ChunkStreamKind::Pointwise(_, run) => run.end(),
        }
    }
}

/// A stream without chunks, read through windows of bytes.
pub struct UnchunkedStream<'d>(&'d mut Pointwise, pointwise::PointwiseStream<'static>);

impl UnchunkedStream<'_> {
    /// Appends the next `count` points to `fields`, from `bytes`, which begin with the first unread byte; returns the
    /// number of unused bytes.
    ///
    /// # Errors
    /// Damage so far, or too few bytes.
    pub fn read(
        &mut self,
        bytes: &[u8],
        count: usize,
        fields: &mut DecodedFields,
    ) -> Result<usize, ChunkDamage> {
        let mut run = self.1.with(bytes);
        run.read(self.0, count, fields)?;
        let left = run.left();
        self.1 = run.with(&[]);
        Ok(left)
    }

    /// Number of `bytes`, which begin with the first unread byte, after the end of the stream.
    ///
    /// # Errors
    /// As for [`ChunkStream::end`].
    pub fn end(&self, bytes: &[u8]) -> Result<usize, ChunkDamage> {
        self.1.with(bytes).end()
    }
}

#[cfg(test)]
mod tests;
