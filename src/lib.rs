//! terrane: an out-of-core terrain engine. This file is the map of the house; it holds no logic.
//!
//! Pure rooms (`geom`, `tin`, `contour`, `delaunay`, `gridding`, `line`, `synth`, `verify`, `render`) know
//! slices and numbers only: no path, no file, no thread pool. Rooms at the edge (`files`, `raster`, `cloud`,
//! `vector`, `output`) read and write files. `pipeline`
//! joins them into jobs, and `cli` turns arguments into jobs. ARCHITECTURE.md has the import table,
//! and `tests/tidy.rs` checks it.

pub mod atomic;
pub mod cli;
pub mod cloud;
pub mod contour;
pub mod delaunay;
pub mod error;
mod fault;
mod files;
pub mod geom;
pub mod gridding;
pub mod limits;
pub mod line;
pub mod output;
pub mod pipeline;
pub mod raster;
pub mod render;
pub mod synth;
pub mod tin;
pub mod vector;
pub mod verify;

pub use error::{Error, ErrorKind, Result};
