//! Proof of terrain tiles (quantized-mesh 1.0 in a geodetic pyramid, or 3D Tiles 1.1 of the same): their structure, the
//! distances of samples from the drawn surface, and their borders.
//!
//! A viewer places a vertex by its u, v and height on the WGS 84 ellipsoid and draws flat triangles between vertices. The
//! distance of a sample is measured along the normal of the ellipsoid at the sample. The triangle that this line meets may
//! be another than the one that contains the sample in (u, v), as chords bow, and its height there is lower by the sag of
//! the chord. [`TileFacets`] find both within the precision of `f64`.

mod border;
mod contain;
mod content;
mod decode;
mod ellipsoid;
mod facets;
mod fault;
mod glb;
mod meshopt;
mod skirt;
mod structure;
mod subtree;
mod tiling;
mod water;

pub use border::{TileSideChain, gap, lattice};
pub use contain::{StatedTileMetadata, between, contain, lowest, tight};
pub use content::{GlbTileContent, StatedTileLevel};
pub use decode::DecodedTile;
pub use ellipsoid::{ProofMeridian, ProofParallel, position};
pub use facets::{BYTES_PER_VERTEX, SampleRunErrors, TileFacets};
pub use fault::{TilesetCheck, TilesetFault, TilesetFaultCount, TilesetFaults};
pub use skirt::TileSkirt;
pub use structure::structure;
pub use subtree::{MAX_SUBTREE_LEVELS, MetadataSchema, Subtree};
pub use tiling::{LAST, MAX_LEVEL, ProofTileId, ProofTileSide, columns, rows};
pub use water::{MaskPixels, UNCLEAR, WaterBank, WaterShore};

/// Error of level 0 that clients assume, in metres; each level has half of the previous one.
pub const ERROR_OF_ROOT: f64 = 77_067.34;

/// Error of a level that clients assume, in metres.
pub fn assumed_error(level: u8) -> f64 {
    ERROR_OF_ROOT / 2f64.powi(i32::from(level))
}
