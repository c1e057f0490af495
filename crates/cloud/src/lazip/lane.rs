//! A layered chunk on its way, point by point and step by step.

use super::Fields;
use super::channel::{CHANNEL, Channel, TIME};
use super::integer::lower;
use super::machine::{Machine, Plain};
use super::rest::Trace;
use super::streams::Streams;

/// A chunk on its way. Each step of a point decodes one symbol, so that steps of several chunks can
/// take turns: a step has to wait for the one before it, but not for those of other chunks.
pub(super) struct Lane<'r, 'a, M> {
    channels: &'r mut [Channel; 4],
    current: usize,
    streams: Streams<'a, M>,
    fields: &'r mut Fields,
    traces: &'r mut Vec<Trace>,
    changes: usize,
    /// Whether the return is expected to be the only one of its pulse.
    is_single: usize,
    /// Which recent steps the point is compared with.
    kind: usize,
    /// Sizes of the differences in x, y and z.
    sizes: [u32; 3],
    upper: u32,
}

impl<'r, 'a, M: Machine> Lane<'r, 'a, M> {
    /// A chunk whose last point so far is in channel `current`.
    pub(super) fn new(
        channels: &'r mut [Channel; 4],
        current: usize,
        streams: Streams<'a, M>,
        fields: &'r mut Fields,
        traces: &'r mut Vec<Trace>,
    ) -> Self {
        Self {
            channels,
            current,
            streams,
            fields,
            traces,
            changes: 0,
            is_single: 0,
            kind: 0,
            sizes: [0; 3],
            upper: 0,
        }
    }

    /// The channel of the last point, and the streams, to go on with later.
    pub(super) fn close(self) -> (usize, Streams<'a, Plain>) {
        (self.current, self.streams.on())
    }

    #[inline(always)]
    pub(super) fn changes(&mut self) {
        let channel = &mut self.channels[self.current & 3];
        self.changes = channel.changes(&mut self.streams.places);
        if self.changes & CHANNEL != 0 {
            let step = channel.channel(&mut self.streams.places);
            let from = self.current;
            self.current = (from + step + 1) & 3;
            switch(self.channels, from, self.current);
        }
    }

    #[inline(always)]
    pub(super) fn returns(&mut self) {
        let returns =
            self.channels[self.current & 3].returns(&mut self.streams.places, self.changes);
        let is_later = self.changes & TIME != 0;
        self.is_single = usize::from(returns.is_single());
        self.kind = returns.group() << 1 | usize::from(is_later);
        self.channels[self.current & 3].last.returns = returns;
        self.channels[self.current & 3].last.is_later = is_later;
    }

    #[inline(always)]
    pub(super) fn x_size(&mut self) {
        self.sizes[0] =
            self.channels[self.current & 3].x.size(&mut self.streams.places, self.is_single);
    }

    #[inline(always)]
    pub(super) fn x_upper(&mut self) {
        self.upper =
            self.channels[self.current & 3].x.upper(&mut self.streams.places, self.sizes[0]);
    }

    #[inline(always)]
    pub(super) fn x_lower(&mut self) {
        let x = lower(&mut self.streams.places, self.sizes[0], self.upper);
        self.go(0, x);
    }

    #[inline(always)]
    pub(super) fn y_size(&mut self) {
        let detail = (self.sizes[0] & !1).min(20) as usize;
        self.sizes[1] = self.channels[self.current & 3]
            .y
            .size(&mut self.streams.places, detail | self.is_single);
    }

    #[inline(always)]
    pub(super) fn y_upper(&mut self) {
        self.upper =
            self.channels[self.current & 3].y.upper(&mut self.streams.places, self.sizes[1]);
    }

    #[inline(always)]
    pub(super) fn y_lower(&mut self) {
        let y = lower(&mut self.streams.places, self.sizes[1], self.upper);
        self.go(1, y);
    }

    /// Goes along an axis by the usual step and `difference`.
    #[inline(always)]
    fn go(&mut self, axis: usize, difference: i32) {
        let median = &mut self.channels[self.current & 3].steps[self.kind % 12][axis];
        let step = median.get().wrapping_add(difference);
        median.add(step);
        let place = &mut self.channels[self.current & 3].last.place[axis];
        *place = place.wrapping_add(step);
    }

    #[inline(always)]
    pub(super) fn z_size(&mut self) {
        let Some(coder) = &mut self.streams.heights else { return };
        let detail = (((self.sizes[0] + self.sizes[1]) / 2) & !1).min(18) as usize;
        self.sizes[2] = self.channels[self.current & 3].z.size(coder, detail | self.is_single);
    }

    #[inline(always)]
    pub(super) fn z_upper(&mut self) {
        let Some(coder) = &mut self.streams.heights else { return };
        self.upper = self.channels[self.current & 3].z.upper(coder, self.sizes[2]);
    }

    #[inline(always)]
    pub(super) fn z_lower(&mut self) {
        let Some(coder) = &mut self.streams.heights else { return };
        let z = lower(coder, self.sizes[2], self.upper);
        let channel = &mut self.channels[self.current & 3];
        let height = &mut channel.heights[channel.last.returns.depth()];
        *height = height.wrapping_add(z);
        channel.last.place[2] = *height;
    }

    #[inline(always)]
    pub(super) fn class(&mut self) {
        let Some(coder) = &mut self.streams.classes else { return };
        let channel = &mut self.channels[self.current & 3];
        let last = &mut channel.last;
        let is_only = last.returns.is_first() && last.returns.is_last();
        let before = usize::from(last.class & 31) << 1 | usize::from(is_only);
        last.class = coder.symbol(channel.classes[before].ready(256)) as u8;
    }

    #[inline(always)]
    pub(super) fn flags(&mut self) {
        let Some(coder) = &mut self.streams.flags else { return };
        let channel = &mut self.channels[self.current & 3];
        let last = &mut channel.last;
        let before = usize::from(last.flags & 63);
        last.flags = coder.symbol(channel.flags[before].ready(64)) as u8;
    }

    /// Hands the point on, and what other layers have to know of it if it is to be `TRACED`.
    #[inline(always)]
    pub(super) fn finish<const TRACED: bool>(&mut self) {
        self.fields.push(&self.channels[self.current & 3].last);
        if TRACED {
            self.traces.push(Trace::new(self.changes, self.current));
        }
    }
}

/// Begins channel `to` after the last point of another if it is new.
#[inline(never)]
fn switch(channels: &mut [Channel; 4], from: usize, to: usize) {
    let last = channels[from & 3].last;
    let channel = &mut channels[to & 3];
    if !channel.is_used {
        channel.begin(last);
    }
}
