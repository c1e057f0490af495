//! LERC version 2.4, the only one in TIFF files: a mask, then samples in small squares, each stored
//! plainly, as one value, or as whole steps above its lowest; 8-bit samples may be Huffman coded.
//!
//! After the description in Esri's reference code (github.com/Esri/lerc, Apache 2.0). The checksum
//! over the whole blob is verified before anything else is believed.

mod bits;
mod huffman;

use std::ops::Range;

use crate::SampleType;

use bits::{Bytes, Words};
use huffman::Code;

/// The version that is read.
const VERSION: i32 = 4;
/// Side of the squares that a writer may choose, at most.
const MOST_SQUARE: usize = 1024;

/// What a blob has to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) kind: SampleType,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Samples of a pixel.
    pub(super) depth: usize,
}

/// What is wrong with a blob, for people.
type Fault = String;

/// Decodes `data` into `out`: samples in native order, pixel by pixel. Samples outside the mask are
/// NaN, or 0 in integers. There is one blob, or for pixels of several samples one for each of them.
pub(super) fn decode(data: &[u8], shape: Shape, out: &mut [u8]) -> Result<(), Fault> {
    let blob = Blob::read(data)?;
    if blob.header.depth != 1 || shape.depth == 1 {
        return blob.decode(shape, &mut None, out);
    }
    let size = shape.kind.bytes();
    let mut band = vec![0; out.len() / shape.depth];
    let (mut data, mut mask) = (data, None);
    for sample in 0..shape.depth {
        let blob = Blob::read(data)?;
        blob.decode(Shape { depth: 1, ..shape }, &mut mask, &mut band)?;
        for (to, from) in out.chunks_exact_mut(size * shape.depth).zip(band.chunks_exact(size)) {
            to[sample * size..][..size].copy_from_slice(from);
        }
        data = blob.rest;
    }
    Ok(())
}

/// One bit for each pixel; `None` where all are valid.
type Mask = Option<Vec<bool>>;

/// A blob whose checksum is right.
struct Blob<'a> {
    header: Header,
    body: Bytes<'a>,
    /// What comes behind it.
    rest: &'a [u8],
}

impl<'a> Blob<'a> {
    fn read(data: &'a [u8]) -> Result<Self, Fault> {
        let (mut body, rest) = checked(data)?;
        let header = Header::read(&mut body).ok_or_else(damaged)?;
        Ok(Self { header, body, rest })
    }

    /// Decodes it; `mask` is that of the blob before and becomes its own.
    fn decode(&self, shape: Shape, mask: &mut Mask, out: &mut [u8]) -> Result<(), Fault> {
        self.header.check(shape)?;
        let mut bytes = Bytes(self.body.0);
        *mask = read_mask(&mut bytes, shape, self.header.valid, mask.take()).ok_or_else(damaged)?;
        let mut block = Block { shape, header: self.header, mask, highest: Vec::new(), out };
        block.clear();
        block.read(&mut bytes).ok_or_else(damaged)
    }
}

fn damaged() -> Fault {
    "invalid LERC data".to_owned()
}

/// The first blob behind its checksum, after which the version is known and all bytes are sound, and
/// what follows it.
fn checked(blob: &[u8]) -> Result<(Bytes<'_>, &[u8]), Fault> {
    let mut bytes = Bytes(blob);
    if bytes.take(6) != Some(b"Lerc2 ") {
        return Err("not LERC 2 data".to_owned());
    }
    let version = bytes.i32().ok_or_else(damaged)?;
    if version != VERSION {
        return Err(format!("LERC 2.{version} is not supported, 2.{VERSION} is"));
    }
    let stated = bytes.array().map(u32::from_le_bytes).ok_or_else(damaged)?;
    let size = bytes.0.get(20..24).and_then(|size| size.try_into().ok()).map(i32::from_le_bytes);
    let size = size.and_then(|size| usize::try_from(size).ok()).ok_or_else(damaged)?;
    let parts = size.checked_sub(14).and_then(|size| bytes.0.split_at_checked(size));
    let (summed, rest) = parts.ok_or_else(damaged)?;
    match fletcher32(summed) == stated {
        true => Ok((Bytes(summed), rest)),
        false => Err("LERC data does not match its checksum".to_owned()),
    }
}

/// Fletcher's checksum of big-endian 16-bit words; a last odd byte is the high one of a word.
fn fletcher32(bytes: &[u8]) -> u32 {
    let fold = |sum: u32| (sum & 0xffff) + (sum >> 16);
    let (mut low, mut high) = (0xffff_u32, 0xffff_u32);
    // As many words as can be added without overflow.
    for run in bytes.chunks(2 * 359) {
        for pair in run.chunks(2) {
            low += u32::from(pair[0]) << 8 | u32::from(pair.get(1).copied().unwrap_or(0));
            high += low;
        }
        (low, high) = (fold(low), fold(high));
    }
    fold(high) << 16 | fold(low)
}

/// What a blob says of itself.
#[derive(Clone, Copy, Debug)]
struct Header {
    height: i32,
    width: i32,
    depth: i32,
    valid: i32,
    square: i32,
    kind: i32,
    error: f64,
    low: f64,
    high: f64,
}

impl Header {
    fn read(bytes: &mut Bytes<'_>) -> Option<Self> {
        let [height, width, depth, valid, square, _size, kind] = [(); 7].map(|()| bytes.i32());
        let [error, low, high] = [(); 3].map(|()| bytes.f64());
        Some(Self {
            height: height?,
            width: width?,
            depth: depth?,
            valid: valid?,
            square: square?,
            kind: kind?,
            error: error?,
            low: low?,
            high: high?,
        })
    }

    fn check(&self, shape: Shape) -> Result<(), Fault> {
        let is = |found: i32, wanted: usize| usize::try_from(found) == Ok(wanted);
        let pixels = shape.width * shape.height;
        let size = is(self.width, shape.width) && is(self.height, shape.height);
        let sound = (0..=pixels as i64).contains(&self.valid.into())
            && (1..=MOST_SQUARE as i32).contains(&self.square);
        if !size || !is(self.depth, shape.depth) {
            return Err(format!(
                "LERC data of {} x {} pixels of {} samples where {} x {} of {} are expected",
                self.width, self.height, self.depth, shape.width, shape.height, shape.depth
            ));
        }
        if kind_of(self.kind) != Some(shape.kind) {
            return Err(format!("LERC data of another type than {}", shape.kind.name()));
        }
        if sound { Ok(()) } else { Err(damaged()) }
    }
}

/// Sample types by LERC's numbers.
fn kind_of(number: i32) -> Option<SampleType> {
    use SampleType::{F32, F64, I8, I16, I32, U8, U16, U32};
    [I8, U8, I16, U16, I32, U32, F32, F64].get(usize::try_from(number).ok()?).copied()
}

/// The type that a square's lowest value is stored in: the samples' own, or a narrower one.
fn narrowed(kind: SampleType, by: u8) -> Option<SampleType> {
    use SampleType::{F32, F64, I8, I16, I32, U8, U16, U32};
    Some(match (kind, by) {
        (kind @ (I8 | U8), _) | (kind, 0) => kind,
        (I16, 2) => I8,
        (I16 | U16, 1) | (F32, 2) | (I32, 3) | (U32, 2) => U8,
        (I32 | U32, 1) => U16,
        (I32, 2) | (F32, 1) | (F64, 3) => I16,
        (F64, 2) => I32,
        (F64, 1) => F32,
        _ => return None,
    })
}

/// One value of type `kind`.
fn value(bytes: &mut Bytes<'_>, kind: SampleType) -> Option<f64> {
    Some(match kind {
        SampleType::I8 => i8::from_le_bytes(bytes.array()?).into(),
        SampleType::U8 => bytes.byte()?.into(),
        SampleType::I16 => i16::from_le_bytes(bytes.array()?).into(),
        SampleType::U16 => u16::from_le_bytes(bytes.array()?).into(),
        SampleType::I32 => bytes.i32()?.into(),
        SampleType::U32 => u32::from_le_bytes(bytes.array()?).into(),
        SampleType::F32 => f32::from_le_bytes(bytes.array()?).into(),
        SampleType::F64 => bytes.f64()?,
        SampleType::F16 => return None,
    })
}

/// Which pixels are valid. A mask is not stored when all or none are, or when it is the same as
/// `before`.
fn read_mask(bytes: &mut Bytes<'_>, shape: Shape, valid: i32, before: Mask) -> Option<Mask> {
    let pixels = shape.width * shape.height;
    let stored = usize::try_from(bytes.i32()?).ok()?;
    let mut runs = Bytes(bytes.take(stored)?);
    if stored == 0 {
        let same = |mask: &Vec<bool>| mask.iter().filter(|valid| **valid).count() == valid as usize;
        return match valid as usize {
            0 => Some(Some(vec![false; pixels])),
            all if all == pixels => Some(None),
            _ => before.filter(same).map(Some),
        };
    }
    let mut bits = Vec::with_capacity(pixels.div_ceil(8));
    while bits.len() < pixels.div_ceil(8) {
        let room = pixels.div_ceil(8) - bits.len();
        match i16::from_le_bytes(runs.array()?) {
            i16::MIN => return None,
            count @ ..0 => {
                let byte = runs.byte()?;
                bits.extend(std::iter::repeat_n(byte, room.min(usize::from(count.unsigned_abs()))));
            }
            count => bits.extend(runs.take(count as usize)?.iter().take(room)),
        }
    }
    let mask: Vec<bool> = (0..pixels).map(|i| bits[i / 8] >> (7 - i % 8) & 1 == 1).collect();
    let counted = mask.iter().filter(|valid| **valid).count();
    (counted == valid as usize).then_some(Some(mask))
}

/// A block being decoded.
struct Block<'a> {
    shape: Shape,
    header: Header,
    mask: &'a Mask,
    /// Highest value of each sample of a pixel, where there are several.
    highest: Vec<f64>,
    out: &'a mut [u8],
}

impl Block<'_> {
    fn is_valid(&self, pixel: usize) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask[pixel])
    }

    fn pixels(&self) -> usize {
        self.shape.width * self.shape.height
    }

    /// Stores sample `sample` of a pixel.
    fn put(&mut self, pixel: usize, sample: usize, value: f64) {
        let kind = self.shape.kind;
        let at = (pixel * self.shape.depth + sample) * kind.bytes();
        let out = &mut self.out[at..at + kind.bytes()];
        match kind {
            SampleType::I8 => out.copy_from_slice(&(value as i8).to_ne_bytes()),
            SampleType::U8 => out.copy_from_slice(&(value as u8).to_ne_bytes()),
            SampleType::I16 => out.copy_from_slice(&(value as i16).to_ne_bytes()),
            SampleType::U16 => out.copy_from_slice(&(value as u16).to_ne_bytes()),
            SampleType::I32 => out.copy_from_slice(&(value as i32).to_ne_bytes()),
            SampleType::U32 => out.copy_from_slice(&(value as u32).to_ne_bytes()),
            SampleType::F32 => out.copy_from_slice(&(value as f32).to_ne_bytes()),
            SampleType::F64 => out.copy_from_slice(&value.to_ne_bytes()),
            SampleType::F16 => {}
        }
    }

    /// Everything void.
    fn clear(&mut self) {
        for pixel in 0..self.pixels() {
            (0..self.shape.depth).for_each(|sample| self.put(pixel, sample, f64::NAN));
        }
    }

    /// All valid pixels alike.
    fn fill(&mut self, values: &[f64]) {
        for pixel in 0..self.pixels() {
            if self.is_valid(pixel) {
                values
                    .iter()
                    .enumerate()
                    .for_each(|(sample, value)| self.put(pixel, sample, *value));
            }
        }
    }

    fn read(&mut self, bytes: &mut Bytes<'_>) -> Option<()> {
        let Header { valid, low, high, .. } = self.header;
        if valid == 0 {
            return Some(());
        }
        if low == high {
            self.fill(&vec![low; self.shape.depth]);
            return Some(());
        }
        let kind = self.shape.kind;
        let mut each = || (0..self.shape.depth).map(|_| value(bytes, kind)).collect();
        let (lowest, highest): (Option<Vec<f64>>, Option<Vec<f64>>) = (each(), each());
        let lowest = lowest?;
        self.highest = highest?;
        if lowest == self.highest {
            self.fill(&lowest);
            return Some(());
        }
        if bytes.byte()? != 0 {
            let Shape { width, height, depth, .. } = self.shape;
            return self.read_plain(bytes, 0..width, 0..height, 0..depth);
        }
        let is_coded = matches!(kind, SampleType::I8 | SampleType::U8) && self.header.error == 0.5;
        match if is_coded { bytes.byte()? } else { 0 } {
            0 => self.read_squares(bytes),
            1 => self.read_differences(bytes),
            2 => self.read_codes(bytes),
            _ => None,
        }
    }

    /// Values of all valid pixels of a part, one after the other.
    fn read_plain(
        &mut self,
        bytes: &mut Bytes<'_>,
        columns: Range<usize>,
        rows: Range<usize>,
        samples: Range<usize>,
    ) -> Option<()> {
        for row in rows {
            for column in columns.clone() {
                let pixel = row * self.shape.width + column;
                if self.is_valid(pixel) {
                    for sample in samples.clone() {
                        let value = value(bytes, self.shape.kind)?;
                        self.put(pixel, sample, value);
                    }
                }
            }
        }
        Some(())
    }

    fn read_squares(&mut self, bytes: &mut Bytes<'_>) -> Option<()> {
        let Shape { width, height, depth, .. } = self.shape;
        let side = self.header.square as usize;
        for row in (0..height).step_by(side) {
            for column in (0..width).step_by(side) {
                for sample in 0..depth {
                    let (right, bottom) = ((column + side).min(width), (row + side).min(height));
                    self.read_square(bytes, column..right, row..bottom, sample)?;
                }
            }
        }
        Some(())
    }

    fn read_square(
        &mut self,
        bytes: &mut Bytes<'_>,
        columns: Range<usize>,
        rows: Range<usize>,
        sample: usize,
    ) -> Option<()> {
        let head = bytes.byte()?;
        // Four bits of the column tell whether reader and writer are at the same place.
        if usize::from(head >> 2 & 15) != columns.start >> 3 & 15 {
            return None;
        }
        let (kind, area) = (self.shape.kind, columns.len() * rows.len());
        let (low, steps) = match head & 3 {
            0 => return self.read_plain(bytes, columns, rows, sample..sample + 1),
            1 => (value(bytes, narrowed(kind, head >> 6)?)?, Some(bytes.packed(area)?)),
            2 => (0.0, None),
            _ => (value(bytes, narrowed(kind, head >> 6)?)?, None),
        };
        let (step, most) = (2.0 * self.header.error, *self.highest.get(sample)?);
        let mut steps = steps.map(Vec::into_iter);
        for row in rows {
            for column in columns.clone() {
                let pixel = row * self.shape.width + column;
                if self.is_valid(pixel) {
                    let value = match &mut steps {
                        Some(steps) => (low + f64::from(steps.next()?) * step).min(most),
                        None => low,
                    };
                    self.put(pixel, sample, value);
                }
            }
        }
        Some(())
    }

    /// Codes of the differences from the pixel on the left, or else above, or else the one before.
    fn read_differences(&mut self, bytes: &mut Bytes<'_>) -> Option<()> {
        let code = Code::read(bytes)?;
        let Shape { width, depth, .. } = self.shape;
        let mut words = Words::new(bytes.0);
        for sample in 0..depth {
            let mut before = 0_u8;
            for pixel in 0..self.pixels() {
                if !self.is_valid(pixel) {
                    continue;
                }
                let on_left = pixel % width > 0 && self.is_valid(pixel - 1);
                if !on_left && pixel >= width && self.is_valid(pixel - width) {
                    before = self.out[(pixel - width) * depth + sample];
                }
                before = before.wrapping_add(self.centred(code.next(&mut words)?));
                self.out[pixel * depth + sample] = before;
            }
        }
        Some(())
    }

    /// Codes of the samples themselves.
    fn read_codes(&mut self, bytes: &mut Bytes<'_>) -> Option<()> {
        let code = Code::read(bytes)?;
        let mut words = Words::new(bytes.0);
        for pixel in 0..self.pixels() {
            if self.is_valid(pixel) {
                for sample in 0..self.shape.depth {
                    self.out[pixel * self.shape.depth + sample] =
                        self.centred(code.next(&mut words)?);
                }
            }
        }
        Some(())
    }

    /// Signed samples are coded with 128 added.
    fn centred(&self, coded: u8) -> u8 {
        if self.shape.kind == SampleType::I8 { coded.wrapping_sub(128) } else { coded }
    }
}

#[cfg(test)]
mod tests;
