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
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True when z is stored as f32 (heights are then rounded before the error is bounded).
    pub single_precision: bool,
    /// True when the surface can be closed with walls and a bottom: it is a format of printers, and a print is
    /// stored in millimetres.
    pub can_be_solid: bool,
    /// True when the file always says which length its unit is.
    pub states_unit: bool,
    /// True when the file has room for the name of its reference system.
    pub names_crs: bool,
    /// Fails where the format cannot say what the coordinates of a system are.
    pub admits: fn(&Crs) -> Result<()>,
    /// Most vertices and triangles the format can hold.
    pub most: fn() -> MeshCapacity,
    /// What vertices can have beside their positions.
    pub carries: VertexCapabilities,
    /// Starts a file.
    pub create: fn(&Path, &MeshHeader, &SinkOptions) -> Result<Box<dyn MeshSink>>,
    /// Opens a file for reading.
    pub open: fn(&Path) -> Result<Box<dyn MeshSource>>,
    /// True when the first bytes (up to 512) of a file are this format's.
    pub sniff: fn(&[u8]) -> bool,
}

impl MeshFormat {
    /// Fails with [`ErrorKind::CannotWrite`](terrane_base::error::ErrorKind::CannotWrite) when a mesh of this size
    /// does not fit into the format; the error names the limit and the formats that would do.
    pub fn check_capacity(&self, vertices: u64, triangles: u64) -> Result<()> {
        capacity::check(self.name, &(self.most)(), 0, vertices, triangles)
    }

    /// Fails when the format has no room for these channels; the error names those that do.
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
