//! Tiles of a globe's terrain at every level of detail, each with a proven error.
//!
//! A tile is a mesh of places in degrees and heights in metres, rounded to a lattice; a client draws flat triangles
//! between them, on the bent earth. The error of a tile is the largest vertical distance of any sample under it
//! from what is drawn: rounding and bend are in it. No tile is further off than clients take its level to be, where
//! positions can tell its samples apart.
//!
//! - Borders are chosen from what lies on them alone, and heights of a level are on one lattice, so tiles beside
//!   each other have the same border, bit by bit ([`TileLevel`], `border`).
//! - Within, the sample that is furthest off becomes a vertex (Garland & Heckbert 1995) until all are near enough;
//!   the kernel counts heights from a plane, so it knows of the bend ([`build`]).
//! - Then every sample is measured against the surface as it is decoded, along what is upright there ([`TileShell`]);
//!   those beyond the error become vertices, and all are measured again.
//!
//! Voids are spanned by triangles between what is known and means of what is around ([`VoidFill`]); beyond the grid the
//! ground falls from its edge to the ellipsoid, or goes on level ([`GridGeolocation::sloping`]).

mod border;
mod chart;
mod encode;
mod facet;
mod fold;
mod globe;
mod gltf;
mod ground;
mod horizon;
mod level;
mod measure;
mod outline;
mod overview;
mod parts;
mod run;
mod skirt;
mod subtree;
mod surface;
mod table;
#[cfg(test)]
mod tests;
mod tile;
mod tiling;

pub use chart::GridGeolocation;
pub use encode::{MASK_SIDE, MASK_WATER, TileExtensions, quantized_mesh};
pub use globe::{EllipsoidNormal, SinCos, Vector};
pub use gltf::{GlbTileOptions, TileMetadata, glb, in_shorts};
pub use ground::{GroundSampler, HeightPatch, VoidFill, VoidFillSums};
pub use level::{LevelRelief, TileLevel, deepest_for};
pub use measure::TileShell;
pub use overview::{
    BlockSummary, GatheredOverview, GridOverview, OverviewPlan, RectRelation, SampleBlock,
    SampleBlocks,
};
pub use run::{GroundSample, GroundSampleRun, SampleRow};
pub use subtree::{CLASS, SUBTREE_LEVELS, subtree, subtree_of};
pub use surface::{TileBuilder, build};
pub use tile::{TerrainTile, TileErrorMeasure, TileVertex};
pub use tiling::{DEEPEST, GeodeticBounds, GlobeTileId, STEPS, degrees, level_error};
