//! Grid formats for reading: registry entries and open options.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cache::SharedBlocks;
use crate::clip::Clip;
use crate::grid::GridSource;
use crate::water::Water;
use terrane_base::error::{Error, Result};
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// Options for opening a grid.
#[derive(Clone, Debug)]
pub struct GridOpenOptions {
    /// Band to read, from 1.
    pub band: u32,
    /// Replaces the file's nodata value.
    pub nodata: Option<f64>,
    /// Maximum bytes of decoded blocks in memory.
    pub cache_bytes: usize,
    /// The cache of a mosaic, for its files; a grid has its own if `None`.
    pub cache: Option<SharedBlocks>,
    /// Number of threads for opening the files of a mosaic; ignored inside a rayon pool.
    pub threads: usize,
    /// Folder for decompressed files and blocks; the system's temporary folder if `None`.
    pub temp_dir: Option<PathBuf>,
    /// Bounding box (x min, y min, x max, y max) of the cells that [`open_all`](crate::open_all) returns,
    /// applied after water and clipping.
    pub bbox: Option<[f64; 4]>,
    /// Polygons to which [`open_all`](crate::open_all) clips the grid: samples outside are void. Their memory
    /// counts towards `cache_bytes`.
    pub clip: Option<Arc<Clip>>,
    /// Water that [`open_all`](crate::open_all) flattens before clipping. Its memory counts towards
    /// `cache_bytes`, too.
    pub water: Option<Arc<Water>>,
    /// Read the colours of a PNG as bands rather than as encoded heights.
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
            cache: None,
            threads,
            temp_dir: None,
            bbox: None,
            clip: None,
            water: None,
            colours: false,
        }
    }
}

impl GridOpenOptions {
    /// The cache of the decoded blocks of the grid.
    pub(crate) fn blocks(&self) -> SharedBlocks {
        let own = || SharedBlocks::new(self.cache_bytes, self.temp_dir.as_deref());
        self.cache.clone().unwrap_or_else(own)
    }
}

/// One raster format: an entry of [`FORMATS`](crate::FORMATS).
pub struct RasterFormat {
    /// Unique display name.
    pub name: &'static str,
    /// File name extensions in lower case, without the leading dot ("tif", "hgt.zip").
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True if `head`, the first bytes (up to 64) of a file, identifies the format.
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
