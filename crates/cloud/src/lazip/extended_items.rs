//! Fields after the common ones in records of a layered chunk: each layer has a part of them.

use super::chunk::LazLayer;
use super::machine::InstructionSet;
use super::range_encoder::RangeEncoder;
use super::record_items::ItemContext;
use super::schema::LayeredSchema;
use super::streams::RestStreams;
use super::trace::PointChanges;

/// Version 3 uses the first channel for every point except at changes of the channel, and then continues from the
/// last values of the previous channel, unless the channel is new.
const ODD_VERSION: u16 = 3;

/// State reused between chunks.
#[derive(Default)]
pub(super) struct ChunkTails {
    version: u16,
    /// Layers decoded by `models`.
    layers: Vec<LazLayer>,
    /// Contexts of each layer, by channel; empty for unused channels.
    models: [Vec<ItemContext>; 4],
    is_used: [bool; 4],
    /// Last bytes, by channel.
    last: [Vec<u8>; 4],
    current: usize,
}

impl ChunkTails {
    /// Begins a chunk after a point of `channel` with these bytes.
    pub(super) fn begin(&mut self, layers: &LayeredSchema, channel: usize, bytes: &[u8]) {
        if self.layers != layers.layers {
            self.layers.clone_from(&layers.layers);
            self.models = Default::default();
        }
        self.version = layers.version;
        self.is_used = [false; 4];
        self.current = channel;
        self.begin_channel(channel, bytes);
    }

    fn begin_channel(&mut self, channel: usize, bytes: &[u8]) {
        self.is_used[channel & 3] = true;
        self.last[channel & 3].clear();
        self.last[channel & 3].extend_from_slice(bytes);
        let models = &mut self.models[channel & 3];
        models.iter_mut().for_each(ItemContext::clear);
        let missing = self.layers.iter().skip(models.len());
        models.extend(missing.map(|layer| ItemContext::of(*layer)));
    }

    /// Encodes the bytes of the next point; a layer that is constant has no stream.
    #[inline(always)]
    pub(super) fn put(
        &mut self,
        streams: &mut [Option<RangeEncoder>],
        trace: PointChanges,
        bytes: &[u8],
    ) {
        let last = self.turn_for(trace);
        let last = &mut self.last[last & 3][..];
        let mut at = 0;
        for (model, coder) in self.models[self.current & 3].iter_mut().zip(streams) {
            let item = at..at + model.size();
            at = item.end;
            if let Some(coder) = coder {
                model.put(coder, &last[item.clone()], &bytes[item]);
            }
        }
        last.copy_from_slice(bytes);
    }

    /// Switches to the channel of a point; returns the channel whose last bytes are the prediction.
    #[inline(always)]
    fn turn_for(&mut self, trace: PointChanges) -> usize {
        self.turn(match self.version == ODD_VERSION && !trace.is_other_channel() {
            true => 0,
            false => trace.channel(),
        })
    }

    /// Decodes the bytes of the next point.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        streams: &mut RestStreams<M>,
        trace: PointChanges,
    ) -> &[u8] {
        let last = self.turn_for(trace);
        let mut rest = &mut self.last[last & 3][..];
        for (model, (_, coder)) in self.models[self.current & 3].iter_mut().zip(&mut streams.tails)
        {
            match coder {
                Some(coder) => model.next(coder, &mut rest),
                None => rest = rest.get_mut(model.size()..).unwrap_or_default(),
            }
        }
        &self.last[last & 3]
    }

    /// Switches to a channel; returns the channel whose last bytes are the prediction.
    #[inline(always)]
    fn turn(&mut self, channel: usize) -> usize {
        match channel == self.current {
            true => channel,
            false => self.switch(channel),
        }
    }

    #[inline(never)]
    fn switch(&mut self, channel: usize) -> usize {
        let before = std::mem::replace(&mut self.current, channel);
        if !self.is_used[channel & 3] {
            let bytes = self.last[before & 3].clone();
            self.begin_channel(channel, &bytes);
            return channel;
        }
        if self.version == ODD_VERSION { before } else { channel }
    }
}
