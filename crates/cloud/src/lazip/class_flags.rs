//! Columns of classes and flags: a symbol for each point, dependent on the last symbol.

use std::marker::PhantomData;

use super::channels::{ChannelContext, ChannelContexts};
use super::coder::RangeDecoder;
use super::coordinates::DecodedPosition;
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::range_encoder::RangeEncoder;
use super::returns::ReturnNumbers;

/// A kind of symbol column.
pub(super) trait MarkKind {
    /// Number of symbols.
    const SYMBOLS: usize;

    /// Context of the next symbol, below 64.
    fn after(last: u8, returns: ReturnNumbers) -> usize;
}

/// Classes.
pub(super) struct ClassMark;

impl MarkKind for ClassMark {
    const SYMBOLS: usize = 256;

    #[inline(always)]
    fn after(last: u8, returns: ReturnNumbers) -> usize {
        let is_only = returns.is_first() && returns.is_last();
        usize::from(last & 31) << 1 | usize::from(is_only)
    }
}

/// Flags.
pub(super) struct Flag;

impl MarkKind for Flag {
    const SYMBOLS: usize = 64;

    #[inline(always)]
    fn after(last: u8, _: ReturnNumbers) -> usize {
        usize::from(last & 63)
    }
}

/// Decoder contexts of a column with at most 16 * `B` symbols.
pub(super) struct MarkContext<K, const B: usize> {
    channels: ChannelContexts<MarkChannel<B>>,
    last: u8,
    kind: PhantomData<K>,
}

impl<K: MarkKind, const B: usize> MarkContext<K, B> {
    pub(super) fn new() -> Self {
        Self { channels: ChannelContexts::new(), last: 0, kind: PhantomData }
    }

    /// Begins a chunk with a first point in `channel`.
    pub(super) fn begin(&mut self, channel: usize, first: u8) {
        self.last = first;
        self.channels.begin(channel, first);
    }

    /// Decodes the symbol of the next point; without a stream all symbols are equal.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut Option<RangeDecoder<M>>,
        at: &DecodedPosition,
    ) -> u8 {
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

impl<K: MarkKind, const B: usize> MarkContext<K, B> {
    /// Encodes the symbol of the next point.
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, at: &DecodedPosition, mark: u8) {
        let channel = match at.trace.is_other_channel() {
            true => self.channels.switch(at.trace.channel(), self.last),
            false => self.channels.get(at.trace.channel()),
        };
        let model = &mut channel.models[K::after(channel.last, at.returns) & 63];
        coder.symbol(model.ready(K::SYMBOLS), mark.into());
        channel.last = mark;
        self.last = mark;
    }
}

/// Decoder context of a channel.
struct MarkChannel<const B: usize> {
    last: u8,
    models: [ArithmeticModel<B>; 64],
}

impl<const B: usize> ChannelContext for MarkChannel<B> {
    type Last = u8;

    fn new() -> Self {
        Self { last: 0, models: [const { ArithmeticModel::new() }; 64] }
    }

    fn begin(&mut self, last: u8) {
        self.last = last;
        self.models.iter_mut().for_each(ArithmeticModel::clear);
    }
}
