//! Encoder of layered chunks (point formats 6 to 8), with the models of the decoder.
//!
//! The layers of a chunk that are constant are left out, so the fields that change are found first, and no time is spent
//! on others.

use super::attributes::{AttributeEncoders, ChannelHeads, time};
use super::class_flags::{ClassMark, Flag, MarkContext};
use super::coordinates::{DecodedPosition, PositionContext};
use super::extended_items::ChunkTails;
use super::heights::HeightContext;
use super::machine::{InstructionSet, SimdTask, run};
use super::point::{LazPoint, RECORD};
use super::range_encoder::RangeEncoder;
use super::record_items::ItemContext;
use super::schema::{ChunkLayout, LaszipSchema, LayeredSchema};
use super::trace::{ANGLE, SOURCE, TIME};

/// Encodes chunks; one per thread, reused. It takes some 2 MiB.
pub(crate) struct LazEncoder {
    places: PositionContext,
    heights: HeightContext,
    classes: MarkContext<ClassMark, 16>,
    flags: MarkContext<Flag, 4>,
    heads: ChannelHeads,
    tails: ChunkTails,
    /// The points of a chunk, without heights.
    positions: Vec<DecodedPosition>,
}

impl LaszipSchema {
    /// Whether [`LazEncoder`] encodes chunks of these records.
    pub(crate) fn is_encoded(&self) -> bool {
        self.encoded().is_some()
    }

    fn encoded(&self) -> Option<&LayeredSchema> {
        match &self.layout {
            ChunkLayout::Layered(layers) => {
                layers.layers.iter().all(|layer| ItemContext::is_encoded(*layer)).then_some(layers)
            }
            ChunkLayout::Pointwise(_) => None,
        }
    }
}

impl LazEncoder {
    pub(crate) fn new() -> Self {
        Self {
            places: PositionContext::new(),
            heights: HeightContext::new(),
            classes: MarkContext::new(),
            flags: MarkContext::new(),
            heads: ChannelHeads::new(),
            tails: ChunkTails::default(),
            positions: Vec::new(),
        }
    }

    /// The chunk of at least one whole record; `None` if records are not of a [known](LaszipSchema::is_encoded) schema.
    pub(crate) fn chunk(&mut self, schema: &LaszipSchema, records: &[u8]) -> Option<Vec<u8>> {
        let layers = schema.encoded()?;
        let chunk = ChunkRecords::new(records, RECORD + layers.bytes)?;
        let first = chunk.head(0)?;
        let (point, channel) = LazPoint::new(first);
        self.places.begin(channel, &point);
        self.heights.begin(channel, point.place[2]);
        self.classes.begin(channel, point.class);
        self.flags.begin(channel, point.flags);
        self.heads.begin(channel, first);
        self.tails.begin(layers, channel, chunk.tail(0));
        let streams = run(LayeredChunkTask { encoder: self, chunk: &chunk, layers });
        Some(chunk.assembled(streams))
    }
}

/// The records of a chunk.
struct ChunkRecords<'a> {
    records: &'a [u8],
    size: usize,
    count: usize,
}

impl<'a> ChunkRecords<'a> {
    fn new(records: &'a [u8], size: usize) -> Option<Self> {
        let count = records.len() / size;
        (count > 0 && count * size == records.len()).then_some(Self { records, size, count })
    }

    fn head(&self, at: usize) -> Option<&'a [u8; RECORD]> {
        self.records[at * self.size..].first_chunk()
    }

    fn tail(&self, at: usize) -> &'a [u8] {
        &self.records[at * self.size + RECORD..(at + 1) * self.size]
    }

    /// Records and their common fields, after the first.
    fn heads(&self) -> impl Iterator<Item = &'a [u8; RECORD]> {
        self.records.chunks_exact(self.size).skip(1).filter_map(|record| record.first_chunk())
    }

    /// A stream for a field that is not the same in all records.
    fn stream<T: PartialEq>(&self, field: impl Fn(&'a [u8]) -> T) -> Option<RangeEncoder> {
        let mut records = self.records.chunks_exact(self.size).map(field);
        let first = records.next()?;
        records.any(|field| field != first).then(RangeEncoder::new)
    }

    /// The first record, the number of points, the sizes of the streams, and the streams.
    fn assembled(&self, streams: Vec<Option<RangeEncoder>>) -> Vec<u8> {
        let streams = streams.into_iter().map(|stream| stream.map(RangeEncoder::finish));
        let streams: Vec<_> = streams.map(Option::unwrap_or_default).collect();
        let mut bytes = self.records[..self.size].to_vec();
        bytes.extend((self.count as u32).to_le_bytes());
        streams.iter().for_each(|stream| bytes.extend((stream.len() as u32).to_le_bytes()));
        streams.iter().for_each(|stream| bytes.extend_from_slice(stream));
        bytes
    }
}

/// A chunk whose contexts hold its first point.
struct LayeredChunkTask<'e, 'a> {
    encoder: &'e mut LazEncoder,
    chunk: &'e ChunkRecords<'a>,
    layers: &'e LayeredSchema,
}

impl SimdTask for LayeredChunkTask<'_, '_> {
    /// The streams of the layers, in order.
    type Result = Vec<Option<RangeEncoder>>;

    #[inline(always)]
    fn work<M: InstructionSet>(self, _: M) -> Self::Result {
        let Self { encoder, chunk, layers } = self;
        let (mut places, mut heights) = (RangeEncoder::new(), RangeEncoder::new());
        encoder.put_places::<M>(chunk, &mut places);
        let LazEncoder { positions, classes, flags, .. } = encoder;
        for (head, at) in chunk.heads().zip(&*positions) {
            encoder.heights.put(&mut heights, at, LazPoint::new(head).0.place[2]);
        }
        let mut class_stream = chunk.stream(|record| record[16]);
        if let Some(coder) = &mut class_stream {
            chunk.heads().zip(&*positions).for_each(|(head, at)| classes.put(coder, at, head[16]));
        }
        let mut flag_stream = chunk.stream(|record| record[15] & !0x30);
        if let Some(coder) = &mut flag_stream {
            for (head, at) in chunk.heads().zip(&*positions) {
                flags.put(coder, at, LazPoint::new(head).0.flags);
            }
        }
        let rest = encoder.put_attributes(chunk);
        let tails = encoder.put_tails(chunk, layers);
        let shared = [Some(places), Some(heights), class_stream, flag_stream];
        let attributes = [rest.intensities, rest.angles, rest.user_data, rest.sources, rest.times];
        shared.into_iter().chain(attributes).chain(tails).collect()
    }
}

impl LazEncoder {
    #[inline(always)]
    fn put_places<M: InstructionSet>(
        &mut self,
        chunk: &ChunkRecords<'_>,
        coder: &mut RangeEncoder,
    ) {
        let mut changes = RecordChanges::new(chunk);
        self.positions.clear();
        for head in chunk.heads() {
            let (point, channel) = LazPoint::new(head);
            let changes = changes.next(head, channel);
            self.positions.push(self.places.put::<M>(coder, &point, channel, changes));
        }
    }

    #[inline(always)]
    fn put_attributes(&mut self, chunk: &ChunkRecords<'_>) -> AttributeEncoders {
        let mut streams = AttributeEncoders {
            intensities: chunk.stream(|record| [record[12], record[13]]),
            angles: chunk.stream(|record| [record[18], record[19]]),
            user_data: chunk.stream(|record| record[17]),
            sources: chunk.stream(|record| [record[20], record[21]]),
            times: chunk
                .stream(|record| record.first_chunk().map(|head| f64::from_bits(time(head)))),
        };
        for (head, at) in chunk.heads().zip(&self.positions) {
            self.heads.encode(&mut streams, at.trace, at.returns, head);
        }
        streams
    }

    /// The streams of the fields after the common ones.
    #[inline(always)]
    fn put_tails(
        &mut self,
        chunk: &ChunkRecords<'_>,
        layers: &LayeredSchema,
    ) -> Vec<Option<RangeEncoder>> {
        let mut at = RECORD;
        let streams = layers.layers.iter().map(|layer| {
            let field = at..at + ItemContext::of(*layer).size();
            at = field.end;
            chunk.stream(|record| &record[field.clone()])
        });
        let mut streams: Vec<_> = streams.collect();
        if streams.iter().any(Option::is_some) {
            for (number, at) in (1..).zip(&self.positions) {
                self.tails.put(&mut streams, at.trace, chunk.tail(number));
            }
        }
        streams
    }
}

/// Finds the changes of fields that the layer of positions tells, besides returns and channels.
struct RecordChanges<'a> {
    /// The last record of each channel.
    last: [Option<&'a [u8; RECORD]>; 4],
    current: usize,
}

impl<'a> RecordChanges<'a> {
    fn new(chunk: &ChunkRecords<'a>) -> Self {
        let first = chunk.head(0);
        let current = first.map_or(0, |first| LazPoint::new(first).1);
        let mut last = [None; 4];
        last[current & 3] = first;
        Self { last, current }
    }

    /// The changes of the next record, from the last one of its channel, or from the previous one in a new channel.
    #[inline(always)]
    fn next(&mut self, record: &'a [u8; RECORD], channel: usize) -> usize {
        let last = self.last[channel & 3].or(self.last[self.current & 3]).unwrap_or(record);
        self.last[channel & 3] = Some(record);
        self.current = channel;
        // Times are compared as numbers, as LASzip does.
        let is_later = f64::from_bits(time(last)) != f64::from_bits(time(record));
        (usize::from(last[20..22] != record[20..22]) * SOURCE)
            | (usize::from(is_later) * TIME)
            | (usize::from(last[18..20] != record[18..20]) * ANGLE)
    }
}
