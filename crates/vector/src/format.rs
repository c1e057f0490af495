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
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// What a file of it can hold.
    pub holds: VectorCapabilities,
    /// Opens a file for reading.
    pub open: fn(&Path, &VectorOpenOptions) -> Result<Box<dyn FeatureSource>>,
    /// Starts a file; `None` for formats that are only read.
    pub create: Option<Create>,
    /// True when the first bytes of a file (up to 4096) are this format's.
    pub sniff: fn(&[u8]) -> bool,
}

/// Starts a file of a format.
pub type Create = fn(&Path, &LayerHeader, &VectorWriteOptions) -> Result<Box<dyn FeatureSink>>;

/// What a format can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorCapabilities {
    /// Kinds of geometries that come back as they were.
    pub kinds: &'static [GeometryType],
    /// True when one file can hold geometries of several kinds.
    pub mixed: bool,
    /// Heights.
    pub z: bool,
    /// Measures.
    pub m: bool,
    /// Properties of any type.
    pub properties: bool,
    /// How values of properties are held.
    pub values: PropertySupport,
    /// Ids apart from properties.
    pub ids: bool,
    /// True where features come back in the order they were written.
    pub ordered: bool,
}

/// How a format holds values of properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PropertySupport {
    /// Not at all.
    None,
    /// Each with a type of its own.
    Typed,
    /// In columns that have a type: a column of several kinds of values holds texts.
    Columns,
    /// As [`Columns`](Self::Columns) of a dBASE table: with names of ten bytes, digits behind the point
    /// as the column says, and no difference between no text and none at all.
    Dbase,
    /// As text, without a type.
    Cells,
    /// As text, under names that the format knows: those of points, and of lines.
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
