//! Registry of grid formats for reading, and format detection.

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat};
use crate::grid::GridSource;
use crate::{
    asc, dted, geotiff, hgt, in_memory, mosaic, npy, packed, pam, png, raw, sidecars, synth, usgs,
    xyz,
};
use terrane_base::error::{Error, Result};
use terrane_files::format::by_extension;
use terrane_files::{RawFile, is_in_memory, path_of};

/// All formats that can be read. A new one is one file and one line here.
pub const FORMATS: &[RasterFormat] = &[
    geotiff::FORMAT,
    hgt::FORMAT,
    asc::FORMAT,
    raw::FORMAT,
    png::FORMAT,
    dted::FORMAT,
    usgs::FORMAT,
    xyz::FORMAT,
    npy::FORMAT,
    packed::GZIP,
    packed::ZIP,
    mosaic::vrt::FORMAT,
];

/// Number of leading bytes that [`RasterFormat::sniff`] examines.
const HEAD_BYTES: u64 = 64;

/// Opens a grid: a file, identified by its content or else by its extension, or a synthetic terrain
/// (`synth:rough,size=4097,seed=7`). The prefix `terrarium:` or `terrain-rgb:` declares the height encoding
/// of a PNG.
///
/// # Errors
/// A missing file, a folder, an unknown format, or errors of the format.
pub fn open(input: &str, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    if is_in_memory(input) {
        return in_memory::open(input, options);
    }
    if input.starts_with(synth::PREFIX) {
        return synth::open(input, options);
    }
    if let Some((packing, path)) = png::RgbHeightEncoding::stated(input) {
        let path = &*path_of(path);
        return open_as(path, &png::FORMAT, options, |o| png::open(path, Some(packing), o));
    }
    open_path(&path_of(input), options)
}

/// The file name in `input`, without prefixes such as `terrarium:`.
pub fn file_name(input: &str) -> &str {
    png::RgbHeightEncoding::stated(input).map_or(input, |(_, path)| path)
}

/// Opens a file of any format.
pub(crate) fn open_path(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let head = head_of(path)?;
    let format = format_of(path, &head).ok_or_else(|| unknown_format(path))?;
    open_as(path, format, options, |options| (format.open)(path, options))
}

/// Opens a file of `format` by `open`, with its sidecars.
fn open_as(
    path: &Path,
    format: &RasterFormat,
    options: &GridOpenOptions,
    open: impl Fn(&GridOpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    refuse_mask(path, format)?;
    pam::open(path, format, options, open)
}

/// Rejects mask sidecars except for GeoTIFF, because a mask may void any sample.
fn refuse_mask(path: &Path, format: &RasterFormat) -> Result<()> {
    match sidecars::mask(path) {
        Some(mask) if format.name != geotiff::FORMAT.name => {
            let message = format!("mask sidecar is not supported for {}", format.name);
            Err(Error::unsupported(message).in_file(&mask).remedy(
                "convert both to a GeoTIFF: gdal_translate IN OUT.tif, or move the mask away",
            ))
        }
        _ => Ok(()),
    }
}

/// The format of a file: by its first bytes, else by its name. A raw header is recognised by name, because it
/// looks like an ESRI ASCII grid.
pub(crate) fn format_of(path: &Path, head: &[u8]) -> Option<&'static RasterFormat> {
    let is_header = raw::is_header_name(path);
    let by_content = FORMATS.iter().find(|format| !is_header && (format.sniff)(head));
    by_content
        .or_else(|| by_extension(FORMATS, path))
        .or_else(|| has_header(path).then_some(&raw::FORMAT))
}

/// True if `path` has an ESRI or ENVI header sidecar and is therefore a raw grid, unless its extension
/// belongs to another format.
pub fn has_header(path: &Path) -> bool {
    raw::header_beside(path).is_some()
}

/// The first bytes of a regular file.
pub(crate) fn head_of(path: &Path) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(Error::usage("is not a file").in_file(path));
    }
    RawFile::open(path)?.head(HEAD_BYTES)
}

fn unknown_format(path: &Path) -> Error {
    let known = FORMATS.iter().map(|f| format!("{} (.{})", f.name, f.extensions.join(", .")));
    let known: Vec<String> = known.collect();
    Error::bad_input("is not a raster file of a known format")
        .in_file(path)
        .remedy(format!("terrane reads {}", known.join(", ")))
}
