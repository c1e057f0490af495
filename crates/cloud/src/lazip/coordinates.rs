//! The column of positions: x, y and return numbers, and the changes from point to point.

use super::channels::{ChannelContext, ChannelContexts};
use super::coder::RangeDecoder;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::median::FiveValueMedian;
use super::model::ArithmeticModel;
use super::point::LazPoint;
use super::range_encoder::RangeEncoder;
use super::returns::ReturnNumbers;
use super::trace::{CHANNEL, PointChanges, TIME};

/// Bits of the symbol of changed fields.
const OF: usize = 1 << 2;
const NUMBER: usize = 3;

/// Position of a point, and related data.
pub(super) struct DecodedPosition {
    pub(super) place: [i32; 2],
    pub(super) returns: ReturnNumbers,
    pub(super) trace: PointChanges,
}

/// Decoder contexts of positions.
pub(super) struct PositionContext {
    channels: ChannelContexts<PositionChannel>,
    current: usize,
}

impl PositionContext {
    pub(super) fn new() -> Self {
        Self { channels: ChannelContexts::new(), current: 0 }
    }

    /// Begins a chunk with a first point in `channel`.
    pub(super) fn begin(&mut self, channel: usize, first: &LazPoint) {
        self.current = channel;
        self.channels.begin(
            channel,
            LastPoint { place: [first.place[0], first.place[1]], returns: first.returns },
        );
    }

    /// Decodes the next point.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
    ) -> DecodedPosition {
        let mut channel = self.channels.get(self.current);
        let changes = channel.changes(coder);
        if changes & CHANNEL != 0 {
            let (from, last) = (self.current, channel.last);
            self.current = (from + 1 + channel.step(coder)) & 3;
            channel = self.channels.switch(self.current, last);
        }
        let spread = channel.next(coder, changes);
        let LastPoint { place, returns } = channel.last;
        DecodedPosition { place, returns, trace: PointChanges::new(changes, self.current, spread) }
    }
}

impl PositionContext {
    /// Encodes the next point, whose other `changes` are [`SOURCE`](super::trace::SOURCE), [`TIME`] and
    /// [`ANGLE`](super::trace::ANGLE).
    #[inline(always)]
    pub(super) fn put<M: InstructionSet>(
        &mut self,
        coder: &mut RangeEncoder,
        point: &LazPoint,
        to: usize,
        changes: usize,
    ) -> DecodedPosition {
        let is_other = to != self.current;
        let before = self.channels.get(self.current).last;
        let last = match is_other {
            true => self.channels.used(to).map_or(before, |channel| channel.last),
            false => before,
        };
        let mut channel = self.channels.get(self.current);
        let returns = point.returns;
        let changes = changes
            | (usize::from(is_other) * CHANNEL)
            | (usize::from(returns.of() != last.returns.of()) * OF)
            | match returns.number().wrapping_sub(last.returns.number()) & 15 {
                0 => 0,
                1 => 1,
                15 => 2,
                _ => NUMBER,
            };
        channel.put_changes(coder, changes);
        if is_other {
            coder.symbol(channel.channel.ready(3), to.wrapping_sub(self.current + 1) & 3);
            self.current = to;
            channel = self.channels.switch(to, before);
        }
        let place = [point.place[0], point.place[1]];
        let spread = channel.put::<M>(coder, changes, place, returns);
        DecodedPosition { place, returns, trace: PointChanges::new(changes, to, spread) }
    }
}

/// The last point of a channel.
#[derive(Clone, Copy, Default)]
struct LastPoint {
    place: [i32; 2],
    returns: ReturnNumbers,
}

/// Decoder context of a channel.
struct PositionChannel {
    last: LastPoint,
    /// Whether its time differs from the previous point.
    is_later: bool,
    /// Recent steps along x and y, by group of returns and change of time.
    steps: [[FiveValueMedian; 2]; 16],
    changes: [ArithmeticModel<8>; 8],
    channel: ArithmeticModel<1>,
    of: [ArithmeticModel<1>; 16],
    number: [ArithmeticModel<1>; 16],
    number_same_time: ArithmeticModel<1>,
    x: IntegerDecoder<2>,
    y: IntegerDecoder<22>,
}

impl ChannelContext for PositionChannel {
    type Last = LastPoint;

    fn new() -> Self {
        Self {
            last: LastPoint::default(),
            is_later: false,
            steps: [[const { FiveValueMedian::new() }; 2]; 16],
            changes: [const { ArithmeticModel::new() }; 8],
            channel: ArithmeticModel::new(),
            of: [const { ArithmeticModel::new() }; 16],
            number: [const { ArithmeticModel::new() }; 16],
            number_same_time: ArithmeticModel::new(),
            x: IntegerDecoder::new(32),
            y: IntegerDecoder::new(32),
        }
    }

    fn begin(&mut self, last: LastPoint) {
        self.last = last;
        self.is_later = false;
        self.steps = [[FiveValueMedian::new(); 2]; 16];
        self.changes.iter_mut().for_each(ArithmeticModel::clear);
        self.channel.clear();
        self.of.iter_mut().for_each(ArithmeticModel::clear);
        self.number.iter_mut().for_each(ArithmeticModel::clear);
        self.number_same_time.clear();
        self.x.clear();
        self.y.clear();
    }
}

impl PositionChannel {
    /// Decodes the symbol of changed fields.
    #[inline(always)]
    fn changes<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) -> usize {
        let kind = self.kind();
        coder.symbol(self.changes[kind].ready(128))
    }

    /// Encodes the symbol of changed fields.
    #[inline(always)]
    fn put_changes(&mut self, coder: &mut RangeEncoder, changes: usize) {
        let kind = self.kind();
        coder.symbol(self.changes[kind].ready(128), changes);
    }

    /// Context of the symbol of changed fields.
    #[inline(always)]
    fn kind(&self) -> usize {
        let returns = self.last.returns;
        usize::from(returns.is_first())
            | usize::from(returns.is_last()) << 1
            | usize::from(self.is_later) << 2
    }

    /// Encodes the next point; returns the context of its height.
    #[inline(always)]
    fn put<M: InstructionSet>(
        &mut self,
        coder: &mut RangeEncoder,
        changes: usize,
        place: [i32; 2],
        returns: ReturnNumbers,
    ) -> usize {
        self.put_returns(coder, changes, returns);
        let before = std::mem::replace(&mut self.last, LastPoint { place, returns }).place;
        self.is_later = changes & TIME != 0;
        let is_single = usize::from(returns.is_single());
        let steps = &mut self.steps[(returns.group() << 1 | usize::from(self.is_later)) & 15];
        let [x, y] =
            [0, 1].map(|i| place[i].wrapping_sub(before[i]).wrapping_sub(steps[i].middle()));
        let x_size = self.x.put(coder, is_single, x);
        steps[0].go::<M>(x);
        let y_size = self.y.put(coder, (x_size & !1).min(20) as usize | is_single, y);
        steps[1].go::<M>(y);
        (((x_size + y_size) / 2) & !1).min(18) as usize | is_single
    }

    /// Encodes the return numbers of the next point.
    #[inline(always)]
    fn put_returns(&mut self, coder: &mut RangeEncoder, changes: usize, returns: ReturnNumbers) {
        let last = self.last.returns;
        if changes & OF != 0 {
            coder.symbol(self.of[usize::from(last.of())].ready(16), usize::from(returns.of()));
        }
        if changes & NUMBER == NUMBER {
            let (number, last) = (returns.number(), last.number());
            match changes & TIME != 0 {
                true => coder.symbol(self.number[usize::from(last)].ready(16), number.into()),
                false => {
                    let by = number.wrapping_sub(last + 2) & 15;
                    coder.symbol(self.number_same_time.ready(13), by.into());
                }
            }
        }
    }

    /// Decodes the difference of the channel numbers, less one.
    #[inline(always)]
    fn step<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) -> usize {
        coder.symbol(self.channel.ready(3))
    }

    /// Decodes the next point; returns the context of its height.
    #[inline(always)]
    fn next<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>, changes: usize) -> usize {
        let returns = self.returns(coder, changes);
        self.last.returns = returns;
        self.is_later = changes & TIME != 0;
        let is_single = usize::from(returns.is_single());
        let steps = &mut self.steps[(returns.group() << 1 | usize::from(self.is_later)) & 15];

        let (x, x_size) = self.x.next(coder, is_single);
        let x = steps[0].go::<M>(x);
        let detail = (x_size & !1).min(20) as usize;
        let (y, y_size) = self.y.next(coder, detail | is_single);
        let y = steps[1].go::<M>(y);

        let [before_x, before_y] = self.last.place;
        self.last.place = [before_x.wrapping_add(x), before_y.wrapping_add(y)];
        (((x_size + y_size) / 2) & !1).min(18) as usize | is_single
    }

    /// Decodes the return numbers of the next point.
    #[inline(always)]
    fn returns<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        changes: usize,
    ) -> ReturnNumbers {
        let last = self.last.returns;
        let of = match changes & OF {
            0 => last.of(),
            _ => coder.symbol(self.of[usize::from(last.of())].ready(16)) as u8,
        };
        let number = match changes & NUMBER {
            NUMBER => self.other_number(coder, changes & TIME != 0),
            // Equal, plus one, minus one.
            change => last.number() + [0, 1, 15][change],
        };
        ReturnNumbers::new(number, of)
    }

    /// Decodes a return number other than the last and its neighbours.
    #[inline(always)]
    fn other_number<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        is_later: bool,
    ) -> u8 {
        let last = self.last.returns.number();
        match is_later {
            true => coder.symbol(self.number[usize::from(last)].ready(16)) as u8,
            false => coder.symbol(self.number_same_time.ready(13)) as u8 + last + 2,
        }
    }
}
