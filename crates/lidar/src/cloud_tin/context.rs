//! The context of every stage of the work on a mesh of a cloud.

use std::path::Path;

use super::lines::CloudLines;
use super::regions::CloudTinRegions;
use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_engine::{Cancel, Progress, workers};

/// Context of every stage.
#[derive(Clone, Copy)]
pub(super) struct CloudTinContext<'a> {
    pub(super) points: &'a PointStore,
    pub(super) regions: &'a CloudTinRegions,
    pub(super) lines: &'a CloudLines<'a>,
    pub(super) threads: usize,
    /// Bytes of vertices that may be stored in memory.
    pub(super) vertex_bytes: u64,
    pub(super) measure: bool,
    pub(super) folder: &'a Path,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl CloudTinContext<'_> {
    /// Does `work` for every number below `count`, on all threads.
    pub(super) fn on_all(
        &self,
        count: u64,
        work: impl Fn(&mut (), u64) -> Result<()> + Sync,
    ) -> Result<()> {
        workers::run(self.threads, count, self.cancel, || (), work, Ok)
    }
}
