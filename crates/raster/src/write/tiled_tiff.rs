//! The terrane store as an output format: tiles are written in any order.

use super::creation::Accepts::Words;
use super::creation::CreationOption;
use super::format::{GridFormat, GridSink, GridWriteRequest};
use crate::grid::GridInfo;
use crate::tiled_tiff::{DEFAULT_TILE, HeightSlice, TiledTiffWriter};
use terrane_base::error::Result;
use terrane_base::geom::Rect;

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "store",
    extensions: &["tif", "tiff"],
    about: "uncompressed tiled BigTIFF for fast memory-mapped reading",
    options: &[CreationOption {
        key: "BLOCKSIZE",
        accepts: Words(&["256", "512", "1024"]),
        about: "tile size [512]",
    }],
    several_bands: false,
    holds_colours: false,
    holds_types: true,
    names_voids: true,
    bytes_per_sample: 16,
    create: |order| Ok(Box::new(TiledTiffSink::new(order)?)),
};

/// A store under construction.
struct TiledTiffSink {
    info: GridInfo,
    writer: TiledTiffWriter,
}

impl TiledTiffSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        let info = order.stored()?;
        let side = order.creation.number("BLOCKSIZE").unwrap_or(DEFAULT_TILE);
        let writer = TiledTiffWriter::create(order.path, &info, side, order.options.overwrite)?;
        Ok(Self { info, writer: writer.rounding(order.rounding()) })
    }
}

impl GridSink for TiledTiffSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn block(&self) -> (u32, u32) {
        self.writer.tile()
    }

    fn in_order(&self) -> bool {
        false
    }

    /// Writes the piece at its offset; `out` is a buffer.
    fn encode(
        &self,
        _band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        self.writer.write(rect, heights, out)
    }

    fn append(&self, _bytes: &[u8]) -> Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        self.writer.finish()
    }
}
