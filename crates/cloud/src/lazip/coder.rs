//! The arithmetic decoder: one stream of bytes, read without a branch per symbol.

use super::machine::InstructionSet;
use super::model::{ArithmeticModel, BitModel};
use std::marker::PhantomData;

/// Bits of the interval that an adaptive model divides.
const MODEL_BITS: u32 = 15;
/// Bits of the interval that a model of one bit divides.
const BIT_BITS: u32 = 13;
/// Most bits that one division of the interval can yield.
const RAW_BITS: u32 = 19;

/// A stream being decoded. Sound streams hold every byte that their decoder takes in, so a stream
/// that was read past its end is damaged; until the caller looks, it reads as if zeros followed.
///
/// `value < length` and `length >= 2^24` hold between calls.
#[derive(Clone, Copy)]
pub(super) struct RangeDecoder<'a, M> {
    /// Bytes not yet taken in.
    rest: &'a [u8],
    /// Bytes that were taken in beyond the end.
    beyond: u32,
    value: u32,
    length: u32,
    /// Not zero if bits were read that no encoder writes.
    excess: u32,
    machine: PhantomData<M>,
}

impl<'a, M: InstructionSet> RangeDecoder<'a, M> {
    /// Starts on a stream; `None` when no encoder begins one like this.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (value, rest) = bytes.split_first_chunk()?;
        let value = u32::from_be_bytes(*value);
        let machine = PhantomData;
        let coder = Self { rest, beyond: 0, value, length: u32::MAX, excess: 0, machine };
        (value < coder.length).then_some(coder)
    }

    /// The same, for another machine.
    pub(super) fn on<N: InstructionSet>(self) -> RangeDecoder<'a, N> {
        let Self { rest, beyond, value, length, excess, .. } = self;
        RangeDecoder { rest, beyond, value, length, excess, machine: PhantomData }
    }

    /// Notes that what was read came from no encoder.
    pub(super) fn doubt(&mut self) {
        self.excess |= 1;
    }

    /// Whether all that was read so far may come from an encoder.
    pub(super) fn is_sound(&self) -> bool {
        self.beyond == 0 && self.excess == 0
    }

    /// Whether the stream ends here, as every encoder ends one: at the last it names a place 2^24 into
    /// what is left of the interval, or half of that where it is narrow, by as few bytes as do, and
    /// fills up with zeros what a decoder takes in ahead. A stream that came to be read wrongly
    /// somewhere hardly ever gets there.
    pub(super) fn is_at_end(&self) -> bool {
        let (most, unit) = match self.length > 1 << 25 {
            true => (1 << 24, 1 << 24),
            false => (1 << 23, 1 << 16),
        };
        self.is_sound() && (most - unit + 1..=most).contains(&self.value)
    }

    /// Whether the stream ends here, and nothing follows it.
    pub(super) fn is_all(&self) -> bool {
        self.is_at_end() && self.left() == 0
    }

    /// Bytes that were not taken in.
    pub(super) fn left(&self) -> usize {
        self.rest.len()
    }

    /// The same, with other bytes to go on with.
    pub(super) fn with<'b>(self, rest: &'b [u8]) -> RangeDecoder<'b, M> {
        let Self { beyond, value, length, excess, machine, .. } = self;
        RangeDecoder { rest, beyond, value, length, excess, machine }
    }

    /// The next symbol of an adaptive model.
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

    /// The next bit of a model of one bit.
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

    /// The next `bits` bits, all values alike; at most 32.
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

    /// Goes on with the part of the interval that begins at `low`, and takes in bytes until it is
    /// long enough again.
    #[inline(always)]
    fn narrow(&mut self, low: u32, length: u32) {
        // All bytes at once: a loop over one byte at a time branches on what was decoded.
        let shift = length.leading_zeros() & 24;
        let next = self.take(shift as usize / 8);
        self.value = ((u64::from(self.value - low) << 32 | u64::from(next)) << shift >> 32) as u32;
        self.length = length << shift;
    }

    /// The next four bytes, of which `count` are taken in, at most three.
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

/// The last bytes of a stream, followed by zeros; what is left of them after `count` are taken in;
/// how many of those are beyond the end.
#[cold]
#[inline(never)]
fn tail(rest: &[u8], count: usize) -> (u32, &[u8], u32) {
    let mut four = [0; 4];
    four[..rest.len().min(4)].copy_from_slice(&rest[..rest.len().min(4)]);
    let beyond = count.saturating_sub(rest.len());
    (u32::from_be_bytes(four), rest.get(count..).unwrap_or_default(), beyond as u32)
}
