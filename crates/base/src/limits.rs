//! Limits for values of untrusted headers. Every size read from a file is checked against one of these before
//! allocation.

use crate::error::{Error, Result};

/// Maximum columns or rows of a grid: grid coordinates and their differences stay exact.
pub const MAX_SIDE: u64 = 1 << 30;
/// Maximum bytes of a decoded block (strip or tile).
pub const MAX_BLOCK_BYTES: u64 = 1 << 30;
/// Maximum blocks of a raster file (their offsets are held in memory while it is open).
pub const MAX_BLOCKS: u64 = 1 << 28;
/// Maximum bands of a raster file.
pub const MAX_BANDS: u64 = 65_535;
/// Maximum bytes of a text or binary header value (a CRS citation, an ASCII tag, a header line).
pub const MAX_HEADER_BYTES: u64 = 16 << 20;
/// Maximum directories (pages, overviews, masks) of a TIFF.
pub const MAX_DIRECTORIES: u64 = 65_536;
/// Maximum unpacked bytes of a compressed or text grid in the temporary folder.
pub const MAX_UNPACKED_BYTES: u64 = 16 << 30;
/// Maximum entries of a TIFF directory.
pub const MAX_IFD_ENTRIES: u64 = 4096;
/// Maximum points of a point cloud file: sums over all files do not overflow.
pub const MAX_POINTS: u64 = 1 << 44;
/// Maximum files of a mosaic, including nested mosaics.
pub const MAX_MEMBERS: u64 = 1 << 18;
/// Maximum bytes of a VRT, including nested VRTs.
pub const MAX_VRT_BYTES: u64 = 256 << 20;
/// Maximum nesting of geometry collections.
pub const MAX_COLLECTION_DEPTH: u64 = 32;
/// Maximum members of a geometry collection.
pub const MAX_COLLECTION_MEMBERS: u64 = 1 << 22;
/// Maximum stored bytes of a feature of a vector file.
pub const MAX_FEATURE_BYTES: u64 = 2 << 30;
/// Maximum bytes of a file that is held in memory as a whole (TopoJSON).
pub const MAX_TOPOLOGY_BYTES: u64 = 4 << 30;
/// Maximum fields of an attribute table.
pub const MAX_FIELDS: u64 = 65_535;
/// Maximum magnitude of a height: differences and slopes do not overflow in `f32`.
pub const MAX_HEIGHT: f32 = 1e30;

/// Fails with the name of the limit if `found` exceeds `limit`.
pub fn check(name: &str, found: u64, limit: u64) -> Result<()> {
    if found > limit { Err(Error::limit(name, found, limit)) } else { Ok(()) }
}
