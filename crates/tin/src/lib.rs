//! Grid to TIN: greedy insertion on one tile, and the seam patches that join tiles. Pure.
//!
//! Method: Garland & Heckbert, "Fast Polygonal Approximation of Terrains and Height Fields" (1995), algorithm III, with
//! adaptive-stride scans. Vertices are samples, moved vertically if heights are free.

mod adjust;
mod angles;
mod breaklines;
mod crossing;
mod drop;
mod exact;
mod exact_greedy;
mod facet;
mod greedy;
mod heights;
mod lattice_position;
mod measure;
mod mesh;
mod order;
mod patch;
mod refill;
mod scan;
pub mod scatter;
mod spec;
mod surface_bound;
mod tile;
mod tile_border;
mod tolerance;

pub use angles::MinimumAngle;
pub use breaklines::{PathStretch, goes_on};
pub use heights::HeightWindow;
pub use lattice_position::TilePosition;
pub use order::sort_by_position;
pub use patch::{mend_patch, reduce_patch};
pub use spec::{PatchInput, PatchMesh, TileInput, TileMesh, TileTriangle, TinSpec};
pub use tile::{TileScratch, triangulate_tile};
