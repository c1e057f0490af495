//! Grid sources: metadata, georeference, and reading of heights.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};

/// Forwards the hints of [`GridSource`] to an inner grid.
macro_rules! hints_go_to {
    ($inner:ident) => {
        fn release(&self, rect: terrane_base::geom::Rect) {
            self.$inner.release(rect);
        }

        fn copied(&self, rect: terrane_base::geom::Rect) {
            self.$inner.copied(rect);
        }

        fn advise_read(&self, rect: terrane_base::geom::Rect) {
            self.$inner.advise_read(rect);
        }
    };
}

/// Implements [`GridSource`] for types with an `info` field and a generic `read` for both float widths.
macro_rules! reads_alike {
    () => {
        fn info(&self) -> &$crate::GridInfo {
            &self.info
        }

        fn read_f32(
            &self,
            rect: terrane_base::geom::Rect,
            out: &mut [f32],
        ) -> terrane_base::error::Result<()> {
            self.read(rect, out)
        }

        fn read_f64(
            &self,
            rect: terrane_base::geom::Rect,
            out: &mut [f64],
        ) -> terrane_base::error::Result<()> {
            self.read(rect, out)
        }
    };
}

/// Storage type of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
    /// True for floating-point numbers.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// All types, the narrowest first.
    pub const ALL: [Self; 9] = [
        Self::I8,
        Self::U8,
        Self::I16,
        Self::U16,
        Self::F16,
        Self::I32,
        Self::U32,
        Self::F32,
        Self::F64,
    ];

    /// The type called `name`, in any case ("Int16"); "byte" is `uint8`, as in GDAL.
    pub fn by_name(name: &str) -> Option<Self> {
        let name = if name.eq_ignore_ascii_case("byte") { "uint8" } else { name };
        Self::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(name))
    }

    /// Size of a sample in bytes.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Name as in GDAL and NumPy: "int16", "float32", ...
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

/// Metadata of a grid, known before samples are read.
#[derive(Clone, Debug, PartialEq)]
pub struct GridInfo {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World position of samples (see [`Affine`]).
    pub transform: Affine,
    /// True if the file has a georeference; false if `transform` is [`Affine::LATTICE`].
    pub georeferenced: bool,
    /// True for PixelIsPoint (already applied to the transform).
    pub pixel_is_point: bool,
    /// The CRS, as far as known.
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
    /// Number of bands in the file.
    pub bands: u32,
    /// The chosen band, from 1.
    pub band: u32,
    /// Short format name of the registry ("GeoTIFF", "SRTM HGT", ...).
    pub format: &'static str,
    /// Further metadata for `terrane info`: (name, value), such as ("compression", "deflate").
    pub details: Vec<(String, String)>,
}

impl GridInfo {
    /// One band of `width` x `height` samples without georeference, CRS or nodata, read row by row.
    pub fn plain(format: &'static str, width: u32, height: u32, sample_type: SampleType) -> Self {
        Self {
            width,
            height,
            transform: Affine::LATTICE,
            georeferenced: false,
            pixel_is_point: false,
            crs: Crs::default(),
            sample_type,
            nodata: None,
            scale: 1.0,
            offset: 0.0,
            block: (width, 1),
            bands: 1,
            band: 1,
            format,
            details: Vec::new(),
        }
    }

    /// The rectangle of all samples.
    pub fn bounds(&self) -> Rect {
        Rect::new(0, 0, self.width, self.height)
    }

    /// Fails if cells are too small for the precision of double coordinates.
    ///
    /// # Errors
    /// Unsupported: rounding would move samples by more than a thousandth of a cell.
    pub fn check_cells(&self) -> Result<()> {
        let Affine { x0, a, b, y0, d, e } = self.transform;
        if self.transform.resolves(self.width, self.height) {
            return Ok(());
        }
        let [width, height] = [a.hypot(d), b.hypot(e)];
        Err(Error::unsupported(format!(
            "cells of {width:e} x {height:e} near {x0}, {y0} are below the precision of double coordinates"
        ))
        .remedy("move the grid closer to the origin: gdal_edit.py -a_ullr WEST NORTH EAST SOUTH FILE"))
    }

    /// True if every height is exact in `f32`, so that [`GridSource::read_f32`] is lossless.
    pub fn exact_in_f32(&self) -> bool {
        use SampleType::{F16, F32, I8, I16, U8, U16};
        let narrow = matches!(self.sample_type, I8 | U8 | I16 | U16 | F16 | F32);
        narrow && self.scale == 1.0 && self.offset == 0.0
    }
}

/// A grid that is read by window. Implementations are shared between threads, never hold the whole grid, and
/// keep caches within the size given at opening.
pub trait GridSource: Send + Sync {
    /// Metadata of the grid.
    fn info(&self) -> &GridInfo;

    /// Reads the heights of `rect` (inside the grid) row by row into `out`
    /// (`rect.len()` values). Voids (nodata, masked samples, NaN, infinities, sparse blocks) are
    /// NaN.
    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()>;

    /// As [`read_f32`](Self::read_f32), in `f64`, exact for every sample type.
    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()>;

    /// Bytes in memory while the largest block is decoded, which
    /// [`GridOpenOptions::cache_bytes`](crate::GridOpenOptions::cache_bytes) must allow; 0 if samples are
    /// read directly from the file.
    fn block_bytes(&self) -> u64 {
        0
    }

    /// The files of the grid if they differ from its inputs, as for virtual rasters.
    fn members(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Hint that the samples of `rect` will not be read again: mapped pages, and cached blocks whose samples are all
    /// released, may be dropped. A sample is released once.
    fn release(&self, _rect: Rect) {}

    /// Hint that all of `rect` has been read: mapped pages may be dropped, since reading them again is cheap.
    fn copied(&self, _rect: Rect) {}

    /// Hint, as GDAL's `AdviseRead`, that all of `rect` will be read from the top to the bottom: remote files are read
    /// ahead. Only the first call counts.
    fn advise_read(&self, _rect: Rect) {}
}

/// The common name of a height unit, and its original spelling if different.
pub(crate) fn unit_and_text(text: &str) -> (String, Option<String>) {
    let unit = normal_unit(text);
    let text = (unit != text).then(|| text.to_owned());
    (unit, text)
}

/// The common spelling of a height unit.
fn normal_unit(unit: &str) -> String {
    match unit.trim().to_lowercase().as_str() {
        "m" | "metre" | "metres" | "meter" | "meters" => "metre".to_owned(),
        "ft" | "foot" | "feet" => "foot".to_owned(),
        _ => unit.trim().to_owned(),
    }
}
