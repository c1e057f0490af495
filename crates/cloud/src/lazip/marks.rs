//! The columns of classes and of flags: a symbol for each point, which depends on that of the last.

use std::marker::PhantomData;

use super::channels::{Channels, State};
use super::coder::Coder;
use super::machine::Machine;
use super::model::Model;
use super::places::Place;
use super::returns::Returns;

/// A kind of mark.
pub(super) trait Kind {
    /// How many there are.
    const SYMBOLS: usize;

    /// The circumstance that the next mark comes in, below 64.
    fn after(last: u8, returns: Returns) -> usize;
}

/// Classes.
pub(super) struct Class;

impl Kind for Class {
    const SYMBOLS: usize = 256;

    #[inline(always)]
    fn after(last: u8, returns: Returns) -> usize {
        let is_only = returns.is_first() && returns.is_last();
        usize::from(last & 31) << 1 | usize::from(is_only)
    }
}

/// Flags.
pub(super) struct Flag;

impl Kind for Flag {
    const SYMBOLS: usize = 64;

    #[inline(always)]
    fn after(last: u8, _: Returns) -> usize {
        usize::from(last & 63)
    }
}

/// What is learnt of marks of a kind, of which there are at most 16 * `B`.
pub(super) struct Marks<K, const B: usize> {
    channels: Channels<Channel<B>>,
    last: u8,
    kind: PhantomData<K>,
}

impl<K: Kind, const B: usize> Marks<K, B> {
    pub(super) fn new() -> Self {
        Self { channels: Channels::new(), last: 0, kind: PhantomData }
    }

    /// Begins a chunk whose first point is in `channel`.
    pub(super) fn begin(&mut self, channel: usize, first: u8) {
        self.last = first;
        self.channels.begin(channel, first);
    }

    /// The mark of the next point; without a stream all are alike.
    #[inline(always)]
    pub(super) fn next<M: Machine>(&mut self, coder: &mut Option<Coder<M>>, at: &Place) -> u8 {
        if let Some(coder) = coder {
            let channel = match at.trace.is_other_channel() {
                true => self.channels.switch(at.trace.channel(), self.last),
                false => self.channels.get(at.trace.channel()),
            };
            let model = &mut channel.models[K::after(channel.last, at.returns) & 63];
            channel.last = coder.symbol(model.ready(K::SYMBOLS)) as u8;
            self.last = channel.last;
        }
        self.last
    }
}

/// What is learnt of a channel.
struct Channel<const B: usize> {
    last: u8,
    models: [Model<B>; 64],
}

impl<const B: usize> State for Channel<B> {
    type Last = u8;

    fn new() -> Self {
        Self { last: 0, models: [const { Model::new() }; 64] }
    }

    fn begin(&mut self, last: u8) {
        self.last = last;
        self.models.iter_mut().for_each(Model::clear);
    }
}
