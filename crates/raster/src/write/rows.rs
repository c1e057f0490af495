//! Sinks that write whole rows in order without buffering them.

use std::fmt::Display;

use super::format::GridSink;
use crate::grid::GridInfo;
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::sample::TiledTiffHeight;
use terrane_base::error::Result;
use terrane_base::geom::Rect;

/// A sink of whole rows.
pub(super) trait RowSink: Send + Sync {
    /// Approximate number of samples of a block; at least one row.
    const BLOCK_SAMPLES: u32 = 1 << 18;

    fn info(&self) -> &GridInfo;

    /// Encodes the rows of `rect` into `out`, which is empty.
    fn encode_rows<H: TiledTiffHeight + Display>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()>;

    fn append(&self, bytes: &[u8]) -> Result<()>;

    fn notes(&self) -> Vec<String>;

    fn finish(self) -> Result<u64>;
}

impl<S: RowSink> GridSink for S {
    fn info(&self) -> &GridInfo {
        RowSink::info(self)
    }

    fn block(&self) -> (u32, u32) {
        let GridInfo { width, height, .. } = *RowSink::info(self);
        (width, (S::BLOCK_SAMPLES / width).clamp(1, height))
    }

    fn encode(
        &self,
        _band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        out.clear();
        match heights {
            HeightSlice::F32(heights) => self.encode_rows(rect, heights, out),
            HeightSlice::F64(heights) => self.encode_rows(rect, heights, out),
        }
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        RowSink::append(self, bytes)
    }

    fn notes(&self) -> Vec<String> {
        RowSink::notes(self)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        RowSink::finish(*self)
    }
}
