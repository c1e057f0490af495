//! A grid format for reading: an entry of the registry; options of opening.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::clip::Clip;
use crate::grid::GridSource;
use crate::water::Water;
use terrane_base::error::{Error, Result};
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// How to open a grid.
#[derive(Clone, Debug)]
pub struct GridOpenOptions {
    /// Band to read, from 1.
    pub band: u32,
    /// Replaces the file's nodata value.
    pub nodata: Option<f64>,
    /// Bytes the decoded-block cache may hold.
    pub cache_bytes: usize,
    /// Threads that open the files of a mosaic; within a pool of rayon's it is that pool's.
    pub threads: usize,
    /// Folder for what has to be unpacked first; the system's when `None`.
    pub temp_dir: Option<PathBuf>,
    /// The box (x min, y min, x max, y max) whose cells are all there is of what [`open_all`](crate::open_all) opens, once water is
    /// level and the grid is clipped.
    pub bbox: Option<[f64; 4]>,
    /// What [`open_all`](crate::open_all) clips the grid to: all samples outside are voids. Its bytes are taken off
    /// `cache_bytes`.
    pub clip: Option<Arc<Clip>>,
    /// Water that [`open_all`](crate::open_all) makes level, before it clips. Its bytes are taken off `cache_bytes`, too.
    pub water: Option<Arc<Water>>,
    /// The colours of a PNG are bands: it is not asked how they tell heights.
    pub colours: bool,
}

impl Default for GridOpenOptions {
    /// The first band, on all cores.
    fn default() -> Self {
        let threads = terrane_files::cores();
        Self {
            band: 1,
            nodata: None,
            cache_bytes: 256 << 20,
            threads,
            temp_dir: None,
            bbox: None,
            clip: None,
            water: None,
            colours: false,
        }
    }
}

/// One raster format: an entry of [`FORMATS`](crate::FORMATS).
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
    pub open: fn(&Path, &GridOpenOptions) -> Result<Box<dyn GridSource>>,
}

impl RegistryEntry for RasterFormat {
    const KIND: &'static str = "raster format";

    fn name(&self) -> &'static str {
        self.name
    }
}

impl FileFormat for RasterFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}

/// Fails unless `band` is 1, for formats of one band.
pub(crate) fn only_band(band: u32) -> Result<()> {
    some_band(band, 1)
}

/// Fails unless `band` is one of `bands`, counted from 1.
pub(crate) fn some_band(band: u32, bands: u32) -> Result<()> {
    if (1..=bands).contains(&band) {
        return Ok(());
    }
    let (noun, remedy) = match bands {
        1 => ("band", "omit ‹band›".to_owned()),
        _ => ("bands", format!("pass ‹band› 1 to {bands}")),
    };
    Err(Error::usage(format!("band {band} is out of range: the file has {bands} {noun}"))
        .remedy(remedy))
}
