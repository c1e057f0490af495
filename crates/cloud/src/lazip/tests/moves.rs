//! Records that go from one to the next by moves: each move is one way in which a field can go on, so
//! that what fails becomes few and short moves.

use super::records::put;
use super::{LazItem, plain};
use proptest::collection::vec;
use proptest::prelude::*;

/// How a record differs from the one before.
#[derive(Clone, Debug)]
pub(super) enum Move {
    Step([i32; 3]),
    /// Another byte of the part that all formats share.
    Byte(usize, u8),
    Channel(u8),
    /// A time later or earlier by so much.
    Later(i32),
    /// A time later by so many times the last step, and some more.
    Again(i32, i32),
    /// A time that goes on from another sequence of times.
    Elsewhere(usize, u32),
    /// A time like no other.
    Whole(u64),
    Grey(u16),
    /// Another byte of a colour or of infrared.
    Tint(usize, u8),
    Descriptor(u8),
    /// The packet behind the last one.
    NextPacket,
    /// A packet so much further on.
    Offset(i32),
    WholeOffset(u64),
    /// Another number of a packet: bytes, place, direction.
    Number(usize, u32),
    Extra(usize, u8),
}

/// Numbers whose sizes are random, too.
fn number() -> impl Strategy<Value = i32> {
    (any::<i32>(), 1_u32..31).prop_map(|(number, bits)| number >> bits)
}

fn one() -> impl Strategy<Value = Move> {
    prop_oneof![
        4 => [number(), number(), number()].prop_map(Move::Step),
        3 => (0_usize..10, any::<u8>()).prop_map(|(at, byte)| Move::Byte(at, byte)),
        1 => (0_usize..10, 0_u8..4).prop_map(|(at, byte)| Move::Byte(at, byte)),
        2 => (0_u8..4).prop_map(Move::Channel),
        1 => number().prop_map(Move::Later),
        4 => (-14..14, -2..3).prop_map(|(times, more)| Move::Again(times, more)),
        2 => (-700..700, -2..3).prop_map(|(times, more)| Move::Again(times, more)),
        2 => (0_usize..6, 0_u32..1000).prop_map(|(of, step)| Move::Elsewhere(of, step)),
        1 => any::<u64>().prop_map(Move::Whole),
        2 => any::<u16>().prop_map(Move::Grey),
        3 => (0_usize..8, any::<u8>()).prop_map(|(at, byte)| Move::Tint(at, byte)),
        1 => any::<u8>().prop_map(Move::Descriptor),
        2 => Just(Move::NextPacket),
        2 => number().prop_map(Move::Offset),
        1 => any::<u64>().prop_map(Move::WholeOffset),
        2 => (0_usize..5, any::<u32>()).prop_map(|(at, number)| Move::Number(at, number)),
        2 => (0_usize..5, any::<u8>()).prop_map(|(at, byte)| Move::Extra(at, byte)),
    ]
}

/// Moves from record to record, of up to `most` records.
pub(super) fn moves(most: usize) -> impl Strategy<Value = Vec<Vec<Move>>> {
    vec(vec(one(), 0..6), 1..=most)
}

/// A record on its way, and where its parts are.
struct Walk {
    record: Vec<u8>,
    is_new: bool,
    /// Whether its items are of the first version.
    is_first: bool,
    time: Option<usize>,
    /// Colour and infrared.
    tint: (usize, usize),
    packet: Option<usize>,
    extra: (usize, usize),
    last_step: i64,
    sequences: [u64; 6],
}

impl Walk {
    fn new(items: &[LazItem]) -> Self {
        let mut walk = Self {
            record: Vec::new(),
            is_new: items[0].version() > 2,
            is_first: items[0].version() == 1,
            time: None,
            tint: (0, 0),
            packet: None,
            extra: (0, 0),
            last_step: 0,
            // Too far from each other for a difference of 32 bits.
            sequences: [0, 1, 2, 3, 4, 5].map(|n| (0x40f0_0000 + n * 0x1234) << 32 | 99),
        };
        let mut at = 0;
        for item in items.iter().map(plain) {
            match item.kind {
                7 => walk.time = Some(at),
                8 | 11 | 12 => walk.tint = (at, item.size.into()),
                9 | 13 => walk.packet = Some(at),
                10 => walk.time = Some(22),
                0 | 14 => walk.extra = (at, item.size.into()),
                _ => {}
            }
            at += usize::from(item.size);
        }
        walk.record = vec![0; at];
        walk
    }

    fn number<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.record[at + i])
    }

    fn go(&mut self, change: &Move) {
        match *change {
            Move::Step(step) => self.step(step),
            Move::Byte(at, byte) if self.is_new => {
                // The scanner channel has a move of its own, as it must not come too often.
                self.record[12 + at] = if at == 3 { byte & !0x30 } else { byte };
            }
            Move::Byte(at, byte) => self.record[12 + at % 8] = byte,
            Move::Channel(channel) if self.is_new => {
                self.record[15] = self.record[15] & !0x30 | channel << 4;
            }
            Move::Grey(value) => {
                let bytes = [value.to_le_bytes(); 3];
                self.tint(0, bytes.as_flattened());
            }
            Move::Tint(at, byte) => self.tint(at, &[byte]),
            Move::Extra(at, byte) if at < self.extra.1 => self.record[self.extra.0 + at] = byte,
            _ => {
                if let Some(at) = self.time {
                    self.go_time(at, change);
                }
                if let Some(at) = self.packet {
                    self.go_packet(at, change);
                }
            }
        }
    }

    fn step(&mut self, step: [i32; 3]) {
        for (at, step) in [0, 4, 8].into_iter().zip(step) {
            let place = i32::from_le_bytes(self.number(at)).wrapping_add(step);
            // What encodes the first version cannot bear larger steps.
            let place = if self.is_first { place << 2 >> 2 } else { place };
            put(&mut self.record, at, &place.to_le_bytes());
        }
    }

    fn tint(&mut self, at: usize, bytes: &[u8]) {
        let (begin, size) = self.tint;
        if at + bytes.len() <= size {
            put(&mut self.record, begin + at, bytes);
        }
        if self.is_first && size > 0 {
            // What encodes the first version takes the upper byte of blue for that of green.
            self.record[begin + 5] = 0;
        }
    }

    fn go_time(&mut self, at: usize, change: &Move) {
        let time = u64::from_le_bytes(self.number(at));
        // What encodes multiplies steps.
        let bounded = |step: i64| step.clamp(-(1 << 28), 1 << 28);
        let step = match *change {
            Move::Later(step) => bounded(step.into()),
            Move::Again(times, more) => {
                bounded(self.last_step * i64::from(times) + i64::from(more))
            }
            Move::Elsewhere(of, step) => {
                self.sequences[of] += u64::from(step);
                put(&mut self.record, at, &self.sequences[of].to_le_bytes());
                return;
            }
            Move::Whole(time) => {
                // Positive and a number, as times are compared as numbers.
                put(&mut self.record, at, &(time >> 2).to_le_bytes());
                return;
            }
            _ => return,
        };
        self.last_step = step;
        put(&mut self.record, at, &(time.saturating_add_signed(step) & !0 >> 2).to_le_bytes());
    }

    fn go_packet(&mut self, at: usize, change: &Move) {
        let offset = u64::from_le_bytes(self.number(at + 1));
        let size = u32::from_le_bytes(self.number(at + 9));
        let offset = match *change {
            Move::Descriptor(byte) => {
                self.record[at] = byte;
                offset
            }
            Move::NextPacket => offset + u64::from(size),
            Move::Offset(step) => offset.saturating_add_signed(step.into()),
            // What encodes subtracts offsets.
            Move::WholeOffset(offset) => offset >> 3,
            Move::Number(number, value) => {
                // Positive and a number, where it is one.
                let value = if number == 0 { value } else { value & 0x3fff_ffff };
                put(&mut self.record, at + 9 + 4 * number, &value.to_le_bytes());
                offset
            }
            _ => offset,
        };
        put(&mut self.record, at + 1, &offset.to_le_bytes());
    }
}

/// The records of these items that come of moves.
pub(super) fn moved(items: &[LazItem], moves: &[Vec<Move>]) -> Vec<u8> {
    let mut walk = Walk::new(items);
    let mut records = Vec::new();
    for changes in moves {
        changes.iter().for_each(|change| walk.go(change));
        records.extend_from_slice(&walk.record);
    }
    records
}
