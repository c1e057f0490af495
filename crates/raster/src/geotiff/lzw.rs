//! LZW of TIFF: codes of 9 to 12 bits, most significant bit first, whose width grows with the table (TIFF 6.0
//! section 13). Also the variant of TIFF 5 and before, least significant bit first.

use terrane_base::limits::MAX_BLOCK_BYTES;

/// Clear code.
const CLEAR: usize = 256;
/// End code.
const END: usize = 257;
/// First code of the table that the stream defines.
const FIRST: usize = 258;
/// Maximum number of codes.
const CODES: usize = 1 << WIDEST;
const NARROWEST: u32 = 9;
const WIDEST: u32 = 12;

/// The stream uses an undefined code.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct InvalidCode;

/// Decodes `packed` into the start of `out` and returns the number of bytes written; stops when `out` is
/// full, at the end code, or at the end of `packed`. The rest of `out` is unspecified. Linear in `out`, which
/// is at most [`MAX_BLOCK_BYTES`] long.
pub(super) fn decode(
    packed: &[u8],
    out: &mut [u8],
    table: &mut LzwTable,
) -> Result<usize, InvalidCode> {
    // Both variants begin with a clear code.
    if matches!(packed, [0, second, ..] if second & 1 == 1) {
        run::<true>(packed, out, table)
    } else {
        run::<false>(packed, out, table)
    }
}

fn run<const OLD: bool>(
    packed: &[u8],
    out: &mut [u8],
    table: &mut LzwTable,
) -> Result<usize, InvalidCode> {
    let mut codes = LzwCodes::<OLD>::new(packed);
    let mut at = 0;
    while at < out.len() {
        codes.set_width(NARROWEST);
        match codes.next() {
            Some(CLEAR) => {}
            None | Some(END) => break,
            Some(byte @ 0..CLEAR) => {
                out[at] = byte as u8;
                match strings(&mut codes, LzwString::of(byte as u8), out, at, table)? {
                    LzwStop::Clear(end) => at = end,
                    LzwStop::End(end) => return Ok(end),
                }
            }
            Some(_) => return Err(InvalidCode),
        }
    }
    Ok(at)
}

/// End of the output, and whether more may follow.
enum LzwStop {
    Clear(usize),
    End(usize),
}

/// Decodes up to the next clear code or the end. `last` is the preceding one-byte string at `last_at`. Every
/// code defines the next free one: the previous string and the first byte of its own.
fn strings<const OLD: bool>(
    codes: &mut LzwCodes<'_, OLD>,
    mut last: LzwString,
    out: &mut [u8],
    mut last_at: usize,
    LzwTable(table): &mut LzwTable,
) -> Result<LzwStop, InvalidCode> {
    let mut at = last_at + 1;
    let mut free = FIRST;
    while at < out.len() {
        let Some(code) = codes.next() else { break };
        let text = match code {
            CLEAR => return Ok(LzwStop::Clear(at)),
            END => break,
            _ if code < free => table[code],
            // The code being defined: its first byte is that of the previous string.
            _ if code == free => last.then(last.first(), last_at, at),
            _ => return Err(InvalidCode),
        };
        // If all codes are used, this writes to the entry that no code reaches.
        table[free] = last.then(text.first(), last_at, at);
        free += 1;
        if free >= codes.limit {
            codes.set_width((codes.width + 1).min(WIDEST));
            free = free.min(CODES);
        }
        (last, last_at) = (text, at);
        at = text.write(out, at);
    }
    Ok(LzwStop::End(at))
}

/// Bit reader of codes.
struct LzwCodes<'a, const OLD: bool> {
    packed: &'a [u8],
    /// Bit position of the next code.
    bit: usize,
    width: u32,
    /// Free code at which the width grows.
    limit: usize,
}

impl<'a, const OLD: bool> LzwCodes<'a, OLD> {
    fn new(packed: &'a [u8]) -> Self {
        Self { packed, bit: 0, width: 0, limit: 0 }
    }

    /// The width grows one code early, except in the old variant.
    fn set_width(&mut self, width: u32) {
        self.width = width;
        self.limit = match width {
            WIDEST => CODES + 1,
            _ if OLD => 1 << width,
            _ => (1 << width) - 1,
        };
    }

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let word = match self.packed[self.bit / 8..].first_chunk() {
            Some(bytes) => *bytes,
            None => last_bytes(self.packed, self.bit, self.width)?,
        };
        let skip = self.bit % 8;
        self.bit += self.width as usize;
        let code = if OLD {
            u32::from_le_bytes(word) >> skip & ((1 << self.width) - 1)
        } else {
            u32::from_be_bytes(word) << skip >> (u32::BITS - self.width)
        };
        Some(code as usize % CODES)
    }
}

/// The bytes from bit `bit` on if fewer than four are left, provided they contain a code of `width` bits.
#[cold]
fn last_bytes(packed: &[u8], bit: usize, width: u32) -> Option<[u8; 4]> {
    let rest = &packed[bit / 8..];
    let mut word = [0; 4];
    word[..rest.len()].copy_from_slice(rest);
    (bit + width as usize <= 8 * packed.len()).then_some(word)
}

/// The strings of the codes, and one that no code reaches.
pub(super) struct LzwTable([LzwString; CODES + 1]);

impl LzwTable {
    /// A table of one-byte strings; further strings are set before use.
    pub(super) fn new() -> Box<Self> {
        Box::new(Self(std::array::from_fn(|code| LzwString::of(code as u8))))
    }
}

/// A string. The highest byte is the length, the others are the bytes from the lowest on. A longer string has
/// its first byte, its offset in the output (4 bytes) and its length (2 bytes), marked by
/// [`LzwString::LONG`].
#[derive(Clone, Copy)]
struct LzwString(u64);

// Offsets have four bytes.
const _: () = assert!(MAX_BLOCK_BYTES <= u32::MAX as u64);

impl LzwString {
    const LONG: u64 = 8;
    /// Bytes copied in one step.
    const STEP: usize = 16;

    fn of(byte: u8) -> Self {
        Self(u64::from(byte) | 1 << 56)
    }

    #[inline(always)]
    fn first(self) -> u8 {
        self.0 as u8
    }

    /// This string, written to `start..end`, with `byte` appended.
    #[inline(always)]
    fn then(self, byte: u8, start: usize, end: usize) -> Self {
        let length = self.0 >> 56;
        if length < Self::LONG - 1 {
            return Self((self.0 + (1 << 56)) | u64::from(byte) << (8 * length));
        }
        let longer = (end - start + 1) as u64;
        Self(self.0 & 0xFF | (start as u64) << 8 | longer << 40 | Self::LONG << 56)
    }

    /// Writes the string, or as much as fits, to `at` and returns its end. Bytes after the end may be
    /// overwritten.
    #[inline(always)]
    fn write(self, out: &mut [u8], at: usize) -> usize {
        let length = (self.0 >> 56) as usize;
        if length >= Self::LONG as usize {
            return self.repeat(out, at);
        }
        let bytes = self.0.to_le_bytes();
        match out[at..].first_chunk_mut() {
            Some(room) => *room = bytes,
            None => {
                let room = length.min(out.len() - at);
                out[at..at + room].copy_from_slice(&bytes[..room]);
                return at + room;
            }
        }
        at + length
    }

    /// Copies a long string from its earlier position in the output.
    #[inline(always)]
    fn repeat(self, out: &mut [u8], at: usize) -> usize {
        let start = (self.0 >> 8) as u32 as usize;
        let length = (self.0 >> 40) as u16 as usize;
        let end = at + length;
        if end + Self::STEP > out.len() {
            return repeat_last(out, start, at, length);
        }
        for done in (0..length).step_by(Self::STEP) {
            let from = start + done;
            out.copy_within(from..from + Self::STEP, at + done);
        }
        // The string of a code that defines itself ends with the first byte of this copy.
        if start + length > at {
            out[end - 1] = self.first();
        }
        end
    }
}

/// Copies byte by byte, near the end of the output.
#[cold]
fn repeat_last(out: &mut [u8], start: usize, at: usize, length: usize) -> usize {
    let end = out.len().min(at + length);
    for to in at..end {
        out[to] = out[start + to - at];
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use weezl::{BitOrder, LzwStatus, decode::Configuration, encode::Encoder};

    fn ours(packed: &[u8], bytes: usize) -> Result<Vec<u8>, InvalidCode> {
        let mut out = vec![0; bytes];
        let written = decode(packed, &mut out, &mut LzwTable::new())?;
        out.truncate(written);
        Ok(out)
    }

    /// The twin.
    fn theirs(packed: &[u8], bytes: usize) -> Result<Vec<u8>, InvalidCode> {
        let old = matches!(packed, [0, second, ..] if second & 1 == 1);
        let kind = match old {
            true => Configuration::new(BitOrder::Lsb, 8),
            false => Configuration::with_tiff_size_switch(BitOrder::Msb, 8),
        };
        let mut decoder = kind.with_yield_on_full_buffer(true).build();
        let mut out = vec![0; bytes];
        let (mut read, mut written) = (0, 0);
        while written < bytes {
            let step = decoder.decode_bytes(&packed[read..], &mut out[written..]);
            (read, written) = (read + step.consumed_in, written + step.consumed_out);
            match step.status {
                Ok(LzwStatus::Ok) if step.consumed_in + step.consumed_out > 0 => {}
                // Of some codes that are invalid it says nothing, and stands still before the end.
                Ok(LzwStatus::Ok) if read < packed.len() => return Err(InvalidCode),
                Ok(_) => break,
                Err(_) => return Err(InvalidCode),
            }
        }
        out.truncate(written);
        Ok(out)
    }

    fn encoder(old: bool) -> Encoder {
        match old {
            true => Encoder::new(BitOrder::Lsb, 8),
            false => Encoder::with_tiff_size_switch(BitOrder::Msb, 8),
        }
    }

    /// Data of few or many kinds of bytes, with runs.
    fn data() -> impl Strategy<Value = Vec<u8>> {
        let run = |kinds| prop::collection::vec((0..=kinds, 1_usize..40), 0..400);
        (1..=255_u8).prop_flat_map(run).prop_map(|runs| {
            let bytes = runs
                .into_iter()
                .flat_map(|(byte, n)| std::iter::repeat_n(byte, if n < 30 { 1 } else { n * n }));
            bytes.collect()
        })
    }

    /// Packs codes as they would be read, first bit first; each is told by its part of the codes
    /// there are by then, so that most are valid and many define themselves.
    fn packed(parts: &[u16]) -> Vec<u8> {
        let (mut bits, mut free, mut width) = (Vec::new(), 0, NARROWEST);
        for part in std::iter::once(&0).chain(parts) {
            let code = match part {
                0 => CLEAR,
                1 => END,
                _ if free < FIRST => usize::from(part % 256),
                2..2000 => free % CODES,
                _ => match usize::from(*part) * free / usize::from(u16::MAX) % CODES {
                    CLEAR | END => 0,
                    code => code,
                },
            };
            bits.extend((0..width).rev().map(|bit| code >> bit & 1 == 1));
            free = if code == CLEAR { FIRST - 1 } else { (free + 1).min(CODES) };
            width = (usize::BITS - (free + 1).leading_zeros()).clamp(NARROWEST, WIDEST);
        }
        let byte = |bits: &[bool]| {
            bits.iter().enumerate().fold(0, |byte, (i, bit)| byte | u8::from(*bit) << (7 - i))
        };
        bits.chunks(8).map(byte).collect()
    }

    proptest! {
        #[test]
        fn what_was_encoded_comes_back(
            data in data(), old: bool, more in 0_usize..40, part in 0.0..1.0,
        ) {
            let packed = encoder(old).encode(&data).unwrap();
            prop_assert_eq!(&ours(&packed, data.len() + more).unwrap(), &data);
            let some = (data.len() as f64 * part) as usize;
            prop_assert_eq!(&ours(&packed, some).unwrap(), &data[..some]);
            let short = &packed[..(packed.len() as f64 * part) as usize];
            prop_assert_eq!(ours(short, data.len()), theirs(short, data.len()));
        }

        #[test]
        fn damaged_streams_give_what_the_twin_gives(
            data in data(), old: bool,
            damage in prop::collection::vec((0.0..1.0, any::<u8>()), 1..4),
        ) {
            let mut packed = encoder(old).encode(&data).unwrap();
            for (place, bits) in damage {
                let at = (packed.len() as f64 * place) as usize;
                packed[at] ^= bits;
            }
            let bytes = 2 * data.len();
            prop_assert_eq!(ours(&packed, bytes), theirs(&packed, bytes));
        }

        #[test]
        fn any_codes_give_what_the_twin_gives(
            parts in prop::collection::vec(0..=u16::MAX, 0..6000), bytes in 0_usize..200_000,
        ) {
            let packed = packed(&parts);
            prop_assert_eq!(ours(&packed, bytes), theirs(&packed, bytes));
        }

        #[test]
        fn any_bytes_give_what_the_twin_gives(
            packed in prop::collection::vec(any::<u8>(), 0..300), bytes in 0_usize..3000,
        ) {
            prop_assert_eq!(ours(&packed, bytes), theirs(&packed, bytes));
        }
    }

    #[test]
    fn a_table_may_fill_up_and_serve_on() {
        let parts: Vec<u16> = (0..20_000).map(|i| 3000 + i * 3).collect();
        let packed = packed(&parts);
        let full = ours(&packed, 1 << 22).unwrap();
        assert_eq!(full, theirs(&packed, 1 << 22).unwrap());
        assert!(full.len() > parts.len(), "{}", full.len());
    }

    #[test]
    fn a_table_used_before_gives_the_same() {
        let mut table = LzwTable::new();
        for shift in [3, 9, 0] {
            let data: Vec<u8> = (0..9000_u32).map(|i| (i >> shift) as u8).collect();
            let mut out = vec![0; data.len()];
            let packed = encoder(false).encode(&data).unwrap();
            assert_eq!(decode(&packed, &mut out, &mut table), Ok(data.len()));
            assert_eq!(out, data);
        }
    }
}
