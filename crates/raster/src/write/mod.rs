//! Grids written: one file per format, the registry that names them, and the trait behind each.
//!
//! A sink is fed block by block. Blocks are encoded by any thread in any order; the encoded bytes are
//! appended one by one in row-major order, so that the file is the same whatever the threads. No sink
//! holds the grid, and each file appears under its name whole or not at all.

mod asc;
mod cog;
mod compress;
mod creation;
mod csv;
mod directory;
mod flt;
mod geotiff;
mod gray;
mod level;
mod packed;
mod picture;
mod png;
mod predict;
mod rows;
mod sidecar;
mod store;
mod target;
mod tiff;

use std::path::{Path, PathBuf};

pub use creation::{Accepts, Creation, CreationOption};

use crate::store::Heights;
use crate::store::writer::refuse_old_sidecars;
use crate::{GridInfo, GridSource, SampleType};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;
use terrane_base::registry::{self, Named};
use terrane_files::format::{self, Format};

/// All formats that can be written. A new one is one file and one line here. Where several have an
/// ending, the first is meant unless another is named.
pub const FORMATS: &[GridFormat] = &[
    geotiff::FORMAT,
    cog::FORMAT,
    store::FORMAT,
    asc::FORMAT,
    flt::FORMAT,
    png::FORMAT,
    csv::FORMAT,
];

/// One format of grids: an entry of [`FORMATS`].
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
    pub(super) create: fn(&Order<'_>) -> Result<Box<dyn GridSink>>,
}

/// How a grid is to be written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
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

/// What a band is called.
#[derive(Clone, Debug, PartialEq)]
pub struct BandName {
    /// Its description, as GDAL has it.
    pub name: String,
    /// Whether its values are in the vertical unit of the grid.
    pub in_vertical_unit: bool,
    /// Whether 0 stands for no value.
    pub counts: bool,
}

impl WriteOptions {
    /// Bands to write.
    pub fn band_count(&self) -> u32 {
        u32::try_from(self.bands.len()).unwrap_or(u32::MAX).max(1)
    }
}

/// What a format is asked to write.
pub(super) struct Order<'a> {
    path: &'a Path,
    info: &'a GridInfo,
    options: &'a WriteOptions,
    creation: Creation,
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
    fn encode(&self, band: u32, rect: Rect, heights: Heights<'_>, out: &mut Vec<u8>) -> Result<()>;

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
    /// Whether a file holds coarser copies of the grid, too, a third of it in all.
    pub fn has_overviews(&self) -> bool {
        self.name == cog::FORMAT.name
    }

    /// Whether a file is a picture to those who open it.
    pub fn is_picture(&self) -> bool {
        self.name == png::FORMAT.name
    }

    /// Fails unless the options are the format's, with values it takes.
    pub fn check(&self, creation: &[(String, String)]) -> Result<()> {
        Creation::new(self.name, self.options, creation).map(drop)
    }

    /// Starts a file at `path` for the grid that `info` describes.
    ///
    /// # Errors
    /// Options the format does not take, a grid it cannot hold, or a file that cannot be made. A mask
    /// of an earlier file beside `path` is refused: it would void samples of the new one.
    pub fn create(
        &self,
        path: &Path,
        info: &GridInfo,
        options: &WriteOptions,
    ) -> Result<Box<dyn GridSink>> {
        let creation = Creation::new(self.name, self.options, &options.creation)?;
        self.check_bands(options)?;
        if options.nodata.is_some() {
            self.check_voids("‹out_nodata›")?;
        }
        refuse_old_sidecars(path)?;
        (self.create)(&Order { path, info, options, creation }).map_err(|e| e.in_file(path))
    }

    /// Fails where the option that names a value for voids cannot act.
    ///
    /// # Errors
    /// Usage: voids of the format have no value.
    pub fn check_voids(&self, option: &str) -> Result<()> {
        if self.names_voids {
            return Ok(());
        }
        Err(Error::usage(format!("{option} cannot act: {} has no value for voids", self.name))
            .remedy(format!("leave {option} out")))
    }

    /// Fails unless a file may be a picture.
    ///
    /// # Errors
    /// Usage: the format holds heights alone.
    pub fn check_colours(&self) -> Result<()> {
        if self.holds_colours {
            return Ok(());
        }
        let formats = FORMATS.iter().filter(|format| format.holds_colours);
        let names: Vec<_> = formats.map(|format| format.name).collect();
        Err(Error::usage(format!("{} cannot hold colours", self.name))
            .remedy(format!("write {}", names.join(" or "))))
    }

    fn check_bands(&self, options: &WriteOptions) -> Result<()> {
        if options.are_colours {
            return self.check_colours();
        }
        if self.several_bands {
            return limits::check("number of bands", options.bands.len() as u64, limits::MAX_BANDS);
        }
        if options.band_count() == 1 {
            return Ok(());
        }
        let message = format!("{} cannot hold several bands", self.name);
        Err(Error::usage(message).remedy(format!("write {}, or one band", several_bands())))
    }
}

/// The format called `name`, or else the first that `path`'s ending stands for.
///
/// # Errors
/// Usage: an unknown name or ending (the known ones are listed), or a name whose format does not have
/// the ending.
pub fn by_path(path: &Path, name: Option<&str>) -> Result<&'static GridFormat> {
    let format = format::by_path(FORMATS, path, name)?;
    if format.has_extension_of(path) {
        return Ok(format);
    }
    Err(format.wrong_ending(path))
}

/// As [`by_path`], of formats that hold colours if no name is given and one of them has the ending.
///
/// # Errors
/// Those of [`by_path`], and a format without colours.
pub fn of_colours(path: &Path, name: Option<&str>) -> Result<&'static GridFormat> {
    let with = |format: &&GridFormat| format.holds_colours && format.has_extension_of(path);
    let name = name.or_else(|| FORMATS.iter().find(with).map(|format| format.name));
    let format = by_path(path, name)?;
    format.check_colours().map_err(|e| e.in_file(path))?;
    Ok(format)
}

/// The format called `name`.
///
/// # Errors
/// Usage: an unknown name (the known ones are listed).
pub fn by_name(name: &str) -> Result<&'static GridFormat> {
    registry::named(FORMATS, name)
}

impl Named for GridFormat {
    const KIND: &'static str = "grid format";

    fn name(&self) -> &'static str {
        self.name
    }
}

impl Format for GridFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}

/// The formats that hold several bands.
fn several_bands() -> String {
    let formats = FORMATS.iter().filter(|format| format.several_bands);
    formats.map(|format| format.name).collect::<Vec<_>>().join(" or ")
}
