//! Layers that only whole records need. They are decoded in blocks of some thousand points, when the positions and
//! changes of these points are known.

use super::attributes::ChannelHeads;
use super::body::LayeredChunk;
use super::chunk::ChunkDamage;
use super::extended_items::ChunkTails;
use super::fields::DecodedFields;
use super::machine::{InstructionSet, PortableInstructions, SimdTask, run};
use super::point::RECORD;
use super::returns::ReturnNumbers;
use super::schema::LayeredSchema;
use super::streams::RestStreams;
use super::trace::PointChanges;

/// State reused between chunks.
pub(super) struct RestContext {
    heads: ChannelHeads,
    tails: ChunkTails,
}

impl RestContext {
    pub(super) fn new() -> Self {
        Self { heads: ChannelHeads::new(), tails: ChunkTails::default() }
    }
}

/// The layers, being decoded in batches.
pub(super) struct RestLayers<'d, 'a> {
    context: &'d mut RestContext,
    streams: RestStreams<'a, PortableInstructions>,
    /// Bytes of a record.
    size: usize,
}

impl<'d, 'a> RestLayers<'d, 'a> {
    /// Begins a chunk with a first point in `channel`.
    pub(super) fn new(
        context: &'d mut RestContext,
        body: LayeredChunk<'a>,
        layers: &LayeredSchema,
        channel: usize,
    ) -> Result<Self, ChunkDamage> {
        let (head, tail) = body.record.split_first_chunk().ok_or(ChunkDamage::Short)?;
        context.heads.begin(channel, head);
        context.tails.begin(layers, channel, tail);
        Ok(Self { context, size: body.record.len(), streams: body.rest(layers)? })
    }

    /// Appends the records of the last points of `fields`, with their changes.
    pub(super) fn read(
        &mut self,
        traces: &[PointChanges],
        fields: &mut DecodedFields,
    ) -> Result<(), ChunkDamage> {
        fields.records.reserve(traces.len() * self.size);
        run(RestBatch(self, traces, fields));
        self.streams.check(|coder| coder.is_sound())
    }

    /// Fails unless all streams end here.
    pub(super) fn end(&self) -> Result<(), ChunkDamage> {
        self.streams.check(|coder| coder.is_all())
    }
}

/// Points to complete.
struct RestBatch<'r, 'd, 'a>(&'r mut RestLayers<'d, 'a>, &'r [PointChanges], &'r mut DecodedFields);

impl SimdTask for RestBatch<'_, '_, '_> {
    type Result = ();

    #[inline(always)]
    fn work<M: InstructionSet>(self, _: M) {
        let Self(RestLayers { context, streams, .. }, traces, fields) = self;
        let mut coders = streams.on::<M>();
        let first = fields.len() - traces.len();
        for (index, &trace) in (first..).zip(traces) {
            let mut head = head(fields, index, trace);
            context.heads.next(&mut coders, trace, ReturnNumbers(fields.returns[index]), &mut head);
            fields.records.extend_from_slice(&head);
            fields.records.extend_from_slice(context.tails.next(&mut coders, trace));
        }
        *streams = coders.on();
    }
}

/// The common fields of a record, as far as known.
#[inline(always)]
fn head(fields: &DecodedFields, index: usize, trace: PointChanges) -> [u8; RECORD] {
    let mut head = [0; RECORD];
    head[..12].copy_from_slice(fields.places[index].map(i32::to_le_bytes).as_flattened());
    head[14] = fields.returns[index];
    let flags = fields.flags[index];
    head[15] = flags & 15 | (flags & 0x30) << 2 | (trace.channel() as u8) << 4;
    head[16] = fields.classes[index];
    head
}
