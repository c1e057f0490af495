//! One image of a TIFF, the grid or a mask of it, as rows of stored samples of one band.

use std::sync::Arc;

use crate::cache::{BlockCache, too_large_for_cache};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::RawFile;

use super::blocks::{GeoTiffBlockExtent, GeoTiffBlocks};
use super::ifd::GeoTiffDirectory;
use super::layout::GeoTiffLayout;

/// An image that shares its cache with others of the same grid.
pub(super) struct GeoTiffImage {
    pub(super) file: Arc<RawFile>,
    pub(super) blocks: GeoTiffBlocks,
    /// Which of the images of the cache this is; its blocks' keys begin with it.
    slot: u64,
}

/// Bits of a cache key that number a block: far more than [`terrane_base::limits::MAX_BLOCKS`].
const BLOCK_BITS: u32 = 40;

impl GeoTiffImage {
    /// The band `band` (from 0) of the image that `directory` and `layout` describe.
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

    /// Hands each row of `rect` (inside the image), block by block, to `each(part, row, samples)`:
    /// row `row` of `part`, in native order, or `None` for a block that was never written.
    pub(super) fn each_row(
        &self,
        rect: Rect,
        cache: &BlockCache,
        mut each: impl FnMut(Rect, u32, Option<&[u8]>),
    ) -> Result<()> {
        let layout = &self.blocks.layout;
        for (bx, by) in blocks_touching(layout, rect) {
            let part = layout.block_rect(bx, by).intersect(&rect);
            match self.blocks.place(bx, by, &self.file)? {
                None => (0..part.height).for_each(|row| each(part, row, None)),
                Some(place) if layout.is_read_by_rows() => {
                    let each = |row, samples: &[u8]| each(part, row as u32, Some(samples));
                    self.blocks.read_raw((bx, by), place, part, &self.file, each)?;
                }
                Some(place) => self.each_decoded((bx, by), place, part, cache, &mut each)?,
            }
        }
        Ok(())
    }

    fn each_decoded(
        &self,
        (bx, by): (u32, u32),
        place: GeoTiffBlockExtent,
        part: Rect,
        cache: &BlockCache,
        each: &mut impl FnMut(Rect, u32, Option<&[u8]>),
    ) -> Result<()> {
        let decode = || self.blocks.decode(bx, by, place, &self.file);
        let samples = cache.get(self.key(bx, by), decode)?;
        let block = self.blocks.layout.block_rect(bx, by);
        let size = self.blocks.layout.sample_type.bytes();
        let pitch = self.blocks.layout.block_width as usize * size;
        let first = (part.col - block.col) as usize * size;
        for row in 0..part.height {
            let start = (part.row - block.row + row) as usize * pitch + first;
            each(part, row, Some(&samples[start..][..part.width as usize * size]));
        }
        Ok(())
    }

    fn key(&self, bx: u32, by: u32) -> u64 {
        self.slot << BLOCK_BITS | self.blocks.number(bx, by)
    }

    /// Forgets the cached blocks that lie wholly inside `rect`.
    pub(super) fn forget(&self, rect: Rect, cache: &BlockCache) {
        let layout = &self.blocks.layout;
        for (bx, by) in blocks_touching(layout, rect) {
            let block = layout.block_rect(bx, by);
            if block.intersect(&rect) == block {
                cache.forget(self.key(bx, by));
            }
        }
    }
}

/// Blocks with samples in `rect` (inside the grid), row by row.
fn blocks_touching(layout: &GeoTiffLayout, rect: Rect) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (layout.block_width, layout.block_height);
    let columns = rect.col / width..rect.end_col().div_ceil(width);
    let rows = rect.row / height..rect.end_row().div_ceil(height);
    let (columns, rows) = if rect.is_empty() { (0..0, 0..0) } else { (columns, rows) };
    rows.flat_map(move |by| columns.clone().map(move |bx| (bx, by)))
}

/// A block that is decoded whole has to fit.
pub(super) fn check_cache(layout: &GeoTiffLayout, cache_bytes: usize) -> Result<()> {
    let bytes = layout.decoded_bytes();
    if layout.is_read_by_rows() || bytes <= cache_bytes as u64 {
        return Ok(());
    }
    let message =
        format!("decoded block of {bytes} bytes exceeds the block cache of {cache_bytes} bytes");
    let otherwise = "rewrite the file in tiles: gdal_translate -co TILED=YES IN OUT";
    Err(too_large_for_cache(message, bytes).or(otherwise))
}
