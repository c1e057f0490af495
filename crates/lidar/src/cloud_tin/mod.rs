//! Meshes of point clouds with a proven error bound: the job of `terrane tin` on point clouds.
//!
//! The mesh is the Delaunay triangulation of a subset of the points, so it has no seams: every region computes
//! exactly the triangles it sees.
//!
//! Regions are blocks of tiles of up to 131,072 points. At the end each writes the triangles whose last corner,
//! in the order of regions, is its own. A sparse set of distant vertices (fewer with the distance) and the
//! corners of the convex hull keep circles small while the neighbourhood is being completed.
//!
//! **Why not borders of points, as for tiles of grids.** Points do not lie on lines. A chain of points along a
//! border has to be constrained, and leaves slivers to repair afterwards. An unconstrained selection costs one
//! more pass over the points and needs no repair.
//!
//! **Why lines have vertices of their own.** Points lie where the laser happened to hit, but a kerb or a dam
//! has a measured position. So edges follow posts on the line (`lines`), not paths over points as over the
//! samples of a grid. There are no constrained edges: the mesh stays the Delaunay triangulation of points and
//! posts.

mod context;
mod job;
mod lines;
mod make;
mod nearest_points;
mod operation;
mod options;
pub mod plan;
mod prepared;
mod region_mesh;
mod regions;
mod vertex_selection;
mod write;

pub use job::{CloudTinJob, CloudTinReport};
pub use make::{make, run};
pub use options::{CloudTinOptions, CloudTinSetters};
