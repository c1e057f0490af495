//! Shared by the raster tests: where the real files are, and how to read a whole grid.
#![allow(dead_code)] // each test binary uses its part

pub(crate) mod attempt;
pub(crate) mod formats;
pub(crate) mod hostile;
pub(crate) mod tiff_builder;

use std::path::Path;

use terrane::Result;
use terrane_base::geom::Rect;
use terrane_raster::{GridOpenOptions, GridSource, open};

/// Opens `path` with default options and the given band.
pub(crate) fn open_band(path: &Path, band: u32) -> Result<Box<dyn GridSource>> {
    open(path.to_str().unwrap(), &GridOpenOptions { band, ..GridOpenOptions::default() })
}

/// All heights, in f64.
pub(crate) fn read_all(source: &dyn GridSource) -> Result<Vec<f64>> {
    let bounds = source.info().bounds();
    let mut out = vec![0.0; bounds.len()];
    source.read_f64(bounds, &mut out)?;
    Ok(out)
}

/// All heights in f32, read in windows of at most `side` samples a side.
pub(crate) fn read_in_windows(source: &dyn GridSource, side: u32) -> Result<Vec<f32>> {
    let bounds = source.info().bounds();
    let mut all = vec![0.0; bounds.len()];
    for row in (0..bounds.height).step_by(side as usize) {
        for col in (0..bounds.width).step_by(side as usize) {
            let rect = Rect::new(col, row, side, side).intersect(&bounds);
            let mut out = vec![0.0; rect.len()];
            source.read_f32(rect, &mut out)?;
            for (i, line) in out.chunks_exact(rect.width as usize).enumerate() {
                let start = (row as usize + i) * bounds.width as usize + col as usize;
                all[start..start + line.len()].copy_from_slice(line);
            }
        }
    }
    Ok(all)
}

/// Equal heights, or both void.
pub(crate) fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// CRC-32 of heights as little-endian f64, every void as the same NaN.
pub(crate) fn crc(heights: &[f64]) -> String {
    let mut crc = libdeflater::Crc::new();
    for height in heights {
        let bits = if height.is_nan() { 0x7ff8_0000_0000_0000 } else { height.to_bits() };
        crc.update(&bits.to_le_bytes());
    }
    format!("{:08x}", crc.sum())
}

/// Writes `bytes` to a new file. Rewriting an old one makes some file systems flush it each time.
pub(crate) fn write_anew(path: &Path, bytes: &[u8]) {
    let _ = std::fs::remove_file(path);
    std::fs::write(path, bytes).unwrap();
}
