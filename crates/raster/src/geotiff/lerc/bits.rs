//! Bytes and packed bits of a LERC blob, taken one after the other; all ends are checked.

/// What is left of a blob.
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.array().map(|[byte]| byte)
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }

    /// At most `most` whole numbers, packed with the fewest bits that hold the largest, or as places
    /// in a table of the values that occur.
    pub(super) fn packed(&mut self, most: usize) -> Option<Vec<u32>> {
        let head = self.byte()?;
        let count = match head >> 6 {
            0 => u32::from_le_bytes(self.array()?),
            1 => u16::from_le_bytes(self.array()?).into(),
            2 => self.byte()?.into(),
            _ => return None,
        };
        let count = usize::try_from(count).ok().filter(|count| *count <= most)?;
        let bits = u32::from(head & 31);
        if head & 32 == 0 {
            return self.unpack(count, bits);
        }
        let others = usize::from(self.byte()?.checked_sub(1)?);
        let mut table = vec![0];
        table.extend(self.unpack(others, bits)?);
        let places = self.unpack(count, usize::BITS - others.leading_zeros())?;
        places.into_iter().map(|place| table.get(place as usize).copied()).collect()
    }

    /// `count` numbers of `bits` bits each, low bits first; numbers of no bits are zero.
    fn unpack(&mut self, count: usize, bits: u32) -> Option<Vec<u32>> {
        let packed = self.take((count * bits as usize).div_ceil(8))?;
        let mut bytes = packed.iter();
        let (mut waiting, mut held) = (0_u64, 0);
        let mut next = || {
            while held < bits {
                waiting |= u64::from(*bytes.next()?) << held;
                held += 8;
            }
            let number = waiting & ((1 << bits) - 1);
            (waiting, held) = (waiting >> bits, held - bits);
            Some(number as u32)
        };
        (0..count).map(|_| next()).collect()
    }
}

/// Bits of 32-bit words, high bits first.
pub(super) struct Words<'a> {
    bytes: &'a [u8],
    /// Of the next bit.
    at: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(super) fn bit(&mut self) -> Option<u32> {
        // Words are little-endian: their high byte is the last.
        let byte = self.bytes.get((self.at / 8) ^ 3)?;
        let bit = u32::from(*byte) >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit)
    }

    /// Whole words that have been begun.
    pub(super) fn words(&self) -> usize {
        self.at.div_ceil(32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The slow twin of the packing: bit by bit.
    fn pack(numbers: &[u32], bits: u32) -> Vec<u8> {
        let mut out = vec![0; (numbers.len() * bits as usize).div_ceil(8)];
        for (i, number) in numbers.iter().enumerate() {
            for bit in (0..bits as usize).filter(|bit| number >> bit & 1 == 1) {
                let at = i * bits as usize + bit;
                out[at / 8] |= 1 << (at % 8);
            }
        }
        out
    }

    proptest! {
        #[test]
        fn packed_numbers_come_back(numbers in prop::collection::vec(any::<u32>(), 0..90), bits in 0_u32..32) {
            let numbers: Vec<u32> =
                numbers.iter().map(|n| (u64::from(*n) & ((1 << bits) - 1)) as u32).collect();
            let mut blob = vec![0x80 | bits as u8, numbers.len() as u8];
            blob.extend(pack(&numbers, bits));
            let mut bytes = Bytes(&blob);
            prop_assert_eq!(bytes.packed(90), Some(numbers.clone()));
            prop_assert!(bytes.0.is_empty());
            prop_assert!(numbers.is_empty() || Bytes(&blob).packed(numbers.len() - 1).is_none());
            let short = Bytes(&blob[..blob.len() - 1]).packed(90);
            prop_assert!(short.is_none() || blob.len() == 2);
        }
    }

    #[test]
    fn tables_of_values() {
        let mut blob = vec![0x80 | 32 | 10, 5, 3];
        blob.extend(pack(&[700, 900], 10));
        blob.extend(pack(&[0, 2, 1, 2, 0], 2));
        assert_eq!(Bytes(&blob).packed(9), Some(vec![0, 900, 700, 900, 0]));
        *blob.last_mut().unwrap() |= 3;
        assert_eq!(Bytes(&blob).packed(9), None, "beyond the table");
        assert_eq!(Bytes(&[0x80 | 32 | 10, 5, 0]).packed(9), None, "no table");
    }

    #[test]
    fn bits_of_words_come_from_the_high_end() {
        let mut words = Words::new(&[0x01, 0, 0, 0xc0, 0, 0, 0, 0x80]);
        let bits: Vec<u32> = std::iter::from_fn(|| words.bit()).collect();
        let set: Vec<usize> = (0..bits.len()).filter(|i| bits[*i] == 1).collect();
        assert_eq!((bits.len(), set), (64, vec![0, 1, 31, 32]));
        assert_eq!(words.words(), 2);
    }
}
