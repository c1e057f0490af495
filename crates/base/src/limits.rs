//! Caps for values found in untrusted headers. Every size read from a file meets one of these
//! before anything is allocated.

use crate::error::{Error, Result};

/// Most columns or rows of a grid: lattice coordinates and their differences stay exact everywhere.
pub const MAX_SIDE: u64 = 1 << 30;
/// Most bytes one decoded block (strip or tile) may take.
pub const MAX_BLOCK_BYTES: u64 = 1 << 30;
/// Most blocks of one raster file (their offsets are held in memory while it is open).
pub const MAX_BLOCKS: u64 = 1 << 28;
/// Most bands of one raster file.
pub const MAX_BANDS: u64 = 65_535;
/// Most bytes of one text or binary header value (a CRS citation, an ASCII tag, a header line).
pub const MAX_HEADER_BYTES: u64 = 16 << 20;
/// Most directories (pages, overviews, masks) of one TIFF.
pub const MAX_DIRECTORIES: u64 = 65_536;
/// Most bytes a compressed or text grid may unpack to in the temporary folder.
pub const MAX_UNPACKED_BYTES: u64 = 16 << 30;
/// Most entries of one TIFF directory.
pub const MAX_IFD_ENTRIES: u64 = 4096;
/// Most points of one cloud file: sums over all files stay far from overflow.
pub const MAX_POINTS: u64 = 1 << 44;
/// Most files of one mosaic, those of mosaics within it included.
pub const MAX_MEMBERS: u64 = 1 << 18;
/// Most bytes of a VRT, those of VRTs within it included.
pub const MAX_VRT_BYTES: u64 = 256 << 20;
/// Most geometry collections within one another.
pub const MAX_COLLECTION_DEPTH: u64 = 32;
/// Most members of one geometry collection.
pub const MAX_COLLECTION_MEMBERS: u64 = 1 << 22;
/// Most bytes one feature of a vector file may take, as stored.
pub const MAX_FEATURE_BYTES: u64 = 2 << 30;
/// Most bytes of a file that has to be held whole (TopoJSON).
pub const MAX_TOPOLOGY_BYTES: u64 = 4 << 30;
/// Most fields of a table of features.
pub const MAX_FIELDS: u64 = 65_535;
/// Largest magnitude of a height: differences and slopes stay far from overflow in `f32`.
pub const MAX_HEIGHT: f32 = 1e30;

/// Fails with the limit's name when `found` is beyond `most`.
pub fn check(name: &str, found: u64, most: u64) -> Result<()> {
    if found > most { Err(Error::limit(name, found, most)) } else { Ok(()) }
}
