//! Mesh files: one module per format (reader and writer), and the registry.
//!
//! CityJSON is not supported: its vertices are integers, which readers take as 32 bits, and rounding to a step would
//! exceed the error bound.

mod capacity;
mod channels;
mod dxf;
mod format;
mod gltf;
mod input;
mod landxml;
mod length_unit;
mod obj;
mod obj_index;
mod ply;
mod ply_header;
mod promises;
mod registry;
mod relative_positions;
mod sidecar;
mod sink;
mod solid;
mod source;
pub mod split;
mod stl;
mod text;
mod threemf;
mod xml;

use std::path::Path;

use terrane_base::error::Result;

pub use capacity::MeshCapacity;
pub use channels::{ChannelKind, VertexCapabilities, VertexChannel, is_colour};
pub use format::MeshFormat;
pub use promises::{FittedHeights, HeightBand, MaxError, Promises};
pub use registry::{FORMATS, by_path, identify};
pub use sidecar::{check_prj, prj_path, write_prj};
pub use sink::{MeshBatch, MeshHeader, MeshSink, SinkOptions};
pub use source::{MeshInfo, MeshSource};
pub use text::plain;

/// Opens a mesh file of any known format, or a folder with a split mesh.
pub fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    if path.is_dir() { split::open(path) } else { registry::open_file(path) }
}
