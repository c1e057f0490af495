//! terrane's own store: an uncompressed tiled BigTIFF whose tiles are aligned to the page, so that
//! it can be mapped into memory as it lies on disk while any GIS opens it as a GeoTIFF.
//!
//! A file is one directory, then one contiguous run of equally large tiles:
//!
//! ```text
//! BigTIFF header | directory and small values | tile offsets | tile byte counts | 0... | tile 0 | tile 1 | ...
//! 0              16                                                                   a multiple of 4096
//! ```
//!
//! Everything before the tiles follows from a few facts (`StoreHeader`), so opening a store means:
//! read the facts, encode them again, and demand that every byte and the file's length agree. Any
//! other file, one edited by another program included, is left to the general GeoTIFF reader.

mod crs;
pub(super) mod header;
mod layout;
mod map;
pub(super) mod metadata;
pub(super) mod misfit;
mod reader;
pub(super) mod sample;
pub(super) mod tags;
#[cfg(test)]
mod tests;
pub(super) mod writer;

pub use crs::complete;
pub use layout::{DEFAULT_TILE, TILE_SIDES};
pub use reader::try_open;
pub use writer::{HeightSlice, StoreWriter};
