//! The arithmetic encoder, the counterpart of the decoder: symbols narrow an interval whose lower end is the output.

use super::coder::{BIT_BITS, MODEL_BITS, RAW_BITS};
use super::model::{ArithmeticModel, BitModel};

/// A stream being encoded. `length >= 2^24` between calls.
pub(super) struct RangeEncoder {
    /// Output, and room for what one call adds.
    bytes: Vec<u8>,
    /// Bytes of output.
    filled: usize,
    /// Lower end of the interval, after the bytes of output.
    base: u32,
    length: u32,
}

impl RangeEncoder {
    /// An empty stream.
    pub(super) fn new() -> Self {
        Self { bytes: Vec::new(), filled: 0, base: 0, length: u32::MAX }
    }

    /// Encodes a symbol of an adaptive model.
    #[inline(always)]
    pub(super) fn symbol<const B: usize>(&mut self, model: &mut ArithmeticModel<B>, symbol: usize) {
        let step = self.length >> MODEL_BITS;
        let part = model.part(symbol);
        let low = part.low * step;
        // The remainder of the division belongs to the last symbol.
        let high = if part.is_last { self.length } else { part.high * step };
        self.narrow(low, high - low);
        model.count(symbol);
    }

    /// Encodes a bit of a bit model.
    #[inline(always)]
    pub(super) fn bit(&mut self, model: &mut BitModel, bit: bool) {
        let middle = model.zero * (self.length >> BIT_BITS);
        match bit {
            true => self.narrow(middle, self.length - middle),
            false => self.narrow(0, middle),
        }
        model.count(bit);
    }

    /// Encodes `bits` bits of equal probability, at most 32.
    #[inline(always)]
    pub(super) fn raw(&mut self, bits: u32, value: u32) {
        match bits <= RAW_BITS {
            true => self.few(bits, value),
            false => {
                self.few(16, value & 0xffff);
                self.few(bits - 16, value >> 16);
            }
        }
    }

    #[inline(always)]
    fn few(&mut self, bits: u32, value: u32) {
        let step = self.length >> bits;
        self.narrow(value * step, step);
    }

    /// Narrows the interval to the part that begins at `low`, and writes bytes until it is long enough again.
    #[inline(always)]
    fn narrow(&mut self, low: u32, length: u32) {
        let (base, overflows) = self.base.overflowing_add(low);
        if overflows {
            add_one(&mut self.bytes[..self.filled]);
        }
        // All bytes at once: how many are valid is not known to branches.
        let shift = length.leading_zeros() & 24;
        if self.bytes.len() < self.filled + 4 {
            // By value: an encoder whose address nobody takes stays in registers.
            self.bytes = enlarged(std::mem::take(&mut self.bytes));
        }
        self.bytes[self.filled..][..4].copy_from_slice(&base.to_be_bytes());
        self.filled += (shift / 8) as usize;
        self.base = base << shift;
        self.length = length << shift;
    }

    /// The whole stream: ends with a value of the interval in as few bytes as possible, and zeros that decoders read
    /// ahead.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let zeros = match self.length > 1 << 25 {
            true => {
                self.narrow(1 << 24, 1 << 23);
                3
            }
            false => {
                self.narrow(1 << 23, 1 << 15);
                2
            }
        };
        self.bytes.truncate(self.filled);
        self.bytes.resize(self.filled + zeros, 0);
        self.bytes
    }
}

/// The bytes with more room.
#[cold]
#[inline(never)]
fn enlarged(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.resize(2 * bytes.len() + 64, 0);
    bytes
}

/// Adds one to the number that the bytes are.
#[cold]
#[inline(never)]
fn add_one(bytes: &mut [u8]) {
    for byte in bytes.iter_mut().rev() {
        *byte = byte.wrapping_add(1);
        if *byte != 0 {
            break;
        }
    }
}
