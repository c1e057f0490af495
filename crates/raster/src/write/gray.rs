//! Grayscale PNG: integer heights of 8 or 16 bits, with a world file and a .prj sidecar. The nodata value is
//! transparent.

use std::fmt::Display;

use ::png::{BitDepth, ColorType};

use super::format::GridWriteRequest;
use super::png_picture::PngCanvas;
use super::rows::RowSink;
use super::sidecar;
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight, stored_nodata};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// Whether to write grayscale: by ENCODING, or else by the requested type.
///
/// # Errors
/// Usage: a type that grayscale does not support.
pub(super) fn is_requested(order: &GridWriteRequest<'_>) -> Result<bool> {
    let asked = order.options.sample_type;
    let is_held = matches!(asked, Some(SampleType::U8 | SampleType::U16));
    match (order.creation.word("ENCODING"), asked) {
        (Some("GRAY"), Some(other)) if !is_held => {
            let message = format!("ENCODING=GRAY supports uint8 and uint16, not {}", other.name());
            Err(Error::usage(message).remedy("choose ‹type› uint8 or uint16"))
        }
        (Some(word), _) => Ok(word == "GRAY"),
        (None, _) => Ok(is_held),
    }
}

/// A PNG under construction.
pub(super) struct GraySink {
    canvas: PngCanvas,
    info: GridInfo,
    codec: SampleCodec,
}

impl GraySink {
    pub(super) fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        order.creation.refuse("ALPHA", "for grayscale, where one value marks voids")?;
        let wide = order.info.sample_type != SampleType::U8;
        let own = if wide { SampleType::U16 } else { SampleType::U8 };
        let sample_type = order.options.sample_type.unwrap_or(own);
        // A nodata value that grayscale cannot store matches no sample.
        let heights = order.heights(sample_type)?;
        let nodata = heights.nodata.and_then(|value| stored_nodata(sample_type, value));
        let info = GridInfo { nodata, ..heights };
        let depth = match sample_type {
            SampleType::U8 => BitDepth::Eight,
            _ => BitDepth::Sixteen,
        };
        // An integer within the range of the type.
        let transparent = nodata.map(|value| value as u16);
        let canvas = PngCanvas::new(order, (ColorType::Grayscale, depth), transparent)?;
        Ok(Self { canvas, codec: order.codec(&info), info })
    }
}

impl RowSink for GraySink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn encode_rows<H: TiledTiffHeight + Display>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        let size = self.info.sample_type.bytes();
        out.resize(rect.len() * size, 0);
        let rows = heights.chunks_exact(rect.width as usize);
        let bytes = out.chunks_exact_mut(rect.width as usize * size);
        for ((row, line), bytes) in (rect.row..).zip(rows).zip(bytes) {
            self.codec.encode(line, bytes).map_err(|misfit| {
                self.codec.refusal(misfit, rect.col, row).in_file(self.canvas.path())
            })?;
        }
        // The codec is little-endian, PNG big-endian.
        out.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        Ok(())
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        self.canvas.append(bytes)
    }

    fn notes(&self) -> Vec<String> {
        sidecar::lost(&self.info)
    }

    fn finish(self) -> Result<u64> {
        self.canvas.finish()
    }
}
