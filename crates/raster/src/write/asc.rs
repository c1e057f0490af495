//! ESRI ASCII grids: heights as text with the shortest round-trip representation.

use std::fmt::{Display, Write};
use std::sync::Mutex;

use super::format::{GridFormat, GridWriteRequest};
use super::rows::RowSink;
use super::sidecar::{self, Sidecars, check_north_up, lower_left};
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::metadata::number;
use crate::tiled_tiff::out_of_range::SampleMisfit;
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "AAIGrid",
    extensions: &["asc"],
    about: "ESRI ASCII text with .prj; scale and offset are applied",
    options: &[],
    several_bands: false,
    holds_colours: false,
    holds_types: false,
    names_voids: true,
    bytes_per_sample: 48,
    create: |order| Ok(Box::new(AscSink::new(order)?)),
};

/// A text grid under construction.
struct AscSink {
    target: AtomicFile,
    info: GridInfo,
    nodata: f64,
    nodata_text: String,
    /// Whether readers parse heights in single precision.
    is_single: bool,
    /// Codec of the requested type, if any.
    codec: Option<SampleCodec>,
    sidecars: Sidecars,
    text: Mutex<AppendWriter>,
}

impl AscSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        check_north_up(&order.info.transform, FORMAT.name)?;
        let wide = order.heights(SampleType::F64)?;
        let nodata = wide.nodata.unwrap_or_default();
        let sample_type = order.options.sample_type.unwrap_or(order.info.sample_type);
        let info = GridInfo { sample_type, ..wide };
        let codec = SampleCodec::new(&GridInfo { nodata: None, ..info.clone() });
        let codec = order.options.sample_type.map(|_| codec.rounding(order.rounding()));
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        let mut sidecars = Sidecars::new(order.path, order.options);
        sidecars.add_prj(&info.crs)?;
        let mut text = AppendWriter::of(&target, 0)?;
        text.write(header(&info, nodata).as_bytes())?;
        let (text, nodata_text) = (Mutex::new(text), number(nodata));
        let is_single = matches!(sample_type, SampleType::F16 | SampleType::F32);
        Ok(Self { target, info, nodata, nodata_text, is_single, codec, sidecars, text })
    }

    /// Appends a sample and a space.
    fn write_sample<H: TiledTiffHeight + Display>(
        &self,
        height: H,
        out: &mut String,
    ) -> std::result::Result<(), SampleMisfit> {
        let first = out.len();
        // Writing to a string does not fail.
        let _ = match &self.codec {
            _ if height.is_void() => write!(out, "{}", self.nodata_text),
            Some(codec) => write!(out, "{}", codec.fit(height.to_f64())?),
            None => write!(out, "{height}"),
        };
        // Checks the written value, which may be rounded, as readers parse it.
        let (height, nodata) = (height.to_f64(), self.nodata);
        let is_alike = self.is_single && height as f32 == nodata as f32;
        let is_nodata = is_alike || height == nodata || out[first..] == self.nodata_text;
        if is_nodata && !height.is_nan() {
            return Err(SampleMisfit::Nodata(0, height));
        }
        out.push(' ');
        Ok(())
    }

    fn refuse(&self, misfit: SampleMisfit, col: u32, row: u32) -> terrane_base::error::Error {
        SampleCodec::new(&self.info).refusal(misfit, col, row).in_file(self.target.path())
    }
}

fn header(info: &GridInfo, nodata: f64) -> String {
    let half = if info.pixel_is_point { 0.0 } else { 0.5 };
    let place = if info.pixel_is_point { "center" } else { "corner" };
    let [x, y] = lower_left(info, half);
    let (dx, dy) = (info.transform.a, -info.transform.e);
    let cell = match dx == dy {
        true => format!("cellsize {}\n", number(dx)),
        false => format!("dx {}\ndy {}\n", number(dx), number(dy)),
    };
    let (width, height) = (info.width, info.height);
    let (x, y, nodata) = (number(x), number(y), number(nodata));
    format!(
        "ncols {width}\nnrows {height}\nxll{place} {x}\nyll{place} {y}\n{cell}NODATA_value {nodata}\n"
    )
}

impl RowSink for AscSink {
    const BLOCK_SAMPLES: u32 = 1 << 17;

    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn encode_rows<H: TiledTiffHeight + Display>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        let mut text = String::new();
        for (row, line) in (rect.row..).zip(heights.chunks_exact(rect.width as usize)) {
            for (col, height) in (rect.col..).zip(line) {
                self.write_sample(*height, &mut text)
                    .map_err(|misfit| self.refuse(misfit, col, row))?;
            }
            text.pop();
            text.push('\n');
        }
        *out = text.into_bytes();
        Ok(())
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        lock(&self.text).write(bytes)
    }

    fn notes(&self) -> Vec<String> {
        sidecar::lost(&self.info)
    }

    fn finish(self) -> Result<u64> {
        let Self { target, sidecars, text, .. } = self;
        unlocked(text).flush()?;
        sidecars.commit()?;
        target.commit()
    }
}
