//! Terrain tiles of a globe at all levels of detail, each with a proven error.
//!
//! A tile is a mesh of positions in degrees and heights in metres, rounded to a lattice; clients draw flat
//! triangles between them on the curved earth. The error of a tile is the largest vertical distance of a sample
//! in it from the drawn surface, including rounding and curvature. It is at most the geometric error of the
//! level, where positions can distinguish the samples.
//!
//! - Borders depend only on data on the border, and heights of a level are on one lattice, so neighbouring
//!   tiles have identical borders ([`TileLevel`], `border`).
//! - Inside, the sample with the largest error becomes a vertex (Garland & Heckbert 1995) until all errors are
//!   small enough; the kernel uses heights above a plane, which accounts for curvature ([`build`]).
//! - Then every sample is measured against the decoded surface, along its vertical ([`TileShell`]); samples
//!   beyond the error become vertices, and all are measured again.
//!
//! Voids are bridged by triangles between known samples and local means ([`VoidFill`]); beyond the grid the
//! ground descends from its edge to the ellipsoid, or continues level ([`GridGeolocation::sloping`]).

mod border;
mod encode;
mod fold;
mod georeference;
mod globe;
mod gltf;
mod gltf_buffer;
mod horizon;
mod level;
mod measure;
mod outline;
mod overview;
mod sample_run;
mod skirt;
mod subtree;
mod surface;
mod table;
mod terrain;
#[cfg(test)]
mod tests;
mod tile;
mod tile_triangle;
mod tiling;

pub use encode::{MASK_SIDE, MASK_WATER, TileExtensions, quantized_mesh};
pub use georeference::GridGeolocation;
pub use globe::{EllipsoidNormal, SinCos, Vector};
pub use gltf::{GlbTileOptions, TileMetadata, glb, in_shorts};
pub use level::{LevelRelief, TileLevel, deepest_for};
pub use measure::TileShell;
pub use overview::{
    BlockSummary, GatheredOverview, GridOverview, OverviewPlan, RectRelation, SampleBlock,
    SampleBlocks,
};
pub use sample_run::{SampleRow, TerrainSample, TerrainSampleRun};
pub use subtree::{CLASS, SUBTREE_LEVELS, subtree, subtree_of};
pub use surface::{TileBuilder, build};
pub use terrain::{HeightPatch, TerrainSampler, VoidFill, VoidFillSums};
pub use tile::{TerrainTile, TileErrorMeasure, TileVertex};
pub use tiling::{DEEPEST, GeodeticBounds, GlobeTileId, STEPS, degrees, level_error};
