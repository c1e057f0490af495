//! Waveform packets of points. The state is the last record.

use super::coder::RangeDecoder;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::time::whole;

/// Bytes of a waveform packet.
pub(super) const PACKET: usize = 29;

/// Decoder of waveform packets: descriptor, offset, size, return point location, direction.
pub(super) struct WavePacketDecoder {
    descriptor: ArithmeticModel<16>,
    /// Kind of change of the offset, by the previous kind.
    offset: [ArithmeticModel<1>; 4],
    last: usize,
    /// Last explicit difference of offsets.
    step: i32,
    difference: IntegerDecoder<1>,
    size: IntegerDecoder<1>,
    location: IntegerDecoder<1>,
    direction: IntegerDecoder<3>,
}

impl WavePacketDecoder {
    pub(super) fn new() -> Self {
        Self {
            descriptor: ArithmeticModel::new(),
            offset: [const { ArithmeticModel::new() }; 4],
            last: 0,
            step: 0,
            difference: IntegerDecoder::new(32),
            size: IntegerDecoder::new(32),
            location: IntegerDecoder::new(32),
            direction: IntegerDecoder::new(32),
        }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.descriptor.clear();
        self.offset.iter_mut().for_each(ArithmeticModel::clear);
        (self.last, self.step) = (0, 0);
        self.difference.clear();
        self.size.clear();
        self.location.clear();
        self.direction.clear();
    }

    /// Replaces the last packet by the next one.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        packet: &mut [u8; PACKET],
    ) {
        let (head, numbers) = packet.split_at_mut(9);
        let (numbers, _) = numbers.as_chunks_mut::<4>();
        head[0] = coder.symbol(self.descriptor.ready(256)) as u8;
        let mut offset = [0; 8];
        offset.copy_from_slice(&head[1..]);
        let size = u32::from_le_bytes(numbers[0]);
        let offset = self.next_offset(coder, u64::from_le_bytes(offset), size);
        head[1..].copy_from_slice(&offset.to_le_bytes());
        go(&mut numbers[0], self.size.next(coder, 0).0);
        go(&mut numbers[1], self.location.next(coder, 0).0);
        for axis in 0..3 {
            go(&mut numbers[2 + axis], self.direction.next(coder, axis).0);
        }
    }

    /// The offset after `offset`, for a packet of `size` bytes.
    #[inline(always)]
    fn next_offset<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        offset: u64,
        size: u32,
    ) -> u64 {
        self.last = coder.symbol(self.offset[self.last & 3].ready(4));
        match self.last {
            0 => offset,
            1 => offset.wrapping_add(size.into()),
            2 => {
                self.step = self.step.wrapping_add(self.difference.next(coder, 0).0);
                offset.wrapping_add_signed(self.step.into())
            }
            _ => whole(coder),
        }
    }
}

/// Adds a difference to a number.
#[inline(always)]
fn go(number: &mut [u8; 4], difference: i32) {
    *number = i32::from_le_bytes(*number).wrapping_add(difference).to_le_bytes();
}
