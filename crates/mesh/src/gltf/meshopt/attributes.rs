//! Elements of fixed size, such as positions: blocks of up to 256 elements, with differences of each byte to the
//! previous element, in groups of 16 with 0, 2, 4 or 8 bits each.

use super::stream::{MeshoptCodec, MeshoptWindow};
use terrane_base::error::{Error, Result};

const HEADER: u8 = 0xa0;
const GROUP: usize = 16;
/// Maximum bytes and elements of a block.
const BLOCK_BYTES: usize = 8192;
const BLOCK_ELEMENTS: usize = 256;
const TAIL_BYTES: usize = 32;
/// Bits of a difference by the two-bit code of a group. A difference that does not fit into 2 or 4 bits is marked by
/// all bits set and stored after the group.
const BITS: [usize; 4] = [0, 2, 4, 8];

/// Elements per block for elements of `stride` bytes.
const fn block_elements(stride: usize) -> usize {
    let max_elements = BLOCK_BYTES / stride / GROUP * GROUP;
    if max_elements < BLOCK_ELEMENTS { max_elements } else { BLOCK_ELEMENTS }
}

/// Writes one stream of elements.
pub(crate) struct MeshoptAttributeWriter {
    stride: usize,
    /// The first element; empty until known.
    first: Vec<u8>,
    /// The last element of the written blocks.
    last: Vec<u8>,
    /// Elements of the next block.
    waiting: Vec<u8>,
}

impl MeshoptAttributeWriter {
    /// For elements of `stride` bytes: a multiple of 4, at most 256.
    pub(crate) fn new(stride: usize) -> Self {
        Self { stride, first: Vec::new(), last: Vec::new(), waiting: Vec::new() }
    }

    /// Adds elements; complete blocks go to `out`.
    pub(crate) fn push(&mut self, elements: &[u8], out: &mut Vec<u8>) {
        if self.first.is_empty() && !elements.is_empty() {
            self.first = elements[..self.stride].to_vec();
            self.last.clone_from(&self.first);
            out.push(HEADER);
        }
        let block = block_elements(self.stride) * self.stride;
        for element in elements.chunks_exact(self.stride) {
            self.waiting.extend_from_slice(element);
            if self.waiting.len() == block {
                self.write_block(out);
            }
        }
    }

    /// Writes the remaining elements. Without elements there is no stream.
    pub(crate) fn complete(&mut self, out: &mut Vec<u8>) {
        if self.first.is_empty() {
            return;
        }
        if !self.waiting.is_empty() {
            self.write_block(out);
        }
        // Decoders that load 32 bytes at a time must not run over the end, so the tail is never shorter.
        out.extend(std::iter::repeat_n(0, TAIL_BYTES.saturating_sub(self.stride)));
        out.extend_from_slice(&self.first);
    }

    fn write_block(&mut self, out: &mut Vec<u8>) {
        let mut codes = [0; BLOCK_ELEMENTS];
        let elements = self.waiting.len() / self.stride;
        let groups = elements.div_ceil(GROUP);
        for place in 0..self.stride {
            let mut before = self.last[place];
            // The last group of the stream is padded. Codes of 0 take no bits where the group has only them.
            codes[..groups * GROUP].fill(0);
            let bytes = self.waiting[place..].iter().step_by(self.stride);
            for (code, &byte) in codes.iter_mut().zip(bytes) {
                *code = folded(byte.wrapping_sub(before));
                before = byte;
            }
            write_groups(&codes[..groups * GROUP], out);
        }
        self.last.copy_from_slice(&self.waiting[(elements - 1) * self.stride..]);
        self.waiting.clear();
    }
}

/// Zigzag encoding of differences.
fn folded(difference: u8) -> u8 {
    difference << 1 ^ if difference & 0x80 == 0 { 0 } else { 0xff }
}

fn unfolded(code: u8) -> u8 {
    code >> 1 ^ (code & 1).wrapping_neg()
}

/// Groups of one byte of the elements: two-bit codes first, then the data.
fn write_groups(codes: &[u8], out: &mut Vec<u8>) {
    let groups = codes.len() / GROUP;
    let head = out.len();
    out.resize(head + groups.div_ceil(4), 0);
    for (group, codes) in codes.chunks_exact(GROUP).enumerate() {
        let smallest = (0..BITS.len()).min_by_key(|mode| group_bytes(codes, BITS[*mode]));
        let mode = smallest.unwrap_or(3);
        out[head + group / 4] |= (mode as u8) << (2 * (group % 4));
        write_group(codes, BITS[mode], out);
    }
}

/// Bytes of a group with this bit width; a huge value if it does not fit.
fn group_bytes(codes: &[u8], bits: usize) -> usize {
    match bits {
        0 if codes.iter().any(|code| *code > 0) => usize::MAX,
        0 | 8 => 2 * bits,
        _ => 2 * bits + codes.iter().filter(|code| **code >= mark(bits)).count(),
    }
}

/// Marker of a difference that does not fit into these bits.
fn mark(bits: usize) -> u8 {
    (1 << bits) - 1
}

fn write_group(codes: &[u8], bits: usize, out: &mut Vec<u8>) {
    match bits {
        0 => {}
        8 => out.extend_from_slice(codes),
        _ => {
            let mark = mark(bits);
            for some in codes.chunks_exact(8 / bits) {
                out.push(some.iter().fold(0, |byte, code| byte << bits | code.min(&mark)));
            }
            out.extend(codes.iter().filter(|code| **code >= mark));
        }
    }
}

/// Reads a stream of elements.
pub(crate) struct MeshoptAttributeReader {
    /// Offset of the stream, and its last element.
    start: u64,
    end: u64,
    stride: usize,
    count: u64,
    first: Vec<u8>,
}

/// A position between two blocks.
#[derive(Clone)]
pub(crate) struct MeshoptAttributeCursor {
    element: u64,
    offset: u64,
    /// The previous element.
    last: Vec<u8>,
}

impl MeshoptAttributeReader {
    /// The stream of `count` elements of `stride` bytes at `start`, with `bytes` bytes.
    pub(crate) fn new(
        window: &mut MeshoptWindow<'_>,
        start: u64,
        bytes: u64,
        stride: usize,
        count: u64,
    ) -> Result<Self> {
        if !(4..=256).contains(&stride) || !stride.is_multiple_of(4) {
            return Err(bad(format!("has an invalid stride of {stride} bytes")));
        }
        let tail = TAIL_BYTES.max(stride) as u64;
        let block = block_elements(stride) as u64;
        let min_bytes = (count / block)
            .checked_mul(min_block_bytes(block, stride))
            .and_then(|b| b.checked_add(min_block_bytes(count % block, stride) + 1 + tail));
        if min_bytes.is_none_or(|min_bytes| bytes < min_bytes) {
            return Err(bad(format!("has only {bytes} bytes for {count} elements")));
        }
        if window.bytes(start, 1)? != [HEADER] {
            return Err(bad("has an unknown type or version"));
        }
        let end = start + bytes - tail;
        let first = window.bytes(end + tail - stride as u64, stride)?.to_vec();
        Ok(Self { start, end, stride, count, first })
    }
}

/// Smallest size of a block: a byte plane has at least two bits for each group.
fn min_block_bytes(elements: u64, stride: usize) -> u64 {
    elements.div_ceil(GROUP as u64).div_ceil(4) * stride as u64
}

impl MeshoptCodec for MeshoptAttributeReader {
    type Place = MeshoptAttributeCursor;

    fn start(&self) -> MeshoptAttributeCursor {
        MeshoptAttributeCursor { element: 0, offset: self.start + 1, last: self.first.clone() }
    }

    fn index(&self, place: &MeshoptAttributeCursor) -> u64 {
        place.element
    }

    fn count(&self) -> u64 {
        self.count
    }

    fn step_elements(&self) -> u64 {
        block_elements(self.stride) as u64
    }

    fn element_bytes(&self) -> usize {
        self.stride
    }

    fn step(
        &self,
        place: &mut MeshoptAttributeCursor,
        window: &mut MeshoptWindow<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        let left = self.count - place.element;
        let elements = left.min(self.step_elements()) as usize;
        let groups = elements.div_ceil(GROUP);
        out.clear();
        out.resize(groups * GROUP * self.stride, 0);
        for at in 0..self.stride {
            let mut before = place.last[at];
            let mut heads = [0; BLOCK_ELEMENTS / GROUP / 4];
            let heads = &mut heads[..groups.div_ceil(4)];
            self.take(place, heads.len(), window, heads)?;
            for group in 0..groups {
                let bits = BITS[usize::from(heads[group / 4] >> (2 * (group % 4)) & 3)];
                let codes = self.group(place, bits, window)?;
                let bytes = out[group * GROUP * self.stride + at..].iter_mut();
                for (byte, code) in bytes.step_by(self.stride).zip(codes) {
                    before = before.wrapping_add(unfolded(code));
                    *byte = before;
                }
            }
        }
        out.truncate(elements * self.stride);
        place.last.copy_from_slice(&out[(elements - 1) * self.stride..]);
        place.element += elements as u64;
        if place.element == self.count && place.offset != self.end {
            return Err(bad(format!("has {} surplus bytes", self.end - place.offset)));
        }
        Ok(())
    }
}

impl MeshoptAttributeReader {
    /// Copies the next bytes of the stream.
    fn take(
        &self,
        place: &mut MeshoptAttributeCursor,
        count: usize,
        window: &mut MeshoptWindow<'_>,
        to: &mut [u8],
    ) -> Result<()> {
        if place.offset + count as u64 > self.end {
            return Err(bad("is truncated"));
        }
        to.copy_from_slice(window.bytes(place.offset, count)?);
        place.offset += count as u64;
        Ok(())
    }

    /// Reads the next group.
    fn group(
        &self,
        place: &mut MeshoptAttributeCursor,
        bits: usize,
        window: &mut MeshoptWindow<'_>,
    ) -> Result<[u8; 16]> {
        let mut codes = [0; GROUP];
        if bits == 0 {
            return Ok(codes);
        }
        let mut packed = [0; GROUP];
        let packed = &mut packed[..2 * bits];
        self.take(place, 2 * bits, window, packed)?;
        let per_byte = 8 / bits;
        for (at, code) in codes.iter_mut().enumerate() {
            let shift = 8 - bits * (at % per_byte + 1);
            *code = packed[at / per_byte] >> shift & ((1_u16 << bits) - 1) as u8;
        }
        if bits < 8 {
            let marked = codes.iter_mut().filter(|code| **code == mark(bits));
            for code in marked {
                self.take(place, 1, window, std::slice::from_mut(code))?;
            }
        }
        Ok(codes)
    }
}

fn bad(message: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("a compressed buffer view {message}"))
}
