//! Colour PNG: three or four bands of uint8 as red, green, blue and alpha.

use std::sync::Mutex;

use ::png::{BitDepth, ColorType};

use super::format::{GridSink, GridWriteRequest};
use super::png_picture::PngCanvas;
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::lock;

/// Approximate number of pixels of a block; at least one row.
const BLOCK_PIXELS: u32 = 1 << 16;

/// A PNG under construction.
pub(super) struct PictureSink {
    canvas: PngCanvas,
    info: GridInfo,
    codec: SampleCodec,
    bands: usize,
    /// Bands of the next block that are complete.
    ready: Mutex<Vec<Vec<u8>>>,
}

impl PictureSink {
    pub(super) fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        for key in ["ENCODING", "ALPHA"] {
            order.creation.refuse(key, "for colours, which are not heights")?;
        }
        let bands = order.options.band_count();
        if order.info.sample_type != SampleType::U8 || !(3..=4).contains(&bands) {
            return Err(Error::usage("colour images require three or four bands of uint8"));
        }
        let info = GridInfo { nodata: None, ..order.info.clone() };
        let colours = if bands == 4 { ColorType::Rgba } else { ColorType::Rgb };
        let canvas = PngCanvas::new(order, (colours, BitDepth::Eight), None)?;
        let (codec, ready) = (order.codec(&info), Mutex::default());
        Ok(Self { canvas, info, codec, bands: bands as usize, ready })
    }

    fn encode_bytes<H: TiledTiffHeight>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        out.clear();
        out.resize(heights.len(), 0);
        let encoded = self.codec.encode(heights, out);
        encoded.map_err(|misfit| self.codec.refusal(misfit, rect.col, rect.row))
    }
}

impl GridSink for PictureSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn block(&self) -> (u32, u32) {
        let GridInfo { width, height, .. } = self.info;
        (width, (BLOCK_PIXELS / width).clamp(1, height))
    }

    fn encode(
        &self,
        _band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        match heights {
            HeightSlice::F32(heights) => self.encode_bytes(rect, heights, out),
            HeightSlice::F64(heights) => self.encode_bytes(rect, heights, out),
        }
        .map_err(|e| e.in_file(self.canvas.path()))
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        let mut ready = lock(&self.ready);
        ready.push(bytes.to_vec());
        if ready.len() < self.bands {
            return Ok(());
        }
        let mut pixels = vec![0; bytes.len() * self.bands];
        for (band, own) in ready.iter().enumerate() {
            let places = pixels.iter_mut().skip(band).step_by(self.bands);
            places.zip(own).for_each(|(place, byte)| *place = *byte);
        }
        ready.clear();
        self.canvas.append(&pixels)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        self.canvas.finish()
    }
}
