//! Grid formats for writing: registry entries and the sink trait.

use std::path::{Path, PathBuf};

use super::creation::{CreationOption, CreationOptions};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::metadata::BandName;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// One format of grids: an entry of [`FORMATS`](super::FORMATS).
#[derive(Debug)]
pub struct GridFormat {
    /// Unique short name for `--format` and messages.
    pub name: &'static str,
    /// File name extensions, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// Creation options.
    pub options: &'static [CreationOption],
    /// Whether a file can have several bands.
    pub several_bands: bool,
    /// Whether a file can be a colour image: red, green, blue and alpha.
    pub holds_colours: bool,
    /// Whether the sample type can be chosen.
    pub holds_types: bool,
    /// Whether the nodata value can be chosen.
    pub names_voids: bool,
    /// Maximum memory of a thread per sample of a block in bytes, including heights.
    pub bytes_per_sample: u64,
    /// Creates a file.
    pub(super) create: fn(&GridWriteRequest<'_>) -> Result<Box<dyn GridSink>>,
}

/// Options for writing a grid.
#[derive(Clone, Debug, Default)]
pub struct GridWriteOptions {
    /// Replace existing files.
    pub overwrite: bool,
    /// Creation options as given.
    pub creation: Vec<(String, String)>,
    /// Sample type; by default that of the grid or of the format.
    pub sample_type: Option<SampleType>,
    /// Stored nodata value; by default that of the grid, if the type can store it.
    pub nodata: Option<f64>,
    /// Round heights to the nearest stored value instead of failing if the type cannot store them exactly.
    pub round: bool,
    /// Folder for temporary files; by default that of the output.
    pub temp_dir: Option<PathBuf>,
    /// Names of the bands; empty for one band without a name.
    pub bands: Vec<BandName>,
    /// Whether the bands, three or four of uint8, are red, green, blue and alpha.
    pub are_colours: bool,
    /// Input files, which must not be overwritten.
    pub read: Vec<PathBuf>,
}

impl GridWriteOptions {
    /// Number of bands to write.
    pub fn band_count(&self) -> u32 {
        u32::try_from(self.bands.len()).unwrap_or(u32::MAX).max(1)
    }
}

/// A request to write a grid.
pub(super) struct GridWriteRequest<'a> {
    pub(super) path: &'a Path,
    pub(super) info: &'a GridInfo,
    pub(super) options: &'a GridWriteOptions,
    pub(super) creation: CreationOptions,
}

/// Writes a grid block by block and atomically: the file appears in [`finish`](Self::finish); dropping the
/// sink before leaves no file.
pub trait GridSink: Send + Sync {
    /// Metadata of the output; sample type, nodata, scale and offset may differ from the source.
    fn info(&self) -> &GridInfo;

    /// Columns and rows of a block of the current level.
    fn block(&self) -> (u32, u32);

    /// True if whole blocks must be appended in order; otherwise pieces (rows of a block) may be written in
    /// any order, and nothing is appended.
    fn in_order(&self) -> bool {
        true
    }

    /// Encodes the heights of `rect`, a block of a band (from 0) clipped to the grid, into `out` (cleared
    /// first). May be called from any thread and in any order, once per block and band.
    ///
    /// # Errors
    /// A height that the format cannot store, with its column and row.
    fn encode(
        &self,
        band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()>;

    /// Appends the output of [`encode`](Self::encode), one block at a time in row-major order; all bands of a
    /// block precede the next block.
    fn append(&self, bytes: &[u8]) -> Result<()>;

    /// Ends the current level. If the file has another one, it becomes current, and its grids (one per band)
    /// are returned and must be written in the same way.
    fn next_level(&mut self) -> Result<Option<Vec<Box<dyn GridSource>>>> {
        Ok(None)
    }

    /// Notes on metadata that the format cannot store.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Completes the file, commits it, and returns its size in bytes.
    fn finish(self: Box<Self>) -> Result<u64>;
}

impl GridFormat {
    /// Fails unless the creation options are valid for the format.
    pub fn check(&self, creation: &[(String, String)]) -> Result<()> {
        CreationOptions::new(self.name, self.options, creation).map(drop)
    }

    /// Fails if `option`, a nodata value, is not supported by the format.
    ///
    /// # Errors
    /// Usage: the format has no nodata value.
    pub fn check_voids(&self, option: &str) -> Result<()> {
        if self.names_voids {
            return Ok(());
        }
        Err(Error::usage(format!("{option} is not supported: {} has no nodata value", self.name))
            .remedy(format!("omit {option}")))
    }
}

impl RegistryEntry for GridFormat {
    const KIND: &'static str = "grid format";

    fn name(&self) -> &'static str {
        self.name
    }
}

impl FileFormat for GridFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}
