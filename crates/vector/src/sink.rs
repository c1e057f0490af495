//! Writing, feature by feature; files appear whole or not at all.

use std::path::PathBuf;

use super::feature::{Feature, JsonMember};
use terrane_base::error::Result;

/// Options of writing.
#[derive(Clone, Debug)]
pub struct VectorWriteOptions {
    /// Replace files that exist.
    pub overwrite: bool,
    /// Digits behind the point that coordinates are rounded to, in any format; `None` to leave them.
    pub decimals: Option<u8>,
    /// Positions of lines and rings are rounded already, as far as they can be.
    pub lines_are_rounded: bool,
    /// Sort features into a spatial index, in formats that have one (FlatGeobuf).
    pub index: bool,
    /// Folder for what has to wait until all features are known; the output's own when `None`.
    pub temp_dir: Option<PathBuf>,
}

impl Default for VectorWriteOptions {
    fn default() -> Self {
        Self {
            overwrite: false,
            decimals: None,
            lines_are_rounded: false,
            index: true,
            temp_dir: None,
        }
    }
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WrittenFeatures {
    /// Features.
    pub features: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// The files, the one that was asked for first.
    pub files: Vec<PathBuf>,
    /// What the user should know: what the format could not hold, and where it differs from what
    /// programs may expect.
    pub notes: Vec<String>,
}

/// Takes features one by one. Dropping it before [`finish`](FeatureSink::finish) leaves nothing.
pub trait FeatureSink: Send {
    /// Appends a feature.
    ///
    /// # Errors
    /// What the format cannot hold, and failures to write.
    fn write(&mut self, feature: &Feature) -> Result<()>;

    /// Completes the file and gives it its name. `foreign` are members that were found after the
    /// features (see [`LayerHeader::foreign`](super::LayerHeader::foreign)), for formats that hold any.
    ///
    /// # Errors
    /// What the format cannot hold, and failures to write.
    fn finish(self: Box<Self>, foreign: &[JsonMember]) -> Result<WrittenFeatures>;
}
