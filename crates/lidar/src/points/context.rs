//! A points-to-points job with its input open.

use std::path::Path;

use super::job::TranslateJob;
use super::memory_shares::TranslateMemory;
use super::split::SplitColumn;
use super::tile_subset::TileSubset;
use terrane_cloud::write::CloudWriteOptions;
use terrane_cloud::{CloudInfo, PointCloud, PointFormatConverter};
use terrane_engine::plan::RunControl;
use terrane_files::folder_for;

/// A job whose input is open.
pub(super) struct TranslateContext<'a> {
    pub(super) job: &'a TranslateJob,
    pub(super) input: &'a PointCloud,
    /// The input, in the frame of the methods.
    pub(super) cloud: &'a CloudInfo,
    /// The split column, if any.
    pub(super) split: Option<&'a SplitColumn>,
    /// Properties of the output.
    pub(super) info: &'a CloudInfo,
    pub(super) converter: &'a PointFormatConverter<'a>,
    pub(super) options: CloudWriteOptions,
    pub(super) shares: TranslateMemory,
    /// The tiles to make, if not all.
    pub(super) subset: Option<&'a TileSubset<'a>>,
    pub(super) at: RunControl<'a>,
}

impl TranslateContext<'_> {
    /// Folder for spilled data: that of the output.
    pub(super) fn folder(&self) -> &Path {
        match (&self.job.resources.temp_dir, self.subset) {
            (None, Some(subset)) => subset.folder,
            (temp_dir, _) => folder_for(&self.job.output, temp_dir.as_deref()),
        }
    }
}
