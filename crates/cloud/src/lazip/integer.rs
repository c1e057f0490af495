//! Integers coded as differences from their predictions.

use super::coder::RangeDecoder;
use super::machine::InstructionSet;
use super::model::{ArithmeticModel, BitModel};
use super::range_encoder::RangeEncoder;
use std::hint::select_unpredictable;

/// Modelled upper bits of a difference; lower bits are stored raw.
const MODELLED: u32 = 8;

/// Decoder of integers with `C` contexts.
pub(super) struct IntegerDecoder<const C: usize> {
    /// Bit length of the difference, by context.
    sizes: [ArithmeticModel<4>; C],
    /// Differences of zero or one.
    bit: BitModel,
    /// Upper bits of a difference, by its bit length.
    parts: [ArithmeticModel<16>; 32],
    /// Symbols of `sizes`.
    symbols: usize,
}

impl<const C: usize> IntegerDecoder<C> {
    /// A decoder of integers of `bits` bits, at most 32.
    pub(super) const fn new(bits: usize) -> Self {
        Self {
            sizes: [const { ArithmeticModel::new() }; C],
            bit: BitModel::new(),
            parts: [const { ArithmeticModel::new() }; 32],
            symbols: bits + 1,
        }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.sizes.iter_mut().for_each(ArithmeticModel::clear);
        self.bit = BitModel::new();
        self.parts.iter_mut().for_each(ArithmeticModel::clear);
    }

    /// Decodes a difference and its bit length.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        circumstance: usize,
    ) -> (i32, u32) {
        let size = self.size(coder, circumstance);
        let upper = self.upper(coder, size);
        (lower(coder, size, upper), size)
    }

    /// Encodes a difference; returns its bit length.
    #[inline(always)]
    pub(super) fn put(
        &mut self,
        coder: &mut RangeEncoder,
        circumstance: usize,
        difference: i32,
    ) -> u32 {
        let is_positive = difference > 0;
        // Lengths are those of values from -(2^size - 1) to 2^size.
        let away = (difference.wrapping_sub(i32::from(is_positive))).unsigned_abs();
        let size = u32::BITS - away.leading_zeros();
        coder.symbol(self.sizes[circumstance.min(C - 1)].ready(self.symbols), size as usize);
        let place = match size {
            0 => {
                coder.bit(&mut self.bit, is_positive);
                return size;
            }
            1..32 if is_positive => difference as u32 - 1,
            1..32 => (difference as u32).wrapping_add((1 << size) - 1),
            _ => return size,
        };
        let raw = size.saturating_sub(MODELLED);
        let part = self.parts[size as usize & 31].ready(1 << size.min(MODELLED));
        coder.symbol(part, (place >> raw) as usize);
        if raw > 0 {
            coder.raw(raw, place & ((1 << raw) - 1));
        }
        size
    }

    /// Decodes the bit length of the next difference.
    #[inline(always)]
    pub(super) fn size<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        circumstance: usize,
    ) -> u32 {
        coder.symbol(self.sizes[circumstance.min(C - 1)].ready(self.symbols)) as u32
    }

    /// Decodes the upper bits of a difference of `size` bits.
    #[inline(always)]
    pub(super) fn upper<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        size: u32,
    ) -> u32 {
        match size {
            0 => u32::from(coder.bit(&mut self.bit)),
            1..32 => {
                let part = self.parts[size as usize].ready(1 << size.min(MODELLED));
                coder.symbol(part) as u32
            }
            _ => 0,
        }
    }
}

/// Completes a difference of `size` bits from its upper bits: a value from -(2^size - 1) to 2^size that does not fit
/// a smaller size.
#[inline(always)]
pub(super) fn lower<M: InstructionSet>(coder: &mut RangeDecoder<M>, size: u32, upper: u32) -> i32 {
    let place = match size {
        0 => return upper as i32,
        1..=MODELLED => upper,
        // The only difference of 32 bits; LASzip stores nothing more of it.
        32.. => return i32::MIN,
        _ => upper << (size - MODELLED) | coder.raw(size - MODELLED),
    };
    let is_positive = place >> (size - 1) != 0;
    // The sign is a coin toss: a branch would be predicted wrongly half of the time.
    place.wrapping_add(select_unpredictable(is_positive, 1, 1_u32.wrapping_sub(1 << size))) as i32
}
