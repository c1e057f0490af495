//! ESRI GridFloat: heights as little-endian `f32` by row, with a text header and a .prj sidecar.

use std::fmt::Display;
use std::sync::Mutex;

use super::format::{GridFormat, GridWriteRequest};
use super::rows::RowSink;
use super::sidecar::{self, Sidecars, check_north_up, lower_left};
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::metadata::number;
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "GridFloat",
    extensions: &["flt"],
    about: "ESRI .flt of float32 with .hdr and .prj; scale and offset are applied",
    options: &[],
    several_bands: false,
    holds_colours: false,
    holds_types: false,
    names_voids: true,
    bytes_per_sample: 16,
    create: |order| Ok(Box::new(FltSink::new(order)?)),
};

/// A raw grid under construction.
struct FltSink {
    target: AtomicFile,
    info: GridInfo,
    codec: SampleCodec,
    sidecars: Sidecars,
    out: Mutex<AppendWriter>,
}

impl FltSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        if let Some(other) = order.options.sample_type.filter(|t| *t != SampleType::F32) {
            let message = format!("{} supports float32, not {}", FORMAT.name, other.name());
            return Err(Error::usage(message).remedy("omit ‹type›"));
        }
        let info = order.heights(SampleType::F32)?;
        check_north_up(&info.transform, FORMAT.name)?;
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        let mut sidecars = Sidecars::new(order.path, order.options);
        // Readers prefer a header of this name.
        sidecars.remove(&["flt.hdr", "flt.HDR", "FLT.hdr", "FLT.HDR"])?;
        if !info.georeferenced {
            sidecars.remove(&["wld", "WLD"])?;
        }
        sidecars.add("hdr", &header(&info))?;
        sidecars.add_prj(&info.crs)?;
        let (codec, out) = (order.codec(&info), Mutex::new(AppendWriter::of(&target, 0)?));
        Ok(Self { target, info, codec, sidecars, out })
    }
}

/// GridFloat keys for square cells, else the keys of a raw grid with two cell sizes.
fn header(info: &GridInfo) -> String {
    let (width, height) = (info.width, info.height);
    let map = info.transform;
    let place = if !info.georeferenced {
        String::new()
    } else if map.a == -map.e {
        let half = if info.pixel_is_point { 0.0 } else { 0.5 };
        let place = if info.pixel_is_point { "center" } else { "corner" };
        let [x, y] = lower_left(info, half).map(number);
        format!("xll{place} {x}\nyll{place} {y}\ncellsize {}\n", number(map.a))
    } else {
        let [x, y, dx, dy] = [map.x0, map.y0, map.a, -map.e].map(number);
        format!("ulxmap {x}\nulymap {y}\nxdim {dx}\nydim {dy}\n")
    };
    let nodata = info.nodata.map(|value| format!("NODATA_value {}\n", number(value)));
    format!(
        "ncols {width}\nnrows {height}\n{place}{}nbits 32\npixeltype FLOAT\nbyteorder LSBFIRST\n",
        nodata.unwrap_or_default()
    )
}

impl RowSink for FltSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn encode_rows<H: TiledTiffHeight + Display>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        out.resize(rect.len() * SampleType::F32.bytes(), 0);
        let rows = heights.chunks_exact(rect.width as usize);
        let bytes = out.chunks_exact_mut(rect.width as usize * SampleType::F32.bytes());
        for ((row, line), bytes) in (rect.row..).zip(rows).zip(bytes) {
            self.codec.encode(line, bytes).map_err(|misfit| {
                self.codec.refusal(misfit, rect.col, row).in_file(self.target.path())
            })?;
        }
        Ok(())
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        lock(&self.out).write(bytes)
    }

    fn notes(&self) -> Vec<String> {
        sidecar::lost(&self.info)
    }

    fn finish(self) -> Result<u64> {
        let Self { target, sidecars, out, .. } = self;
        unlocked(out).flush()?;
        sidecars.commit()?;
        target.commit()
    }
}
