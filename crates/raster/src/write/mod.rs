//! Grid output: one module per format, the format registry, and the sink trait.
//!
//! A sink receives blocks. Blocks are encoded by any thread in any order; the encoded bytes are appended in
//! row-major order, so that the file does not depend on the threads. No sink holds the grid, and each file is
//! created atomically.

mod asc;
mod cog;
mod compress;
mod creation;
mod csv;
mod directory;
mod flt;
mod format;
mod geotiff;
mod gray;
mod level;
mod packed;
mod picture;
mod png;
mod png_picture;
mod predict;
mod rows;
mod sidecar;
mod target;
mod tiff;
mod tiled_tiff;

use std::path::Path;

pub use creation::{Accepts, CreationOption, CreationOptions};
pub use format::{GridFormat, GridSink, GridWriteOptions};

use self::format::GridWriteRequest;
use crate::grid::GridInfo;
pub use crate::tiled_tiff::metadata::BandName;
use crate::tiled_tiff::writer::refuse_old_sidecars;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_base::registry;
use terrane_files::format::FileFormat;

/// All formats that can be written, one line each. If several have the extension, the first is the default:
/// `.tif` is a plain GeoTIFF as in GDAL. The store is terrane's internal format.
pub const FORMATS: &[GridFormat] = &[
    geotiff::FORMAT,
    cog::FORMAT,
    tiled_tiff::FORMAT,
    asc::FORMAT,
    flt::FORMAT,
    png::FORMAT,
    csv::FORMAT,
];

impl GridFormat {
    /// Whether a file has overviews, a third of its size in total.
    pub fn has_overviews(&self) -> bool {
        self.name == cog::FORMAT.name
    }

    /// Whether a file is opened as an image by other programs.
    pub fn is_picture(&self) -> bool {
        self.name == png::FORMAT.name
    }

    /// Starts a file at `path` for the grid described by `info`.
    ///
    /// # Errors
    /// Invalid creation options, a grid that the format cannot store, or a file that cannot be created. A
    /// mask of an earlier file is rejected, because it would void samples of the new one.
    pub fn create(
        &self,
        path: &Path,
        info: &GridInfo,
        options: &GridWriteOptions,
    ) -> Result<Box<dyn GridSink>> {
        let creation = CreationOptions::new(self.name, self.options, &options.creation)?;
        self.check_bands(options)?;
        if options.nodata.is_some() {
            self.check_voids("‹out_nodata›")?;
        }
        refuse_old_sidecars(path)?;
        (self.create)(&GridWriteRequest { path, info, options, creation })
            .map_err(|e| e.in_file(path))
    }

    /// Fails unless the format supports colours.
    ///
    /// # Errors
    /// Usage: the format stores heights only.
    pub fn check_colours(&self) -> Result<()> {
        if self.holds_colours {
            return Ok(());
        }
        let formats = FORMATS.iter().filter(|format| format.holds_colours);
        let names: Vec<_> = formats.map(|format| format.name).collect();
        Err(Error::usage(format!("{} does not support colours", self.name))
            .remedy(format!("write {}", names.join(" or "))))
    }

    fn check_bands(&self, options: &GridWriteOptions) -> Result<()> {
        if options.are_colours {
            return self.check_colours();
        }
        if self.several_bands {
            return limits::check("number of bands", options.bands.len() as u64, limits::MAX_BANDS);
        }
        if options.band_count() == 1 {
            return Ok(());
        }
        let message = format!("{} does not support several bands", self.name);
        Err(Error::usage(message).remedy(format!("write {}, or one band", several_bands())))
    }
}

/// The format called `name`, or else the first with the extension of `path`.
///
/// # Errors
/// Usage: unknown name or extension (the message lists the known ones), or an extension of another format.
pub fn by_path(path: &Path, name: Option<&str>) -> Result<&'static GridFormat> {
    let format = terrane_files::format::by_path(FORMATS, path, name)?;
    if format.has_extension_of(path) {
        return Ok(format);
    }
    Err(format.wrong_ending(path))
}

/// As [`by_path`]; without a name, formats with colours are preferred.
///
/// # Errors
/// As [`by_path`]; a format without colours.
pub fn of_colours(path: &Path, name: Option<&str>) -> Result<&'static GridFormat> {
    let mut of_colours = FORMATS.iter().filter(|format| format.holds_colours);
    let name = name.or_else(|| Some(of_colours.find(|f| f.has_extension_of(path))?.name));
    let format = by_path(path, name)?;
    format.check_colours().map_err(|e| e.in_file(path))?;
    Ok(format)
}

/// The format called `name`.
///
/// # Errors
/// Usage: unknown name (the message lists the known ones).
pub fn by_name(name: &str) -> Result<&'static GridFormat> {
    registry::named(FORMATS, name)
}

/// Names of the formats with several bands.
fn several_bands() -> String {
    let formats = FORMATS.iter().filter(|format| format.several_bands);
    formats.map(|format| format.name).collect::<Vec<_>>().join(" or ")
}
