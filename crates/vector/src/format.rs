//! A vector format: an entry of the registry.

use std::path::Path;

use crate::feature::LayerHeader;
use crate::geometry::GeometryType;
use crate::sink::{FeatureSink, VectorWriteOptions};
use crate::source::{FeatureSource, VectorOpenOptions};
use terrane_base::error::Result;
use terrane_base::registry::RegistryEntry;
use terrane_files::format::FileFormat;

/// One format: an entry of [`FORMATS`](crate::FORMATS).
#[derive(Debug)]
pub struct VectorFormat {
    /// Short name for `--format` and messages ("GeoJSON").
    pub name: &'static str,
    /// File name extensions, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// Capabilities of the format.
    pub holds: VectorCapabilities,
    /// Opens a file for reading.
    pub open: fn(&Path, &VectorOpenOptions) -> Result<Box<dyn FeatureSource>>,
    /// Creates a file; `None` for read-only formats.
    pub create: Option<Create>,
    /// True if `head`, the first bytes of a file (up to 4096), identifies the format.
    pub sniff: fn(&[u8]) -> bool,
}

/// Function that creates a file.
pub type Create = fn(&Path, &LayerHeader, &VectorWriteOptions) -> Result<Box<dyn FeatureSink>>;

/// Capabilities of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorCapabilities {
    /// Geometry types that are preserved.
    pub kinds: &'static [GeometryType],
    /// True if a file can contain several geometry types.
    pub mixed: bool,
    /// Heights.
    pub z: bool,
    /// Measures.
    pub m: bool,
    /// Properties of any type.
    pub properties: bool,
    /// How property values are stored.
    pub values: PropertySupport,
    /// Ids apart from properties.
    pub ids: bool,
    /// True if features keep their order.
    pub ordered: bool,
}

/// How a format stores property values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PropertySupport {
    /// Not at all.
    None,
    /// Each value has its own type.
    Typed,
    /// Typed columns: a column with values of several types stores text.
    Columns,
    /// As [`Columns`](Self::Columns) of a dBASE table: field names of ten bytes, decimals per column, and no
    /// distinction between empty text and null.
    Dbase,
    /// As untyped text.
    Cells,
    /// As text, in predefined elements of points and of lines.
    Named([&'static [&'static str]; 2]),
}

impl RegistryEntry for VectorFormat {
    const KIND: &'static str = "vector format";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.extensions
    }

    fn is_offered(&self) -> bool {
        self.create.is_some()
    }
}

impl FileFormat for VectorFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}
