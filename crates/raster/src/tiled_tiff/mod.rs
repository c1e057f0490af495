//! The terrane store: an uncompressed tiled BigTIFF with page-aligned tiles, which can be memory-mapped and
//! which any GIS opens as a GeoTIFF.
//!
//! A file consists of a directory and contiguous tiles of equal size:
//!
//! ```text
//! BigTIFF header | directory and small values | tile offsets | tile byte counts | 0... | tile 0 | tile 1 | ...
//! 0              16                                                                   a multiple of 4096
//! ```
//!
//! Everything before the tiles is generated from a few values (`TiledTiffHeader`). Opening a store reads these
//! values, encodes them again, and compares every byte and the file length. Other files, including stores
//! edited by other programs, are opened by the general GeoTIFF reader.

mod crs;
pub(super) mod header;
mod layout;
mod map;
pub(super) mod metadata;
pub(super) mod out_of_range;
mod reader;
pub(super) mod sample;
pub(super) mod tags;
#[cfg(test)]
mod tests;
pub(super) mod writer;

pub use crs::complete;
pub use layout::{DEFAULT_TILE, TILE_SIDES};
pub use reader::try_open;
pub use writer::{HeightSlice, TiledTiffWriter};
