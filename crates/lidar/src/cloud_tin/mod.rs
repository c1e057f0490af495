//! Meshes of point clouds with a proven error bound: the job of `terrane tin` on point clouds.
//!
//! The mesh is the Delaunay triangulation of a set of points of the cloud, and nothing else, so it has no
//! seams: every region computes exactly the triangles it sees.
//!
//! Regions are blocks of tiles of up to 131,072 points. At the end each writes the triangles whose last corner,
//! in the order of regions, is its own. A sparse set of distant vertices (fewer with the distance) and the
//! corners of the convex hull keep circles small while the neighbourhood is being completed.
//!
//! **Why not borders of real points, as tiles of grids have.** Points do not lie on lines. A chain of
//! points along a border has to be constrained, and leaves slivers that must be mended afterwards.
//! Choosing freely and letting the triangulation decide costs one more pass over the points and has
//! nothing to mend.
//!
//! **Why lines have vertices of their own.** Points of a cloud are where the laser happened to hit; a kerb or a dam is
//! where it was measured. So a line is followed by posts on it (`lines`), not by paths over points as over the
//! samples of a grid. Nothing is forced: the triangulation of points and posts stays the one Delaunay triangulation.

mod choose;
mod job;
mod keep;
mod lines;
mod make;
mod operation;
mod options;
pub mod plan;
mod ready;
mod region_mesh;
mod regions;
mod work;
mod write;

pub use job::{CloudTinJob, CloudTinReport};
pub use make::{make, run};
pub use options::{CloudTinOptions, CloudTinSetters};
