//! Chunks of point formats 6 to 10: each group of fields is a layer with its own stream.

use super::body::LayeredChunk;
use super::chunk::{ChunkDamage, CompressedChunk};
use super::class_flags::{ClassMark, Flag, MarkContext};
use super::coordinates::PositionContext;
use super::fields::{DecodedFields, FieldSelection};
use super::heights::HeightContext;
use super::machine::{InstructionSet, PortableInstructions, SimdTask, run};
use super::point::LazPoint;
use super::record_layers::{self, RestLayers};
use super::schema::LayeredSchema;
use super::streams::Streams;
use super::trace::PointChanges;

/// State reused between chunks.
#[derive(Default)]
pub(super) struct LayeredState {
    columns: Option<Box<LayeredContext>>,
    /// `None` until whole records are requested.
    rest: Option<record_layers::RestContext>,
}

/// Decoder contexts of the columns, and the data that they share.
struct LayeredContext {
    places: PositionContext,
    heights: HeightContext,
    classes: MarkContext<ClassMark, 16>,
    flags: MarkContext<Flag, 4>,
    /// Changes of the points of a batch.
    traces: Vec<PointChanges>,
}

impl LayeredContext {
    fn boxed() -> Box<Self> {
        Box::new(Self {
            places: PositionContext::new(),
            heights: HeightContext::new(),
            classes: MarkContext::new(),
            flags: MarkContext::new(),
            traces: Vec::new(),
        })
    }

    /// Begins a chunk with a first point in `channel`.
    fn begin(&mut self, channel: usize, first: &LazPoint) {
        self.places.begin(channel, first);
        self.heights.begin(channel, first.place[2]);
        self.classes.begin(channel, first.class);
        self.flags.begin(channel, first.flags);
    }
}

/// A chunk being decoded in batches.
pub(super) struct LayeredChunkDecoder<'d, 'a> {
    columns: &'d mut LayeredContext,
    streams: Streams<'a, PortableInstructions>,
    /// The first point and its record, until passed on.
    first: Option<(LazPoint, &'a [u8])>,
    /// `None` if whole records are not requested.
    rest: Option<Box<RestLayers<'d, 'a>>>,
}

impl<'d, 'a> LayeredChunkDecoder<'d, 'a> {
    /// Begins with the record of the first point.
    pub(super) fn new(
        layered: &'d mut LayeredState,
        layers: &LayeredSchema,
        chunk: CompressedChunk<'a>,
        wanted: FieldSelection,
    ) -> Result<Self, ChunkDamage> {
        let body = LayeredChunk::new(chunk, layers)?;
        let streams = body.streams(wanted)?;
        let record = body.record;
        let (first, channel) = LazPoint::new(record.first_chunk().ok_or(ChunkDamage::Short)?);
        let columns = layered.columns.get_or_insert_with(LayeredContext::boxed);
        columns.begin(channel, &first);
        let rest = match wanted.records {
            true => {
                let context = layered.rest.get_or_insert_with(record_layers::RestContext::new);
                Some(Box::new(RestLayers::new(context, body, layers, channel)?))
            }
            false => None,
        };
        Ok(Self { columns, streams, first: Some((first, record)), rest })
    }

    /// Decodes the next `count` points.
    pub(super) fn read(
        &mut self,
        count: usize,
        fields: &mut DecodedFields,
    ) -> Result<(), ChunkDamage> {
        let left = self.begin(count, fields);
        run(LayeredBatch { run: self, left, fields });
        self.streams.check(|coder| coder.is_sound())?;
        let traces = &self.columns.traces;
        self.rest.as_mut().map_or(Ok(()), |rest| rest.read(traces, fields))
    }

    /// Fails unless all streams end here.
    pub(super) fn end(&self) -> Result<(), ChunkDamage> {
        self.streams.check(|coder| coder.is_all())?;
        self.rest.as_deref().map_or(Ok(()), RestLayers::end)
    }

    /// Passes on the first point; returns the rest of `count`.
    fn begin(&mut self, count: usize, fields: &mut DecodedFields) -> usize {
        fields.reserve(count);
        let Some((first, record)) = self.first.take_if(|_| count > 0) else { return count };
        fields.push(&first);
        if self.rest.is_some() {
            fields.records.extend_from_slice(record);
        }
        count - 1
    }
}

/// A batch of points.
struct LayeredBatch<'r, 'd, 'a> {
    run: &'r mut LayeredChunkDecoder<'d, 'a>,
    left: usize,
    fields: &'r mut DecodedFields,
}

impl SimdTask for LayeredBatch<'_, '_, '_> {
    type Result = ();

    #[inline(always)]
    fn work<M: InstructionSet>(self, _: M) {
        let Self { run: LayeredChunkDecoder { columns, streams, .. }, left, fields } = self;
        let LayeredContext { places, heights, classes, flags, traces } = &mut **columns;
        traces.clear();
        traces.resize(left, PointChanges::default());
        let from = fields.grow(left);
        let mut coders = streams.on::<M>();
        let points = fields.places[from..].iter_mut().zip(&mut fields.returns[from..]);
        let marks = fields.classes[from..].iter_mut().zip(&mut fields.flags[from..]);
        for (((place, returns), (class, flag)), trace) in points.zip(marks).zip(traces) {
            let point = places.next(&mut coders.places);
            place[..2].copy_from_slice(&point.place);
            *returns = point.returns.0;
            *trace = point.trace;
            place[2] = heights.next(&mut coders.heights, &point);
            *class = classes.next(&mut coders.classes, &point);
            *flag = flags.next(&mut coders.flags, &point);
        }
        *streams = coders.on();
    }
}
