//! terrane: an out-of-core terrain engine. This file is the map of the house; it holds no logic.
//!
//! Pure rooms (`geom`, `tin`, `contour`, `delaunay`, `gridding`, `line`, `synth`, `verify`, `render`) know
//! slices and numbers only: no path, no file, no thread pool. Rooms at the edge (`files`, `raster`, `cloud`,
//! `vector`, `output`) read and write files. `pipeline`
//! joins them into jobs, and `cli` turns arguments into jobs. ARCHITECTURE.md has the import table,
//! and `tests/tidy.rs` checks it.

pub mod cli;

pub use terrane_base::{Error, ErrorKind, Result, error, geom, limits};
pub use terrane_cloud as cloud;
pub use terrane_contour as contour;
pub use terrane_delaunay as delaunay;
use terrane_files as files;
pub use terrane_files::atomic;
pub use terrane_gridding as gridding;
pub use terrane_jobs as jobs;
pub use terrane_line as line;
pub use terrane_mesh as mesh;
pub use terrane_proof as proof;
pub use terrane_raster as raster;
pub use terrane_render as render;
pub use terrane_synth as synth;
pub use terrane_tin as tin;
pub use terrane_vector as vector;
