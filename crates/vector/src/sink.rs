//! Writing of features one by one; files are created atomically.

use std::path::PathBuf;

use super::feature::{Feature, JsonMember};
use terrane_base::error::Result;

/// Options for writing a vector file.
#[derive(Clone, Debug)]
pub struct VectorWriteOptions {
    /// Replace files that exist.
    pub overwrite: bool,
    /// Number of decimals to round coordinates to; `None` keeps them.
    pub decimals: Option<u8>,
    /// True if positions of lines and rings are rounded already, as far as possible.
    pub lines_are_rounded: bool,
    /// Build a spatial index, in formats that have one (FlatGeobuf).
    pub index: bool,
    /// Write a table of the properties alone, a row for each feature, in formats of [cells](crate::PropertySupport::Cells).
    pub table: bool,
    /// Folder for temporary files; the folder of the output if `None`.
    pub temp_dir: Option<PathBuf>,
}

impl Default for VectorWriteOptions {
    fn default() -> Self {
        Self {
            overwrite: false,
            decimals: None,
            lines_are_rounded: false,
            index: true,
            table: false,
            temp_dir: None,
        }
    }
}

/// Result of writing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WrittenFeatures {
    /// Features.
    pub features: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// The files, the requested one first.
    pub files: Vec<PathBuf>,
    /// Notes for the user: content that the format cannot store, and deviations from common practice.
    pub notes: Vec<String>,
}

/// Sequential writer of features. Dropping it before [`finish`](FeatureSink::finish) leaves no file.
pub trait FeatureSink: Send {
    /// Appends a feature.
    ///
    /// # Errors
    /// Content that the format cannot store, and write errors.
    fn write(&mut self, feature: &Feature) -> Result<()>;

    /// Completes the file and gives it its name. `foreign` are foreign members found after the features (see
    /// [`LayerHeader::foreign`](super::LayerHeader::foreign)), for formats that store them.
    ///
    /// # Errors
    /// Content that the format cannot store, and write errors.
    fn finish(self: Box<Self>, foreign: &[JsonMember]) -> Result<WrittenFeatures>;
}
