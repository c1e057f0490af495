//! The arithmetic decoder: a byte stream, decoded without branches on symbols.

use super::machine::InstructionSet;
use super::model::{ArithmeticModel, BitModel};
use std::marker::PhantomData;

/// Bits of the interval that an adaptive model divides.
pub(super) const MODEL_BITS: u32 = 15;
/// Bits of the interval that a bit model divides.
pub(super) const BIT_BITS: u32 = 13;
/// Maximum bits of a division of the interval.
pub(super) const RAW_BITS: u32 = 19;

/// A stream being decoded. Valid streams hold every byte that their decoder reads, so a stream that was read past its
/// end is damaged; until this is checked, it reads as zeros.
///
/// `value < length` and `length >= 2^24` hold between calls.
#[derive(Clone, Copy)]
pub(super) struct RangeDecoder<'a, M> {
    /// Unread bytes.
    rest: &'a [u8],
    /// Number of bytes read past the end.
    beyond: u32,
    value: u32,
    length: u32,
    /// Nonzero if bits were read that no encoder writes.
    excess: u32,
    machine: PhantomData<M>,
}

impl<'a, M: InstructionSet> RangeDecoder<'a, M> {
    /// Opens a stream; `None` if no encoder begins a stream like this.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (value, rest) = bytes.split_first_chunk()?;
        let value = u32::from_be_bytes(*value);
        let machine = PhantomData;
        let coder = Self { rest, beyond: 0, value, length: u32::MAX, excess: 0, machine };
        (value < coder.length).then_some(coder)
    }

    /// The same for another instruction set.
    pub(super) fn on<N: InstructionSet>(self) -> RangeDecoder<'a, N> {
        let Self { rest, beyond, value, length, excess, .. } = self;
        RangeDecoder { rest, beyond, value, length, excess, machine: PhantomData }
    }

    /// Marks the stream as damaged.
    pub(super) fn doubt(&mut self) {
        self.excess |= 1;
    }

    /// Whether everything read so far may come from an encoder.
    pub(super) fn is_sound(&self) -> bool {
        self.beyond == 0 && self.excess == 0
    }

    /// Whether the stream ends here as an encoder ends it: encoders write a value 2^24 into the remaining interval,
    /// or half of that if it is short, in the minimum number of bytes, and pad with zeros for the bytes that a
    /// decoder reads ahead. A wrongly decoded stream hardly ever gets there.
    pub(super) fn is_at_end(&self) -> bool {
        let (most, unit) = match self.length > 1 << 25 {
            true => (1 << 24, 1 << 24),
            false => (1 << 23, 1 << 16),
        };
        self.is_sound() && (most - unit + 1..=most).contains(&self.value)
    }

    /// Whether the stream ends here, without surplus bytes.
    pub(super) fn is_all(&self) -> bool {
        self.is_at_end() && self.left() == 0
    }

    /// Number of unread bytes.
    pub(super) fn left(&self) -> usize {
        self.rest.len()
    }

    /// The same decoder with other bytes to continue.
    pub(super) fn with<'b>(self, rest: &'b [u8]) -> RangeDecoder<'b, M> {
        let Self { beyond, value, length, excess, machine, .. } = self;
        RangeDecoder { rest, beyond, value, length, excess, machine }
    }

    /// Decodes a symbol of an adaptive model.
    #[inline(always)]
    pub(super) fn symbol<const B: usize>(&mut self, model: &mut ArithmeticModel<B>) -> usize {
        let step = self.length >> MODEL_BITS;
        let found = model.find::<M>(self.value / step);
        let low = found.low * step;
        // The remainder of the division belongs to the last symbol.
        let high = if found.is_last { self.length } else { found.high * step };
        self.narrow(low, high - low);
        model.count(found.symbol);
        found.symbol
    }

    /// Decodes a bit of a bit model.
    #[inline(always)]
    pub(super) fn bit(&mut self, model: &mut BitModel) -> bool {
        let middle = model.zero * (self.length >> BIT_BITS);
        let bit = self.value >= middle;
        match bit {
            true => self.narrow(middle, self.length - middle),
            false => self.narrow(0, middle),
        }
        model.count(bit);
        bit
    }

    /// Decodes `bits` bits of equal probability, at most 32.
    #[inline(always)]
    pub(super) fn raw(&mut self, bits: u32) -> u32 {
        match bits <= RAW_BITS {
            true => self.few(bits),
            false => self.few(16) | self.few(bits - 16) << 16,
        }
    }

    #[inline(always)]
    fn few(&mut self, bits: u32) -> u32 {
        let step = self.length >> bits;
        let found = self.value / step;
        // A value in the remainder, which no encoder writes to.
        self.excess |= found >> bits;
        self.narrow(found * step, step);
        found
    }

    /// Narrows the interval to the part that begins at `low`, and reads bytes until it is long enough again.
    #[inline(always)]
    fn narrow(&mut self, low: u32, length: u32) {
        // All bytes at once: a loop over one byte at a time branches on what was decoded.
        let shift = length.leading_zeros() & 24;
        let next = self.take(shift as usize / 8);
        self.value = ((u64::from(self.value - low) << 32 | u64::from(next)) << shift >> 32) as u32;
        self.length = length << shift;
    }

    /// The next four bytes; consumes `count` of them, at most three.
    #[inline(always)]
    fn take(&mut self, count: usize) -> u32 {
        match self.rest.first_chunk() {
            Some(four) => {
                self.rest = &self.rest[count & 3..];
                u32::from_be_bytes(*four)
            }
            None => {
                let (four, rest, beyond) = tail(self.rest, count);
                self.rest = rest;
                self.beyond |= beyond;
                four
            }
        }
    }
}

/// The last bytes of a stream, padded with zeros; the rest after consuming `count`; and the number of bytes consumed
/// past the end.
#[cold]
#[inline(never)]
fn tail(rest: &[u8], count: usize) -> (u32, &[u8], u32) {
    let mut four = [0; 4];
    four[..rest.len().min(4)].copy_from_slice(&rest[..rest.len().min(4)]);
    let beyond = count.saturating_sub(rest.len());
    (u32::from_be_bytes(four), rest.get(count..).unwrap_or_default(), beyond as u32)
}
