//! A decoder of compressed chunks of points (LASzip): the fields that grids and meshes need, or whole
//! records, byte for byte as they stand in a file that is not compressed.
//!
//! Pure functions on bytes: no file, no thread. Bytes may be hostile: whatever they are, the decoder
//! yields the points asked for or says what is damaged, in time and memory proportional to the bytes
//! and points it is given.
//!
//! Most of the time of decoding is spent waiting: each symbol narrows an interval that the next one
//! depends on. So symbols are found without branches that depend on them, and each layer is decoded in a
//! loop of its own, whose state stays in registers.
//!
//! The layers that a filter needs are decoded into columns, some thousand points at a time, so that
//! memory does not depend on what a chunk claims. The layers that only whole records need follow once it
//! is known of so many points where they are and what changes with them, so that nobody else waits for
//! them. Files that are one stream (before LASzip had chunks)
//! pass through a window, as they need not fit in memory, and so do chunks whose table is lost, to find
//! where they end.
//!
//! **Why a damaged chunk is given up whole.** Nothing in it is under a checksum, and what is decoded
//! behind the damage looks like points for long: the first point that cannot be is far behind the first
//! that is invented. What tells is the end. An arithmetic encoder leaves its stream in one of a few
//! states, at the last byte; a decoder that took one wrong turn anywhere is elsewhere by then. The
//! heights' contexts are those of x and y, so damage to one layer shows in the other, too. Salvage
//! therefore decodes a chunk twice, first to look at its end, its bounds and its returns, and then to
//! hand it on; without salvage the end is looked at all the same, and a chunk that does not end is an
//! error. The crate `laz` does not look at the end of its streams; it compresses, and is an oracle in tests.

mod attributes;
mod body;
mod channels;
mod chunk;
mod coder;
mod colour;
mod fields;
mod follow;
mod heights;
mod integer;
mod layered;
mod machine;
mod marks;
mod median;
mod model;
mod old;
mod packet;
mod places;
mod point;
mod pointwise;
mod rest;
mod returns;
mod schema;
mod streams;
mod tails;
mod time;
mod trace;

use layered::LayeredState;
use pointwise::Pointwise;
use schema::ChunkLayout;

pub use chunk::{ChunkDamage, CompressedChunk, LazLayer};
pub use fields::{DecodedFields, FieldSelection};
pub use schema::{LaszipItem, LaszipSchema};

/// Decodes chunks; one per thread, used again and again. It keeps some 1 MiB, once whole records were
/// wanted some 2 MiB, and for each extra byte a KiB in each scanner channel that there was.
#[derive(Default)]
pub struct LazDecoder {
    layered: LayeredState,
    pointwise: Pointwise,
}

impl LazDecoder {
    /// A decoder that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends the points of a chunk to `fields`.
    ///
    /// # Errors
    /// Damage, found wherever it shows; none of the chunk's points are appended then.
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

    /// The points of a chunk, to be read in batches.
    ///
    /// # Errors
    /// Damage to the chunk's head.
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

    /// The points of a stream that begins with `bytes`, to be read in batches from windows, and how many
    /// of the bytes are left over. Fields must share one stream.
    ///
    /// # Errors
    /// Bytes that do not hold the first point.
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

/// Points of a chunk, a batch after another.
pub struct ChunkStream<'d, 'a>(ChunkStreamKind<'d, 'a>);

enum ChunkStreamKind<'d, 'a> {
    Layered(layered::LayeredChunkDecoder<'d, 'a>),
    Pointwise(&'d mut Pointwise, pointwise::PointwiseStream<'a>),
}

impl ChunkStream<'_, '_> {
    /// Appends the next `count` points to `fields`.
    ///
    /// # Errors
    /// Damage so far; none of the `count` points are appended then.
    pub fn read(&mut self, count: usize, fields: &mut DecodedFields) -> Result<(), ChunkDamage> {
        let before = fields.mark();
        fields.reserve(count);
        let done = match &mut self.0 {
            ChunkStreamKind::Layered(run) => run.read(count, fields),
            ChunkStreamKind::Pointwise(pointwise, run) => run.read(pointwise, count, fields),
        };
        done.inspect_err(|_| fields.truncate(before))
    }

    /// Bytes of the chunk behind its only stream, or 0 where fields are layers; all of its points must
    /// have been read.
    ///
    /// # Errors
    /// A stream that does not end here as encoders end them, or a layer that goes on: some of what
    /// was read from it was damaged, and nothing tells from which point on.
    pub fn end(&self) -> Result<usize, ChunkDamage> {
        match &self.0 {
            ChunkStreamKind::Layered(run) => run.end().map(|()| 0),
            ChunkStreamKind::Pointwise(_, run) => run.end(),
        }
    }
}

/// A stream without chunks, whose bytes are given a window at a time.
pub struct UnchunkedStream<'d>(&'d mut Pointwise, pointwise::PointwiseStream<'static>);

impl UnchunkedStream<'_> {
    /// Appends the next `count` points to `fields`, from `bytes`, which begin with the first byte not
    /// yet taken in; returns how many of them are left over.
    ///
    /// # Errors
    /// Damage so far, or bytes that do not suffice.
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

    /// How many of `bytes`, which begin with the first byte not yet taken in, are behind the stream.
    ///
    /// # Errors
    /// As for [`ChunkStream::end`].
    pub fn end(&self, bytes: &[u8]) -> Result<usize, ChunkDamage> {
        self.1.with(bytes).end()
    }
}

#[cfg(test)]
mod tests;
