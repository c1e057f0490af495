//! Grid sources and sinks: one file per format, and the registry that names them.
//!
//! Everything reads by window, out of core. Inputs of others are read with `pread`; only stores
//! written by terrane are memory-mapped.

pub mod store;
mod synth;

use std::path::Path;

use crate::error::Result;
use crate::geom::{Affine, Crs, Rect};

/// How samples are stored in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum SampleType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F16,
    F32,
    F64,
}

impl SampleType {
    /// Bytes of one sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Name as GDAL and numpy users know it: "int16", "float32", ...
    pub fn name(self) -> &'static str {
        match self {
            Self::I8 => "int8",
            Self::U8 => "uint8",
            Self::I16 => "int16",
            Self::U16 => "uint16",
            Self::I32 => "int32",
            Self::U32 => "uint32",
            Self::F16 => "float16",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }
}

/// What a grid is, before any sample is read.
#[derive(Clone, Debug, PartialEq)]
pub struct GridInfo {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World position of samples (see [`Affine`]).
    pub transform: Affine,
    /// True when the file said where it lies; false when `transform` is [`Affine::LATTICE`].
    pub georeferenced: bool,
    /// True when the file said PixelIsPoint (the transform already accounts for it).
    pub pixel_is_point: bool,
    /// The coordinate reference system, as far as known.
    pub crs: Crs,
    /// Storage type of the chosen band.
    pub sample_type: SampleType,
    /// Declared nodata value, in stored units (before scale and offset).
    pub nodata: Option<f64>,
    /// Height = stored * scale + offset.
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
    /// Natural block size (width, height) for reading.
    pub block: (u32, u32),
    /// Bands in the file.
    pub bands: u32,
    /// The chosen band, from 1.
    pub band: u32,
    /// Short format name of the registry ("GeoTIFF", "SRTM HGT", ...).
    pub format: &'static str,
    /// Free facts for `terrane info`: (name, value), such as ("compression", "deflate").
    pub details: Vec<(String, String)>,
}

impl GridInfo {
    /// The rectangle of all samples.
    pub fn bounds(&self) -> Rect {
        Rect::new(0, 0, self.width, self.height)
    }

    /// True when every height this grid can hold is exactly an `f32`, so that
    /// [`GridSource::read_f32`] loses nothing.
    pub fn exact_in_f32(&self) -> bool {
        use SampleType::{F16, F32, I8, I16, U8, U16};
        let narrow = matches!(self.sample_type, I8 | U8 | I16 | U16 | F16 | F32);
        narrow && self.scale == 1.0 && self.offset == 0.0
    }
}

/// A grid that hands out windows of heights. Implementations are cheap to share between threads,
/// never hold the whole grid, and keep any cache within the bytes they were opened with.
pub trait GridSource: Send + Sync {
    /// What the grid is.
    fn info(&self) -> &GridInfo;

    /// Reads the heights of `rect` (inside the grid) row by row into `out`
    /// (`rect.len()` values). Voids (nodata, NaN, infinities, sparse blocks) are NaN.
    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()>;

    /// As [`read_f32`](Self::read_f32), in `f64`, exact for every sample type.
    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()>;

    /// A hint that `rect` will not be read again soon: mapped pages or cached blocks may go.
    fn release(&self, _rect: Rect) {}
}

/// How to open a grid.
#[derive(Clone, Debug)]
pub struct OpenOptions {
    /// Band to read, from 1.
    pub band: u32,
    /// Replaces the file's nodata value.
    pub nodata: Option<f64>,
    /// Bytes the decoded-block cache may hold.
    pub cache_bytes: usize,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { band: 1, nodata: None, cache_bytes: 256 << 20 }
    }
}

/// One raster format: an entry of [`FORMATS`].
pub struct RasterFormat {
    /// Short name shown to users, unique.
    pub name: &'static str,
    /// File name endings in lower case, without the leading dot ("tif", "hgt.zip").
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True when the first bytes (up to 64) of a file are this format's.
    pub sniff: fn(&[u8]) -> bool,
    /// Opens a file of this format.
    pub open: fn(&Path, &OpenOptions) -> Result<Box<dyn GridSource>>,
}

/// Placeholder until the reader registry is in place.
pub fn open(input: &str, _options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    Err(crate::Error::unsupported("no raster format is known").in_file(Path::new(input)))
}
