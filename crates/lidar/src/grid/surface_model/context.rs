//! The context of a terrain model: the job, the memory for points, and their reading.

use std::path::Path;

use super::filter::spacing;
use super::kinds::{GROUND, NOISE, SurfaceModel};
use super::lengths::MetricFrame;
use super::scan_result::CloudOverview;
use crate::grid::extent::GridExtent;
use crate::grid::job::GridJob;
use crate::grid::neighbours::tiling;
use crate::grid::region_points::CellSurroundings;
use crate::point_index::{PointStore, PointStoreCoverage, PointStoreSetup, Tiling};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::{self as cloud, CloudFilter, CloudOpenOptions, PointSource, Return};
use terrane_delaunay::SiteWindow;
use terrane_engine::memory::short;
use terrane_engine::{Cancel, Progress};
use terrane_gridding::canopy::CanopyAlgorithm;

/// Stores that are in memory at once.
pub(super) const STORES: u64 = 3;
/// Context of a terrain model.
pub(in crate::grid) struct SurfaceModelContext<'a> {
    pub(in crate::grid) job: &'a GridJob,
    /// The cells.
    pub(in crate::grid) extent: &'a GridExtent,
    /// Reading options, without classes and returns.
    pub(in crate::grid) reading: CloudOpenOptions,
    pub(in crate::grid) threads: usize,
    /// Bytes for points, in all stores together.
    pub(in crate::grid) memory: u64,
    /// The point cloud; only the bounds of its parts are used.
    pub(in crate::grid) points: &'a dyn PointSource,
    /// The part to read, if not all, with statistics of the whole point cloud.
    pub(in crate::grid) part: Option<(CellSurroundings, &'a CloudOverview)>,
    pub(in crate::grid) progress: &'a dyn Progress,
    pub(in crate::grid) cancel: &'a Cancel,
}

pub(super) fn too_little(what: &str, least: u64, memory: u64, other: &str) -> Error {
    let [mib, memory] = [least.div_ceil(1 << 20), memory >> 20];
    let message = format!("{what} needs {mib} MiB of memory, {memory} MiB are allowed");
    short(message, least).or(other)
}

/// All classes except noise.
pub(super) fn no_noise() -> Vec<u8> {
    (0..=u8::MAX).filter(|class| !NOISE.contains(class)).collect()
}

impl SurfaceModelContext<'_> {
    /// The classes of ground.
    pub(super) fn classes(&self) -> Vec<u8> {
        self.job.cloud.filter.classes.clone().unwrap_or_else(|| vec![GROUND])
    }

    /// The window of first returns; `None` for all.
    pub(super) fn surface_window(&self) -> Option<SiteWindow> {
        self.part.map(|(near, _)| near.window())
    }

    /// The window of the ground: for layers, under all first returns.
    pub(super) fn ground_window(&self) -> Option<SiteWindow> {
        let is_layered = self.job.canopy.algorithm() == CanopyAlgorithm::PitFree;
        let is_all = self.job.preset == Some(SurfaceModel::Dtm) || !is_layered;
        self.part.map(|(near, _)| if is_all { near.window() } else { near.beyond() })
    }

    /// The points of these classes and returns in a window, or all; `memory` bytes of them in memory.
    pub(super) fn read(
        &self,
        classes: Vec<u8>,
        returns: Option<Return>,
        within: Option<SiteWindow>,
        memory: u64,
    ) -> Result<PointStore> {
        let source = self.source(classes, returns)?;
        let filling = PointStoreSetup { within, memory, ..self.filling() };
        PointStore::fill(&*source, tiling(source.info()), &filling)
    }

    /// Summaries of the tiles of all these points, and their hull; also calls `also` with the points.
    pub(super) fn outlined(
        &self,
        classes: Vec<u8>,
        returns: Option<Return>,
        also: &(dyn Fn(&[Point]) + Sync),
    ) -> Result<PointStore> {
        let source = self.source(classes, returns)?;
        let store = self.store(&tiling(source.info())).outline();
        store.filled_and(&*source, &self.filling(), &|batch| {
            also(batch);
            Ok(())
        })
    }

    /// Approximate pulse spacing of the whole point cloud, in metres.
    pub(super) fn pulses(&self, metres: &MetricFrame) -> Result<f64> {
        match self.part {
            Some((_, seen)) => Ok(seen.first),
            None => {
                let first = self.outlined(no_noise(), Some(Return::First), &|_| ())?;
                Ok(spacing(&[&first], metres))
            }
        }
    }

    pub(super) fn source(
        &self,
        classes: Vec<u8>,
        returns: Option<Return>,
    ) -> Result<Box<dyn PointSource>> {
        let filter = CloudFilter { classes: Some(classes), returns, ..self.reading.filter.clone() };
        cloud::source(&self.job.input, &CloudOpenOptions { filter, ..self.reading.clone() })
    }

    pub(super) fn filling(&self) -> PointStoreSetup<'_> {
        PointStoreSetup {
            threads: self.threads,
            memory: self.store_memory(),
            folder: self.folder(),
            within: None,
            progress: self.progress,
            cancel: self.cancel,
        }
    }

    /// A store of the points in a window, with the hull of all such points, if known.
    pub(super) fn limited(
        &self,
        store: PointStore,
        window: Option<SiteWindow>,
        around: &[Point],
    ) -> Result<PointStore> {
        let Some(window) = window else { return Ok(store) };
        store.add(around)?;
        let limits = match around {
            [] => PointStoreCoverage::new(self.points, window),
            _ => PointStoreCoverage::with_hull(self.points, window),
        };
        Ok(store.limited(Some(limits)))
    }

    /// A store without points.
    pub(super) fn store(&self, tiling: &Tiling) -> PointStore {
        PointStore::empty(*tiling, self.folder(), self.store_memory())
    }

    pub(super) fn store_memory(&self) -> u64 {
        self.memory / STORES
    }

    pub(super) fn folder(&self) -> &Path {
        self.job.spill_folder()
    }

    /// Whether the ground has to be searched among all returns because return numbers are not reliable: some
    /// points are not last returns, but none is a second one. The last returns were read before.
    pub(super) fn all_returns(&self, last: &PointStore) -> Result<bool> {
        if let Some((_, seen)) = &self.part {
            return Ok(seen.all_returns);
        }
        if last.census().filtered == 0 {
            return Ok(false);
        }
        let second = self.source(no_noise(), Some(Return::Number(2)))?;
        for part in 0..second.parts() {
            if second.positions(part, &mut |_| Ok(()))?.kept > 0 {
                return Ok(false);
            }
            self.cancel.check()?;
        }
        Ok(true)
    }
}
