//! A mesh format: an entry of the registry.

use std::path::Path;

use crate::capacity::{self, MeshCapacity};
use crate::channels::{VertexCapabilities, VertexChannel};
use crate::sink::{MeshHeader, MeshSink, SinkOptions};
use crate::source::MeshSource;
use terrane_base::error::Result;
use terrane_base::geom::Crs;
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// One mesh format: an entry of [`FORMATS`](crate::FORMATS).
#[derive(Debug)]
pub struct MeshFormat {
    /// Short name for `--format` and messages ("PLY").
    pub name: &'static str,
    /// File name extensions, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True when z is stored as f32 (heights are then rounded before the error is bounded).
    pub single_precision: bool,
    /// True if the surface can be closed to a solid: formats for 3D printing, in millimetres.
    pub can_be_solid: bool,
    /// True if the file always states its length unit.
    pub states_unit: bool,
    /// True if the file can name its CRS.
    pub names_crs: bool,
    /// Fails if the format cannot express the units of a CRS.
    pub admits: fn(&Crs) -> Result<()>,
    /// Capacity limits.
    pub capacity: fn() -> MeshCapacity,
    /// Supported vertex channels.
    pub carries: VertexCapabilities,
    /// Creates a file.
    pub create: fn(&Path, &MeshHeader, &SinkOptions) -> Result<Box<dyn MeshSink>>,
    /// Opens a file for reading.
    pub open: fn(&Path) -> Result<Box<dyn MeshSource>>,
    /// True if the first bytes (up to 512) of a file are of this format.
    pub sniff: fn(&[u8]) -> bool,
}

impl MeshFormat {
    /// Fails with [`ErrorKind::CannotWrite`](terrane_base::error::ErrorKind::CannotWrite) if a mesh of this size
    /// exceeds the capacity; the error names the limit and suitable formats.
    pub fn check_capacity(&self, vertices: u64, triangles: u64) -> Result<()> {
        capacity::check(self.name, &(self.capacity)(), 0, vertices, triangles)
    }

    /// Fails if the format does not support these channels; the error names suitable formats.
    pub fn check_channels(&self, channels: &[VertexChannel]) -> Result<()> {
        capacity::check_channels(self.name, self.carries, channels)
    }
}

impl RegistryEntry for MeshFormat {
    const KIND: &'static str = "mesh format";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.extensions
    }
}

impl FileFormat for MeshFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}
