//! A grid format for writing: an entry of the registry; the sink behind it.

use std::path::{Path, PathBuf};

use super::creation::{CreationOption, CreationOptions};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::store::HeightSlice;
use crate::store::metadata::BandName;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// One format of grids: an entry of [`FORMATS`](super::FORMATS).
#[derive(Debug)]
pub struct GridFormat {
    /// Short name for `--format` and messages, unique.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// What `--co` may say.
    pub options: &'static [CreationOption],
    /// Whether a file may hold several bands.
    pub several_bands: bool,
    /// Whether a file may be a picture: its bands red, green, blue and opacity.
    pub holds_colours: bool,
    /// Whether samples are held as the type that is asked for; else as the format has them.
    pub holds_types: bool,
    /// Whether voids may be written as a value that is asked for.
    pub names_voids: bool,
    /// Bytes that a thread holds for each sample of a block, heights included, at most.
    pub bytes_per_sample: u64,
    /// Starts a file.
    pub(super) create: fn(&GridWriteRequest<'_>) -> Result<Box<dyn GridSink>>,
}

/// How a grid is to be written.
#[derive(Clone, Debug, Default)]
pub struct GridWriteOptions {
    /// Replace existing files.
    pub overwrite: bool,
    /// Creation options as given.
    pub creation: Vec<(String, String)>,
    /// Type of the samples; that of the grid, or what the format holds, when `None`.
    pub sample_type: Option<SampleType>,
    /// Stored value for voids; that of the grid, where the type holds it, when `None`.
    pub nodata: Option<f64>,
    /// Store the nearest value where the type does not hold a height exactly, instead of failing.
    pub round: bool,
    /// Folder for temporary files; the output's when `None`.
    pub temp_dir: Option<PathBuf>,
    /// What the bands are called; one band without a name when empty.
    pub bands: Vec<BandName>,
    /// Whether the bands, three or four of bytes, are red, green, blue and opacity.
    pub are_colours: bool,
    /// Files that are read with the grid: nothing takes their place.
    pub read: Vec<PathBuf>,
}

impl GridWriteOptions {
    /// Bands to write.
    pub fn band_count(&self) -> u32 {
        u32::try_from(self.bands.len()).unwrap_or(u32::MAX).max(1)
    }
}

/// What a format is asked to write.
pub(super) struct GridWriteRequest<'a> {
    pub(super) path: &'a Path,
    pub(super) info: &'a GridInfo,
    pub(super) options: &'a GridWriteOptions,
    pub(super) creation: CreationOptions,
}

/// Receives a grid block by block and writes it whole or not at all: the file appears under its name
/// in [`finish`](Self::finish); dropping the sink before that leaves nothing.
pub trait GridSink: Send + Sync {
    /// What is written: sample type, nodata, scale and offset may differ from the source's.
    fn info(&self) -> &GridInfo;

    /// Columns and rows of a block of the current level.
    fn block(&self) -> (u32, u32);

    /// True when blocks must be appended in order and whole; otherwise pieces (rows of a block) may
    /// come in any order, and there is nothing to append.
    fn in_order(&self) -> bool {
        true
    }

    /// Encodes the heights of `rect`, a block of a band (from 0) cut to the grid, into `out` (emptied
    /// first). Any thread, any order, once for each block and band.
    ///
    /// # Errors
    /// A height that the format cannot hold, with its column and row.
    fn encode(
        &self,
        band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()>;

    /// Appends what [`encode`](Self::encode) made, blocks by row from the first, one at a time; those of
    /// all bands one after the other before the next block.
    fn append(&self, bytes: &[u8]) -> Result<()>;

    /// Ends the current level. When the file has another one, it becomes the current one, and its
    /// grid is returned, one for each band, to be fed like the first.
    fn next_level(&mut self) -> Result<Option<Vec<Box<dyn GridSource>>>> {
        Ok(None)
    }

    /// What of the grid the format cannot say, for the user.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Completes the file, puts it under its name, and returns its size in bytes.
    fn finish(self: Box<Self>) -> Result<u64>;
}

impl GridFormat {
    /// Fails unless the options are the format's, with values it takes.
    pub fn check(&self, creation: &[(String, String)]) -> Result<()> {
        CreationOptions::new(self.name, self.options, creation).map(drop)
    }

    /// Fails where the option that names a value for voids cannot act.
    ///
    /// # Errors
    /// Usage: voids of the format have no value.
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
