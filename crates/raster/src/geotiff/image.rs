//! An image of a TIFF, either the grid or a mask, as rows of stored samples of one band.

use std::sync::Arc;

use crate::cache::{SharedBlocks, too_large_for_cache};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::{RawFile, RowRun};

use super::blocks::{GeoTiffBlockExtent, GeoTiffBlocks};
use super::ifd::GeoTiffDirectory;
use super::layout::GeoTiffLayout;

/// An image that shares the block cache of its grid.
pub(super) struct GeoTiffImage {
    pub(super) file: Arc<RawFile>,
    pub(super) blocks: GeoTiffBlocks,
    /// Index of the image in the cache, which prefixes the keys of its blocks.
    slot: u64,
}

/// Bits of a cache key for the block number, enough for [`terrane_base::limits::MAX_BLOCKS`].
const BLOCK_BITS: u32 = 40;

impl GeoTiffImage {
    /// Band `band` (from 0) of the image described by `directory` and `layout`.
    pub(super) fn new(
        file: &Arc<RawFile>,
        directory: &GeoTiffDirectory<'_>,
        layout: GeoTiffLayout,
        band: u32,
        slot: usize,
    ) -> Result<Self> {
        let blocks = GeoTiffBlocks::read(directory, layout, band, file)?;
        Ok(Self { file: file.clone(), blocks, slot: slot as u64 })
    }

    /// Calls `each(part, row, samples)` for each row of `rect` (inside the image), block by block in any order: row `row`
    /// of `part` in native byte order, or `None` for a sparse block.
    pub(super) fn each_row(
        &self,
        rect: Rect,
        cache: &SharedBlocks,
        mut each: impl FnMut(Rect, u32, Option<&[u8]>),
    ) -> Result<()> {
        let layout = &self.blocks.layout;
        let mut busy = Vec::new();
        for [bx, by] in blocks_touching(layout, rect) {
            let part = layout.block_rect(bx, by).intersect(&rect);
            match self.blocks.place(bx, by, &self.file)? {
                None => (0..part.height).for_each(|row| each(part, row, None)),
                Some(place) if layout.is_read_by_rows() => {
                    self.blocks.read_raw([bx, by], place, part, &self.file, |row, samples| {
                        each(part, row as u32, Some(samples));
                    })?;
                }
                Some(place) => {
                    let block = ImageBlock { at: [bx, by], place, part };
                    if !self.each_decoded(block, cache, false, &mut each)? {
                        busy.push(block);
                    }
                }
            }
        }
        // Threads on neighbouring windows share blocks. Each first decodes those that no other has begun; in the order of
        // the blocks, one would wait for the other all the time.
        for block in busy {
            self.each_decoded(block, cache, true, &mut each)?;
        }
        Ok(())
    }

    /// False if another thread is decoding the block; with `wait`, waits for it.
    fn each_decoded(
        &self,
        ImageBlock { at: [bx, by], place, part }: ImageBlock,
        cache: &SharedBlocks,
        wait: bool,
        each: &mut impl FnMut(Rect, u32, Option<&[u8]>),
    ) -> Result<bool> {
        let bytes = self.blocks.peak_bytes(by, place)?;
        let decoded = cache.get(self.key(bx, by), bytes, wait, |out| {
            self.blocks.decode(bx, by, place, &self.file, out)
        })?;
        let Some(decoded) = decoded else { return Ok(false) };
        let block = self.blocks.layout.block_rect(bx, by);
        let size = self.blocks.layout.sample_type.bytes();
        let pitch = self.blocks.layout.block_width as usize * size;
        let first =
            (part.row - block.row) as usize * pitch + (part.col - block.col) as usize * size;
        let run = RowRun {
            offset: first as u64,
            pitch: pitch as u64,
            bytes: part.width as usize * size,
            rows: part.height as usize,
        };
        decoded.each_row(run, |row, samples| each(part, row as u32, Some(samples)))?;
        Ok(true)
    }

    fn key(&self, bx: u32, by: u32) -> u64 {
        self.slot << BLOCK_BITS | self.blocks.number(bx, by)
    }

    /// Notes that the samples of `rect` will not be read again.
    pub(super) fn release(&self, rect: Rect, cache: &SharedBlocks) {
        let layout = &self.blocks.layout;
        if layout.is_read_by_rows() {
            return;
        }
        for [bx, by] in blocks_touching(layout, rect) {
            let block = layout.block_rect(bx, by);
            let released = block.intersect(&rect).len() as u64;
            cache.release(self.key(bx, by), released, block.len() as u64);
        }
    }
}

/// A block to read a part of.
#[derive(Clone, Copy)]
struct ImageBlock {
    at: [u32; 2],
    place: GeoTiffBlockExtent,
    part: Rect,
}

/// Blocks that overlap `rect` (inside the grid), in row-major order.
pub(super) fn blocks_touching(
    layout: &GeoTiffLayout,
    rect: Rect,
) -> impl Iterator<Item = [u32; 2]> + use<> {
    let (width, height) = (layout.block_width, layout.block_height);
    let columns = rect.col / width..rect.end_col().div_ceil(width);
    let rows = rect.row / height..rect.end_row().div_ceil(height);
    let (columns, rows) = if rect.is_empty() { (0..0, 0..0) } else { (columns, rows) };
    rows.flat_map(move |by| columns.clone().map(move |bx| [bx, by]))
}

/// Checks that a block that is decoded as a whole fits into the cache.
pub(super) fn check_cache(layout: &GeoTiffLayout, cache_bytes: usize) -> Result<()> {
    let bytes = layout.peak_bytes();
    if layout.is_read_by_rows() || bytes <= cache_bytes as u64 {
        return Ok(());
    }
    let message =
        format!("a block takes {bytes} bytes, more than the block cache of {cache_bytes} bytes");
    let otherwise = "rewrite the file in small tiles: gdal_translate -co TILED=YES IN OUT";
    Err(too_large_for_cache(message, bytes).or(otherwise))
}
