//! Blocks: their offsets in the file, and decoding to samples of one band in native byte order.

use crate::cache::DecodeBytes;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::{RawFile, RowRun, to_usize};

use super::codec::{
    BlockDecoders, DecompressionFault, GeoTiffCompression, GeoTiffScratch, with_scratch,
};
use super::ifd::{GeoTiffDirectory, IntArray, about};
use super::layout::GeoTiffLayout;
use super::lerc;
use super::predictor::{self, Predictor};
use super::tags;

/// Maximum number of blocks whose offsets are held in memory (16 bytes each); those of larger files are read
/// on demand.
const MAX_HELD: u64 = 1 << 18;

/// Size of the file header, which blocks must not overlap.
const HEADER_BYTES: u64 = 8;

/// Maximum excess of a deflate or zstd stream over a full block, in bytes.
const PADDING: usize = 64 << 10;

/// Maximum compressed size of a block of `plain` bytes that is worth reading.
fn max_packed(plain: u64) -> u64 {
    2 * plain + 4096
}

/// Extent of a block in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GeoTiffBlockExtent {
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

/// Offsets or byte counts of all blocks.
#[derive(Debug)]
enum GeoTiffBlockTable {
    Held(Vec<u64>),
    OnDisk(IntArray),
}

impl GeoTiffBlockTable {
    fn of(values: IntArray, file: &RawFile) -> Result<Self> {
        if values.count > MAX_HELD {
            return Ok(Self::OnDisk(values));
        }
        values.all(file).map(Self::Held)
    }

    fn get(&self, file: &RawFile, i: u64) -> Result<u64> {
        match self {
            Self::Held(values) => Ok(values.get(i as usize).copied().unwrap_or(0)),
            Self::OnDisk(values) => values.get(file, i),
        }
    }
}

/// The blocks of the selected band.
#[derive(Debug)]
pub(super) struct GeoTiffBlocks {
    pub(super) layout: GeoTiffLayout,
    offsets: GeoTiffBlockTable,
    /// `None` if the file lacks byte counts, or has too few.
    byte_counts: Option<GeoTiffBlockTable>,
    /// From 0.
    band: u32,
}

impl GeoTiffBlocks {
    /// Reads the block tables of `directory` and checks every block of the band against the file.
    pub(super) fn read(
        directory: &GeoTiffDirectory<'_>,
        layout: GeoTiffLayout,
        band: u32,
        file: &RawFile,
    ) -> Result<Self> {
        let blocks = layout.planes() * layout.blocks_across() * layout.blocks_down();
        let (offsets_tag, counts_tag) = array_tags(directory, layout.tiled);
        let Some(offsets) = directory.int_array(offsets_tag)? else {
            return Err(about(offsets_tag, "is missing"));
        };
        if offsets.count < blocks {
            let message = format!("has {} values, expected {blocks}", offsets.count);
            return Err(about(offsets_tag, message));
        }
        let counts = directory.int_array(counts_tag)?.filter(|counts| counts.count >= blocks);
        let byte_counts = counts.map(|counts| GeoTiffBlockTable::of(counts, file)).transpose()?;
        let blocks =
            Self { layout, offsets: GeoTiffBlockTable::of(offsets, file)?, byte_counts, band };
        blocks.check_places(file)?;
        Ok(blocks)
    }

    /// Detects truncated files early, if the tables are in memory.
    fn check_places(&self, file: &RawFile) -> Result<()> {
        if matches!(self.offsets, GeoTiffBlockTable::OnDisk(_)) {
            return Ok(());
        }
        for by in 0..self.layout.blocks_down() as u32 {
            for bx in 0..self.layout.blocks_across() as u32 {
                self.place(bx, by, file)?;
            }
        }
        Ok(())
    }

    /// Index of block (`bx`, `by`) of the selected band in the tables.
    pub(super) fn number(&self, bx: u32, by: u32) -> u64 {
        let plane = if self.layout.separate { u64::from(self.band) } else { 0 };
        self.layout.block_index(plane, bx, by)
    }

    /// Extent of block (`bx`, `by`), inside the file; `None` if it is sparse.
    pub(super) fn place(
        &self,
        bx: u32,
        by: u32,
        file: &RawFile,
    ) -> Result<Option<GeoTiffBlockExtent>> {
        let number = self.number(bx, by);
        self.find(number, by, file).map_err(|e| self.named(e, bx, by).in_file(file.path()))
    }

    fn find(&self, number: u64, by: u32, file: &RawFile) -> Result<Option<GeoTiffBlockExtent>> {
        let plain = self.layout.block_bytes(self.layout.stored_rows(by));
        let needed = self.layout.block_bytes(self.layout.block_rect(0, by).height);
        let offset = self.offsets.get(file, number)?;
        let raw = self.layout.compression == GeoTiffCompression::None;
        let bytes = match &self.byte_counts {
            Some(counts) => counts.get(file, number)?,
            None if raw => needed,
            // Without counts no one tells where a block ends: as much is read as it may take.
            None => max_packed(plain).min(file.size().saturating_sub(offset)),
        };
        // GDAL keeps the offset when it clears the byte count.
        if bytes == 0 || (offset == 0 && self.byte_counts.is_none()) {
            return Ok(None);
        }
        if offset < HEADER_BYTES {
            let message = format!("{bytes} bytes at offset {offset} overlap the file header");
            return Err(Error::bad_input(message).remedy("copy the file again"));
        }
        if raw && bytes < needed {
            return Err(Error::bad_input(format!("has {bytes} bytes, expected {needed}")));
        }
        let bytes = if raw { needed } else { bytes };
        file.check_range(offset, bytes)?;
        // A damaged count asks for no more than a block may take packed.
        Ok(Some(GeoTiffBlockExtent { offset, bytes: bytes.min(max_packed(plain)) }))
    }

    fn named(&self, error: Error, bx: u32, by: u32) -> Error {
        let Rect { col, row, .. } = self.layout.block_rect(bx, by);
        let number = self.number(bx, by);
        error.at(format_args!("block {number} (from column {col}, row {row})"))
    }

    /// Size in bytes of a decoded block in row `by` of blocks, and of what it is decoded from.
    pub(super) fn peak_bytes(&self, by: u32, place: GeoTiffBlockExtent) -> Result<DecodeBytes> {
        let layout = &self.layout;
        let rows = layout.stored_rows(by);
        let samples = u64::from(layout.block_width) * u64::from(rows);
        let block = samples.saturating_mul(layout.sample_type.bytes() as u64);
        let plain = if layout.needs_scratch() { layout.block_bytes(rows) } else { 0 };
        let beside = place.bytes.saturating_add(plain);
        Ok(DecodeBytes { block: to_usize("block", block)?, beside: to_usize("block", beside)? })
    }

    /// Decodes block (`bx`, `by`) at `place` into `out`, of [`peak_bytes`](Self::peak_bytes) and with any content:
    /// `stored_rows` rows of `block_width` samples of the selected band, in native byte order. Rows below the image
    /// may keep their content.
    pub(super) fn decode(
        &self,
        bx: u32,
        by: u32,
        place: GeoTiffBlockExtent,
        file: &RawFile,
        out: &mut [u8],
    ) -> Result<()> {
        with_scratch(|scratch| self.decode_with(scratch, by, place, file, out))
            .map_err(|e| self.named(e, bx, by).in_file(file.path()))
    }

    fn decode_with(
        &self,
        scratch: &mut GeoTiffScratch,
        by: u32,
        place: GeoTiffBlockExtent,
        file: &RawFile,
        out: &mut [u8],
    ) -> Result<()> {
        let layout = &self.layout;
        let packed = grown(&mut scratch.packed, to_usize("block", place.bytes)?);
        file.read_at(place.offset, packed)?;
        let plain = to_usize("block", layout.block_bytes(layout.stored_rows(by)))?;
        if layout.one_bit {
            let bits = grown(&mut scratch.plain, plain);
            self.unpack(&mut scratch.decoders, packed, bits, by)?;
            self.take_bits(bits, out);
        // Without a copy.
        } else if !layout.needs_scratch() {
            self.unpack(&mut scratch.decoders, packed, out, by)?;
            self.undo_in_place(out);
        } else {
            let sorted = grown(&mut scratch.plain, plain);
            self.unpack(&mut scratch.decoders, packed, sorted, by)?;
            self.undo_into(sorted, out);
        }
        Ok(())
    }

    /// Decompresses `packed` into `out`; rows of a tile below the image may be missing.
    fn unpack(
        &self,
        decoders: &mut BlockDecoders,
        packed: &[u8],
        out: &mut [u8],
        by: u32,
    ) -> Result<()> {
        if let GeoTiffCompression::Lerc(packing) = self.layout.compression {
            let shape = self.lerc_shape(by);
            return decoders.lerc(packing, packed, shape, out).map_err(|fault| match fault {
                DecompressionFault::Corrupt(message) => Error::bad_input(message),
                DecompressionFault::TooLong => {
                    Error::bad_input("LERC data exceed the size of the samples")
                }
            });
        }
        let needed = self.layout.block_bytes(self.layout.block_rect(0, by).height);
        match decoders.run(self.layout.compression, packed, out) {
            // Some writers end the lowest blocks with the picture, not with the block.
            Ok(bytes) if bytes as u64 >= needed => Ok(()),
            Ok(bytes) => {
                Err(Error::bad_input(format!("decodes to {bytes} bytes, expected {needed}")))
            }
            Err(DecompressionFault::Corrupt(message)) => Err(Error::bad_input(message)),
            Err(DecompressionFault::TooLong) => self.unpack_padded(decoders, packed, out),
        }
    }

    fn lerc_shape(&self, by: u32) -> lerc::LercBlockShape {
        let layout = &self.layout;
        lerc::LercBlockShape {
            kind: layout.sample_type,
            width: layout.block_width as usize,
            height: layout.stored_rows(by) as usize,
            depth: layout.stride(),
        }
    }

    /// Some writers pad the last strip to its full height, or blocks by a few bytes.
    fn unpack_padded(
        &self,
        decoders: &mut BlockDecoders,
        packed: &[u8],
        out: &mut [u8],
    ) -> Result<()> {
        let full = to_usize("block", self.layout.block_bytes(self.layout.block_height))?;
        let mut room = vec![0; full + PADDING];
        match decoders.run(self.layout.compression, packed, &mut room) {
            Ok(bytes) if bytes >= out.len() => {
                out.copy_from_slice(&room[..out.len()]);
                Ok(())
            }
            _ => Err(Error::bad_input(format!("decodes to more than the {full} bytes expected"))),
        }
    }

    /// Extracts the selected band from rows of bits, most significant bit first: one byte, 0 or 1, per bit.
    fn take_bits(&self, bits: &[u8], out: &mut [u8]) {
        let (stride, band) = (self.layout.stride(), self.band_in_pixel());
        let rows = bits.chunks_exact(self.layout.row_bytes() as usize);
        for (bits, out) in rows.zip(out.chunks_exact_mut(self.layout.block_width as usize)) {
            let places = (band..).step_by(stride);
            out.iter_mut().zip(places).for_each(|(o, i)| *o = bits[i / 8] >> (7 - i % 8) & 1);
        }
    }

    /// Undoes byte order and horizontal predictor of a block of one band.
    fn undo_in_place(&self, samples: &mut [u8]) {
        let layout = &self.layout;
        let size = layout.sample_type.bytes();
        predictor::to_native(samples, size, layout.order);
        if layout.effective_predictor() == Predictor::Horizontal {
            let row = layout.block_width as usize * size;
            samples.chunks_exact_mut(row).for_each(|r| predictor::undo_horizontal(r, size, 1));
        }
    }

    /// Undoes the predictor of `plain` (overwriting it) and extracts the selected band.
    fn undo_into(&self, plain: &mut [u8], out: &mut [u8]) {
        let layout = &self.layout;
        let (size, stride) = (layout.sample_type.bytes(), layout.stride());
        let band = self.band_in_pixel();
        let predictor = layout.effective_predictor();
        if predictor != Predictor::Float {
            predictor::to_native(plain, size, layout.order);
        }
        let row = layout.block_width as usize * size;
        for (plain, out) in plain.chunks_exact_mut(row * stride).zip(out.chunks_exact_mut(row)) {
            match predictor {
                Predictor::Float => predictor::undo_float(plain, out, size, stride, band),
                Predictor::Horizontal => {
                    predictor::undo_horizontal(plain, size, stride);
                    predictor::gather_band(plain, out, size, stride, band);
                }
                Predictor::None => predictor::gather_band(plain, out, size, stride, band),
            }
        }
    }

    /// Index of the selected band among the samples of a pixel.
    fn band_in_pixel(&self) -> usize {
        if self.layout.separate { 0 } else { self.band as usize }
    }

    /// Reads the samples of `part` (inside the uncompressed block (`bx`, `by`) at `place`) directly from the
    /// file, row by row; `each(row, samples)` gets them in native byte order, rows counted from the first of
    /// `part`.
    pub(super) fn read_raw(
        &self,
        [bx, by]: [u32; 2],
        place: GeoTiffBlockExtent,
        part: Rect,
        file: &RawFile,
        mut each: impl FnMut(usize, &[u8]),
    ) -> Result<()> {
        let layout = &self.layout;
        let (size, stride) = (layout.sample_type.bytes(), layout.stride());
        let block = layout.block_rect(bx, by);
        let pixel = size * stride;
        let first_col = u64::from(part.col - block.col) * pixel as u64;
        let first_row = u64::from(part.row - block.row) * layout.row_bytes();
        let run = RowRun {
            offset: place.offset + first_row + first_col,
            pitch: layout.row_bytes(),
            bytes: part.width as usize * pixel,
            rows: part.height as usize,
        };
        let band = self.band_in_pixel();
        with_scratch(|GeoTiffScratch { packed, plain, .. }| {
            let chosen = grown(plain, part.width as usize * size);
            file.each_row(run, packed, |row, bytes| {
                predictor::to_native(bytes, size, layout.order);
                if stride == 1 {
                    each(row, bytes);
                } else {
                    predictor::gather_band(bytes, chosen, size, stride, band);
                    each(row, chosen);
                }
            })
        })
        .map_err(|e| self.named(e, bx, by))
    }
}

/// Tags of offsets and byte counts. Some writers swap those of strips and tiles.
fn array_tags(directory: &GeoTiffDirectory<'_>, tiled: bool) -> (u16, u16) {
    let tiles = (tags::TILE_OFFSETS, tags::TILE_BYTE_COUNTS);
    let strips = (tags::STRIP_OFFSETS, tags::STRIP_BYTE_COUNTS);
    let (own, other) = if tiled { (tiles, strips) } else { (strips, tiles) };
    let [offsets, counts] = [(own.0, other.0), (own.1, other.1)]
        .map(|(own, other)| if directory.has(own) || !directory.has(other) { own } else { other });
    (offsets, counts)
}

/// The first `bytes` bytes of `buffer`, which grows if necessary.
fn grown(buffer: &mut Vec<u8>, bytes: usize) -> &mut [u8] {
    if buffer.len() < bytes {
        buffer.resize(bytes, 0);
    }
    &mut buffer[..bytes]
}
