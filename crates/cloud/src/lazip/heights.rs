//! The column of heights.

use super::channels::{ChannelContext, ChannelContexts};
use super::coder::RangeDecoder;
use super::coordinates::DecodedPosition;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::range_encoder::RangeEncoder;
use super::returns::ReturnNumbers;

/// Decoder contexts of heights.
pub(super) struct HeightContext {
    channels: ChannelContexts<HeightChannel>,
    last: i32,
}

impl HeightContext {
    pub(super) fn new() -> Self {
        Self { channels: ChannelContexts::new(), last: 0 }
    }

    /// Begins a chunk with a first point in `channel`.
    pub(super) fn begin(&mut self, channel: usize, first: i32) {
        self.last = first;
        self.channels.begin(channel, first);
    }

    /// Decodes the height of the next point; without a stream all heights are equal.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut Option<RangeDecoder<M>>,
        at: &DecodedPosition,
    ) -> i32 {
        if let Some(coder) = coder {
            let channel = match at.trace.is_other_channel() {
                true => self.channels.switch(at.trace.channel(), self.last),
                false => self.channels.get(at.trace.channel()),
            };
            self.last = channel.next(coder, at.trace.spread(), at.returns);
        }
        self.last
    }
}

impl HeightContext {
    /// Encodes the height of the next point.
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, at: &DecodedPosition, height: i32) {
        let channel = match at.trace.is_other_channel() {
            true => self.channels.switch(at.trace.channel(), self.last),
            false => self.channels.get(at.trace.channel()),
        };
        let last = &mut channel.heights[at.returns.depth() & 7];
        channel.steps.put(coder, at.trace.spread(), height.wrapping_sub(*last));
        *last = height;
        self.last = height;
    }
}

/// Decoder context of a channel.
struct HeightChannel {
    /// Last height, by distance of the return from the last one.
    heights: [i32; 8],
    steps: IntegerDecoder<20>,
}

impl ChannelContext for HeightChannel {
    type Last = i32;

    fn new() -> Self {
        Self { heights: [0; 8], steps: IntegerDecoder::new(32) }
    }

    fn begin(&mut self, last: i32) {
        self.heights = [last; 8];
        self.steps.clear();
    }
}

impl HeightChannel {
    #[inline(always)]
    fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        spread: usize,
        returns: ReturnNumbers,
    ) -> i32 {
        let (step, _) = self.steps.next(coder, spread);
        let height = &mut self.heights[returns.depth() & 7];
        *height = height.wrapping_add(step);
        *height
    }
}
