//! The column of heights.

use super::channels::{Channels, State};
use super::coder::Coder;
use super::integer::Integer;
use super::machine::Machine;
use super::places::Place;
use super::returns::Returns;

/// What is learnt of heights.
pub(super) struct Heights {
    channels: Channels<Channel>,
    last: i32,
}

impl Heights {
    pub(super) fn new() -> Self {
        Self { channels: Channels::new(), last: 0 }
    }

    /// Begins a chunk whose first point is in `channel`.
    pub(super) fn begin(&mut self, channel: usize, first: i32) {
        self.last = first;
        self.channels.begin(channel, first);
    }

    /// The height of the next point; without a stream all are alike.
    #[inline(always)]
    pub(super) fn next<M: Machine>(&mut self, coder: &mut Option<Coder<M>>, at: &Place) -> i32 {
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

/// What is learnt of a channel.
struct Channel {
    /// Last height, by depth of the return.
    heights: [i32; 8],
    steps: Integer<20>,
}

impl State for Channel {
    type Last = i32;

    fn new() -> Self {
        Self { heights: [0; 8], steps: Integer::new(32) }
    }

    fn begin(&mut self, last: i32) {
        self.heights = [last; 8];
        self.steps.clear();
    }
}

impl Channel {
    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>, spread: usize, returns: Returns) -> i32 {
        let (step, _) = self.steps.next(coder, spread);
        let height = &mut self.heights[returns.depth() & 7];
        *height = height.wrapping_add(step);
        *height
    }
}
