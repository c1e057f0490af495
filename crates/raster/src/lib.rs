//! Grid sources and sinks: one file per format, and the registry that names them.
//!
//! Everything reads by window, out of core. Inputs of others are read with `pread`; only stores
//! written by terrane are memory-mapped.

/// What of [`GridSource`] another grid behind a field is told in its place.
macro_rules! hints_go_to {
    ($inner:ident) => {
        fn release(&self, rect: terrane_base::geom::Rect) {
            self.$inner.release(rect);
        }

        fn copied(&self, rect: terrane_base::geom::Rect) {
            self.$inner.copied(rect);
        }
    };
}

/// What of [`GridSource`] is the same for all that have an `info` and read heights of either width by one
/// generic `read`.
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

mod array;
mod asc;
mod cache;
mod clip;
mod decimal;
mod dted;
mod geotiff;
mod held;
mod hgt;
mod mosaic;
mod nodata;
mod notes;
mod npy;
mod packed;
mod pam;
mod part;
mod png;
mod prj;
mod raw;
mod sample;
mod spool;
pub mod store;
mod strided;
mod synth;
mod upright;
mod usgs;
mod water;
mod window;
mod world;
pub mod write;
mod xml;
mod xyz;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use array::{ArrayGrid, ArraySample};
pub use clip::{Areas, Clip, ClipRings};
pub use held::HeldGrid;
pub use mosaic::{Inputs, files, files_below, is_collection};
pub use nodata::{looks_like_nodata, undeclared_nodata};
pub use notes::{NOTE_KINDS, Note, cautions, no_terrain, notes, notes_on_heights, terrain};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_base::registry::Named;
use terrane_files as file;
use terrane_files::format::{Format, by_extension};
pub use upright::Upright;
pub use water::{Water, WaterFeatures, WaterReport};
use window::Window;

/// How samples are stored in the file.
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
    /// All of them, the narrowest first.
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

    /// The type of this name, in any case ("Int16"); "byte" is `uint8`, as GDAL has it.
    pub fn by_name(name: &str) -> Option<Self> {
        let name = if name.eq_ignore_ascii_case("byte") { "uint8" } else { name };
        Self::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(name))
    }

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
    /// One band of `width` x `height` samples without a place, system or nodata, read row by row.
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

    /// Fails where cells are so small that doubles do not hold the positions of samples.
    ///
    /// # Errors
    /// Unsupported: positions would be off their samples by more than a thousandth of a cell.
    pub fn check_cells(&self) -> Result<()> {
        let Affine { x0, a, b, y0, d, e } = self.transform;
        if self.transform.resolves(self.width, self.height) {
            return Ok(());
        }
        let [width, height] = [a.hypot(d), b.hypot(e)];
        Err(Error::unsupported(format!(
            "cells of {width:e} x {height:e} are too small for positions near {x0}, {y0}: doubles do not tell \
             them apart"
        ))
        .remedy("place the grid nearer to 0: gdal_edit.py -a_ullr WEST NORTH EAST SOUTH FILE"))
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
    /// (`rect.len()` values). Voids (nodata, masked samples, NaN, infinities, sparse blocks) are
    /// NaN.
    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()>;

    /// As [`read_f32`](Self::read_f32), in `f64`, exact for every sample type.
    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()>;

    /// Bytes of the largest block that is decoded whole: [`OpenOptions::cache_bytes`] must hold as
    /// many. 0 where samples are read straight from the file.
    fn block_bytes(&self) -> u64 {
        0
    }

    /// The files it is made of, where these are not the ones it was opened by: those that a virtual
    /// raster names.
    fn members(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// A hint that `rect` will not be read again soon: mapped pages or cached blocks may go.
    fn release(&self, _rect: Rect) {}

    /// A hint that all of `rect` has been read: mapped pages may go, as they cost little to have again.
    fn copied(&self, _rect: Rect) {}
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
    /// Threads that open the files of a mosaic; within a pool of rayon's it is that pool's.
    pub threads: usize,
    /// Folder for what has to be unpacked first; the system's when `None`.
    pub temp_dir: Option<PathBuf>,
    /// The box (x min, y min, x max, y max) whose cells are all there is of what [`open_all`] opens, once water is
    /// level and the grid is clipped.
    pub bbox: Option<[f64; 4]>,
    /// What [`open_all`] clips the grid to: all samples outside are voids. Its bytes are taken off
    /// `cache_bytes`.
    pub clip: Option<Arc<Clip>>,
    /// Water that [`open_all`] makes level, before it clips. Its bytes are taken off `cache_bytes`, too.
    pub water: Option<Arc<Water>>,
    /// The colours of a PNG are bands: it is not asked how they tell heights.
    pub colours: bool,
}

impl Default for OpenOptions {
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

/// Bytes of a file's start that [`RasterFormat::sniff`] gets to see.
const HEAD_BYTES: u64 = 64;

/// Opens a grid: a file by its content, else by its extension, or a synthetic terrain by its name
/// (`synth:rough,size=4097,seed=7`). `terrarium:` or `terrain-rgb:` before the name of a PNG tells
/// how it holds heights.
///
/// # Errors
/// A missing file, a folder, a file of no known format, or whatever the format's opener finds.
pub fn open(input: &str, options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    if terrane_files::is_held(input) {
        return held::open(input, options);
    }
    if input.starts_with(synth::PREFIX) {
        return synth::open(input, options);
    }
    if let Some((packing, path)) = png::Packing::stated(input) {
        let path = &*file::path_of(path);
        return open_as(path, &png::FORMAT, options, |o| png::open(path, Some(packing), o));
    }
    open_path(&file::path_of(input), options)
}

/// Opens `inputs` as one grid: a file or terrain as [`open`] does, and else all files that they stand
/// for ([`files`]) on the lattice of the first one, later ones on top wherever they are valid.
///
/// # Errors
/// Whatever [`open`] finds in a file, and two files that differ in what they must agree in; polygons to
/// clip to that are in another reference system, hold no sample, or take all of the cache; a box without a cell.
pub fn open_all(inputs: &[String], options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    let open = |options: &OpenOptions| match inputs {
        [one] if !is_collection(one) => open(one, options),
        _ => mosaic::open(inputs, options),
    };
    let open = |options: &OpenOptions| match &options.water {
        Some(water) => water::levelled(water, options, open),
        None => open(options),
    };
    let open = |options: &OpenOptions| match &options.clip {
        Some(clip) => clip::clipped(clip, options, open),
        None => open(options),
    };
    match options.bbox {
        Some(bbox) => part::part(bbox, options, open),
        None => open(options),
    }
}

/// The name of the file that `input` stands for: without `terrarium:` and the like before it.
pub fn file_name(input: &str) -> &str {
    png::Packing::stated(input).map_or(input, |(_, path)| path)
}

/// Opens a file of any format.
fn open_path(path: &Path, options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    let head = head_of(path)?;
    let format = format_of(path, &head).ok_or_else(|| unknown_format(path))?;
    open_as(path, format, options, |options| (format.open)(path, options))
}

/// Opens a file of `format` by `open`, with what lies beside it.
fn open_as(
    path: &Path,
    format: &RasterFormat,
    options: &OpenOptions,
    open: impl Fn(&OpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    refuse_mask(path, format)?;
    pam::open(path, format, options, open)
}

/// The mask file beside `path`, if there is one: its name with ".msk" behind, as GDAL has it.
fn mask_beside(path: &Path) -> Option<PathBuf> {
    let with = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    [".msk", ".MSK"].map(with).into_iter().find(|path| path.exists())
}

/// A mask beside a file may void any of its samples; it is honoured for GeoTIFFs.
fn refuse_mask(path: &Path, format: &RasterFormat) -> Result<()> {
    match mask_beside(path) {
        Some(mask) if format.name != geotiff::FORMAT.name => {
            let message = format!("a mask beside a file of {} is not supported", format.name);
            Err(Error::unsupported(message).in_file(&mask).remedy(
                "put both into a GeoTIFF: gdal_translate IN OUT.tif, or move the mask away",
            ))
        }
        _ => Ok(()),
    }
}

/// The format of a file: by its first bytes, else by its name. The header of a raw grid goes by
/// its name, for it begins as a text grid does.
fn format_of(path: &Path, head: &[u8]) -> Option<&'static RasterFormat> {
    let is_header = raw::is_header_name(path);
    let by_content = FORMATS.iter().find(|format| !is_header && (format.sniff)(head));
    let by_name = || by_extension(FORMATS, path);
    by_content.or_else(by_name).or_else(|| has_header(path).then_some(&raw::FORMAT))
}

/// True when an ESRI or ENVI header lies beside `path`, so that it is a raw grid whatever its
/// ending, unless that is another format's.
pub fn has_header(path: &Path) -> bool {
    raw::header_beside(path).is_some()
}

/// The first bytes of a regular file.
fn head_of(path: &Path) -> Result<Vec<u8>> {
    let fail = |e| Error::read(path, e);
    let meta = std::fs::metadata(path).map_err(fail)?;
    if !meta.is_file() {
        return Err(Error::usage("is not a file").in_file(path));
    }
    let mut head = Vec::new();
    File::open(path).and_then(|f| f.take(HEAD_BYTES).read_to_end(&mut head)).map_err(fail)?;
    if head.is_empty() {
        return Err(Error::bad_input("file is empty").in_file(path).remedy("copy it again"));
    }
    Ok(head)
}

fn unknown_format(path: &Path) -> Error {
    let known = |f: &RasterFormat| format!("{} (.{})", f.name, f.extensions.join(", ."));
    let known: Vec<String> = FORMATS.iter().map(known).collect();
    Error::bad_input("is not a raster file of a known format")
        .in_file(path)
        .remedy(format!("terrane reads {}", known.join(", ")))
}

impl Named for RasterFormat {
    const KIND: &'static str = "raster format";

    fn name(&self) -> &'static str {
        self.name
    }
}

impl Format for RasterFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}

/// The common name of a unit of height, and its spelling where that is another.
fn unit_and_text(text: &str) -> (String, Option<String>) {
    let unit = normal_unit(text);
    let text = (unit != text).then(|| text.to_owned());
    (unit, text)
}

/// One spelling for each common unit of height.
fn normal_unit(unit: &str) -> String {
    match unit.trim().to_lowercase().as_str() {
        "m" | "metre" | "metres" | "meter" | "meters" => "metre".to_owned(),
        "ft" | "foot" | "feet" => "foot".to_owned(),
        _ => unit.trim().to_owned(),
    }
}

/// Fails unless `band` is 1, for formats of one band.
fn only_band(band: u32) -> Result<()> {
    some_band(band, 1)
}

/// Fails unless `band` is one of `bands`, counted from 1.
fn some_band(band: u32, bands: u32) -> Result<()> {
    if (1..=bands).contains(&band) {
        return Ok(());
    }
    let (noun, remedy) = match bands {
        1 => ("band", "leave out ‹band›".to_owned()),
        _ => ("bands", format!("give ‹band› 1 to {bands}")),
    };
    Err(Error::usage(format!("band {band} is out of range: the file has {bands} {noun}"))
        .remedy(remedy))
}
