//! Grid sources and sinks: one file per format, and the registry that names them.
//!
//! All grids are read by window, out of core. Input files are read with `pread`; only stores written by terrane are
//! memory-mapped.
//!
//! Clipping and hydro-flattening are adapters of grids like mosaics, so they are in this crate and not in `terrain`:
//! every reader of grids opens them.

#[macro_use]
mod grid;

mod array;
mod asc;
mod cache;
mod clip;
mod decimal;
mod dted;
mod format;
mod geotiff;
mod hgt;
mod in_memory;
mod mosaic;
mod nodata;
mod notes;
mod npy;
mod packed;
mod pam;
mod png;
mod prj;
mod raw;
mod registry;
mod reorient;
mod sample;
mod sidecars;
mod spool;
mod strided;
mod subset;
mod synth;
pub mod tiled_tiff;
mod usgs;
mod water;
mod window;
mod world;
pub mod write;
mod xml;
mod xyz;

pub use array::{ArrayGrid, ArraySample};
pub use cache::{SharedBlocks, decoded_blocks};
pub use clip::{Clip, ClipRings, PolygonEdgeIndex, clipped};
pub use format::{GridOpenOptions, RasterFormat};
pub use grid::{GridInfo, GridSource, SampleType};
pub use in_memory::InMemoryGrid;
pub use mosaic::{
    Inputs, MosaicLayer, common_nodata, files, files_below, is_collection, open_layers, wider_type,
};
pub use nodata::{looks_like_nodata, undeclared_nodata};
pub use notes::{GridNote, NOTE_KINDS, cautions, no_terrain, notes, notes_on_heights, terrain};
pub use registry::{FORMATS, file_name, has_header, open};
pub use reorient::NorthUpGrid;
use terrane_base::error::Result;
pub use water::{Water, WaterFeatures, WaterReport};

/// Opens `inputs` as one grid: a single file or synthetic terrain as [`open`] does, or else a mosaic of all
/// files of the inputs ([`files`]) on the lattice of the first file, with later files on top where they are
/// valid.
///
/// # Errors
/// Errors of [`open`]; inconsistent files; clip polygons with another CRS, without a sample, or larger than
/// the cache; a box without a cell.
pub fn open_all(inputs: &[String], options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let grid = match options.bbox {
        Some(bbox) => subset::part(bbox, options, |options| open_clipped(inputs, options)),
        None => open_clipped(inputs, options),
    }?;
    grid.advise_read(grid.info().bounds());
    Ok(grid)
}

/// The grid within the clip polygons, if any.
fn open_clipped(inputs: &[String], options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    match &options.clip {
        Some(clip) => clip::clipped(clip, options, |options| open_levelled(inputs, options)),
        None => open_levelled(inputs, options),
    }
}

/// The grid with level water, if any.
fn open_levelled(inputs: &[String], options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    match &options.water {
        Some(water) => water::levelled(water, options, |options| open_files(inputs, options)),
        None => open_files(inputs, options),
    }
}

/// A single grid as it is, or else a mosaic.
fn open_files(inputs: &[String], options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    match inputs {
        [input] if !is_collection(input) => open(input, options),
        _ => mosaic::open(inputs, options),
    }
}
