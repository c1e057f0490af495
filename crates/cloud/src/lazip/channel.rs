//! What is learnt of a scanner channel while a layered chunk is decoded.

use super::coder::Coder;
use super::integer::Integer;
use super::machine::Machine;
use super::median::Median;
use super::model::Model;
use super::returns::Returns;

/// Bytes of the part of a record that formats 6 to 10 share.
pub(super) const RECORD: usize = 30;

/// Bits of the symbol that says what differs from the point before.
pub(super) const CHANNEL: usize = 1 << 6;
pub(super) const SOURCE: usize = 1 << 5;
pub(super) const TIME: usize = 1 << 4;
pub(super) const ANGLE: usize = 1 << 3;
const OF: usize = 1 << 2;
const NUMBER: usize = 3;

/// The fields of a point.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) place: [i32; 3],
    pub(super) returns: Returns,
    pub(super) class: u8,
    /// Synthetic, key point, withheld, overlap; then scan direction and edge of flight line.
    pub(super) flags: u8,
    /// Whether its time differs from that of the point before it.
    pub(super) is_later: bool,
}

impl Point {
    /// The point of a record, and its scanner channel.
    pub(super) fn new(record: &[u8; RECORD]) -> (Self, usize) {
        let axis = |at: usize| i32::from_le_bytes(std::array::from_fn(|i| record[at + i]));
        let flags = record[15];
        let point = Self {
            place: [axis(0), axis(4), axis(8)],
            returns: Returns(record[14]),
            class: record[16],
            flags: flags & 15 | flags >> 2 & 0x30,
            is_later: false,
        };
        (point, usize::from(flags >> 4 & 3))
    }
}

/// Everything learnt of a channel. It is large: made once per thread, used again and again.
pub(super) struct Channel {
    /// Whether the chunk had a point of this channel.
    pub(super) is_used: bool,
    pub(super) last: Point,
    /// Recent steps along x and y, by group of returns and change of time.
    pub(super) steps: [[Median; 2]; 12],
    /// Last height, by depth of the return.
    pub(super) heights: [i32; 8],
    changes: [Model<8>; 8],
    channel: Model<1>,
    of: [Model<1>; 16],
    number: [Model<1>; 16],
    number_same_time: Model<1>,
    pub(super) x: Integer<2>,
    pub(super) y: Integer<22>,
    pub(super) z: Integer<20>,
    pub(super) classes: [Model<16>; 64],
    pub(super) flags: [Model<4>; 64],
}

impl Channel {
    /// A channel without a point.
    pub(super) fn new() -> Self {
        Self {
            is_used: false,
            last: Point::new(&[0; RECORD]).0,
            steps: [[const { Median::new() }; 2]; 12],
            heights: [0; 8],
            changes: [const { Model::new() }; 8],
            channel: Model::new(),
            of: [const { Model::new() }; 16],
            number: [const { Model::new() }; 16],
            number_same_time: Model::new(),
            x: Integer::new(32),
            y: Integer::new(32),
            z: Integer::new(32),
            classes: [const { Model::new() }; 64],
            flags: [const { Model::new() }; 64],
        }
    }

    /// Begins anew after point `last`.
    pub(super) fn begin(&mut self, last: Point) {
        self.is_used = true;
        self.last = Point { is_later: false, ..last };
        self.steps = [[Median::new(); 2]; 12];
        self.heights = [last.place[2]; 8];
        self.changes.iter_mut().for_each(Model::clear);
        self.channel.clear();
        self.of.iter_mut().for_each(Model::clear);
        self.number.iter_mut().for_each(Model::clear);
        self.number_same_time.clear();
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.classes.iter_mut().for_each(Model::clear);
        self.flags.iter_mut().for_each(Model::clear);
    }

    /// Symbol that says what differs from the last point.
    #[inline(always)]
    pub(super) fn changes<M: Machine>(&mut self, coder: &mut Coder<M>) -> usize {
        let Point { returns, is_later, .. } = self.last;
        let kind = usize::from(returns.is_first())
            | usize::from(returns.is_last()) << 1
            | usize::from(is_later) << 2;
        coder.symbol(self.changes[kind].ready(128))
    }

    /// How many channels on the next point is, less one.
    #[inline(always)]
    pub(super) fn channel<M: Machine>(&mut self, coder: &mut Coder<M>) -> usize {
        coder.symbol(self.channel.ready(3))
    }

    /// Return numbers of the next point.
    #[inline(always)]
    pub(super) fn returns<M: Machine>(&mut self, coder: &mut Coder<M>, changes: usize) -> Returns {
        let last = self.last.returns;
        let of = match changes & OF {
            0 => last.of(),
            _ => coder.symbol(self.of[usize::from(last.of())].ready(16)) as u8,
        };
        let number = match changes & NUMBER {
            NUMBER => self.other_number(coder, changes & TIME != 0),
            // The same, one more, one less.
            change => last.number() + [0, 1, 15][change],
        };
        Returns::new(number, of)
    }

    /// A return number that is neither the last nor next to it.
    #[inline(always)]
    fn other_number<M: Machine>(&mut self, coder: &mut Coder<M>, is_later: bool) -> u8 {
        let last = self.last.returns.number();
        match is_later {
            true => coder.symbol(self.number[usize::from(last)].ready(16)) as u8,
            false => coder.symbol(self.number_same_time.ready(13)) as u8 + last + 2,
        }
    }
}
