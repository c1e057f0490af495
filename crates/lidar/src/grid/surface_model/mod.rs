//! Terrain models: the ground, by class or by a method; the pit-free surface of first returns; and its height
//! above ground.
//!
//! Each has its own stores: ground points by class, or the candidates of a method, tile by tile with its reach
//! as a halo; first returns, and another store of those above each height threshold. Triangles of a higher
//! layer have short edges, so they are triangles of the nearby points: long ones are dropped without checking
//! the reach of their circles. A spike-free surface is computed from all returns instead, and defined on tiles.

mod context;
pub(crate) mod filter;
mod first_returns;
pub(super) mod kinds;
pub(crate) mod lengths;
mod notes;
mod pit_free;
mod scan;
mod scan_result;
mod spike_free;
mod tiles;

use super::budget::GridBudget;
use super::extent::CellRequest;
use super::job::GridJob;
use super::neighbours::{CloudSurfaces, more_is_needed, tiling};
use crate::point_index::{PointStore, PointStoreSetup};
pub(super) use context::SurfaceModelContext;
use context::{no_noise, too_little};
pub(crate) use filter::{GroundFilter, GroundSearchMemory, around, square_bytes};
use first_returns::CanopySurface;
pub(crate) use kinds::{GROUND, NOISE};
pub use kinds::{GroundFrom, SurfaceModel};
pub(crate) use lengths::MetricFrame;
pub(crate) use notes::{found_by, no_ground, no_ground_of_class};
use notes::{found_in_classes, frozen, named, not_of_class};
use pit_free::PitFreeLayers;
pub(crate) use scan_result::CloudOverview;
use spike_free::BySquare;
use terrane_base::error::Result;
use terrane_cloud::{CloudInfo, Return, ReturnCounts};
use terrane_engine::skip_bad::LostPoints;
use terrane_gridding::Statistic;
use terrane_gridding::canopy::CanopyAlgorithm;
use tiles::{SpikeFreeTally, SpikeFreeTiles};

/// A terrain model with all its points.
pub(super) struct PreparedSurfaceModel {
    preset: SurfaceModel,
    ground: Option<CloudSurfaces>,
    top: Option<Box<dyn CanopySurface>>,
    /// Statistics of the points of its surface.
    pub(super) census: ReturnCounts,
    /// Files with skipped damage.
    pub(super) losses: LostPoints,
    /// Notes on the points used.
    pub(super) notes: Vec<String>,
    spilled: u64,
}

impl PreparedSurfaceModel {
    /// Reads the points of the model.
    pub(super) fn new(
        preset: SurfaceModel,
        cloud: &CloudInfo,
        context: &SurfaceModelContext<'_>,
    ) -> Result<Self> {
        let empty = Self {
            preset,
            ground: None,
            top: None,
            census: ReturnCounts::default(),
            losses: LostPoints::default(),
            notes: Vec::new(),
            spilled: 0,
        };
        let mut model = match context.job.needs_ground() {
            true => empty.with_ground(cloud, context)?,
            false => empty,
        };
        if preset != SurfaceModel::Dsm && model.ground.is_none() {
            return Err(no_ground());
        }
        if preset != SurfaceModel::Dtm {
            match context.job.canopy.algorithm() {
                CanopyAlgorithm::PitFree => model.add_layers(cloud, context)?,
                CanopyAlgorithm::SpikeFree { freeze, buffer } => {
                    model.add_squares(cloud, freeze, buffer, context)?;
                }
            }
        }
        Ok(model)
    }

    /// Finds the ground, if there is any.
    fn with_ground(mut self, cloud: &CloudInfo, context: &SurfaceModelContext<'_>) -> Result<Self> {
        if context.job.ground.is_method() || context.part.is_some_and(|(_, seen)| !seen.by_class) {
            return self.filter_ground(cloud, context);
        }
        let (classes, window) = (context.classes(), context.ground_window());
        let store = context.read(classes.clone(), None, window, context.store_memory())?;
        let count = store.count();
        self.take_note(&store);
        if count > 0 || window.is_some() {
            self.notes.push(found_in_classes(count, &classes));
            let around = context.part.map(|(_, seen)| seen.around_ground()).unwrap_or_default();
            let store = context.limited(store, window, &around)?;
            self.ground = Some(CloudSurfaces::new(store, cloud.frame)?);
            return Ok(self);
        }
        if context.job.ground == GroundFrom::Class {
            return Err(not_of_class(&named(&classes)));
        }
        self.filter_ground(cloud, context)
    }

    fn filter_ground(
        mut self,
        cloud: &CloudInfo,
        context: &SurfaceModelContext<'_>,
    ) -> Result<Self> {
        let metres = self.metres(cloud)?;
        let method = context.job.ground.method();
        let part = context.ground_window().zip(context.part.map(|(_, seen)| seen.last));
        let wide = part.map(|(window, spacing)| around(&method, &metres, spacing, window));
        let (tile, threads) = (square_bytes(&method, metres.extent(cloud.bounds)), context.threads);
        if GroundSearchMemory::least(tile) > context.memory {
            let what = format!("finding the ground by {}", method.name());
            let memory = context.job.resources.memory;
            return Err(too_little(&what, min_for(tile), memory, "‹ground› pmf"));
        }
        // Two stores: the candidates and the ground. That of the surface is filled later.
        let GroundSearchMemory { tiles, store } =
            GroundSearchMemory::divide(context.memory, 2, tile, threads);
        let memory = store.min(context.store_memory());
        let mut candidates = context.read(no_noise(), Some(Return::Last), wide, memory)?;
        let all_returns = context.all_returns(&candidates)?;
        if all_returns {
            candidates = context.read(no_noise(), None, wide, memory)?;
        }
        self.take_note(&candidates);
        let stores = vec![&candidates];
        let filter = match part {
            None => GroundFilter::new(stores, &metres, method, tiles, threads),
            Some((window, spacing)) => {
                GroundFilter::within(window, spacing, stores, &metres, method, tiles, threads)
            }
        };
        let store = PointStore::empty(*candidates.tiling(), context.folder(), memory);
        filter.run(&store, context.progress, context.cancel)?;
        let (found, all) = (store.count(), candidates.count());
        let points = if all_returns { "points" } else { "last returns" };
        self.notes.push(found_by(&method, found, all, points));
        self.spilled += candidates.spilled();
        if found > 0 || part.is_some() {
            let store = context.limited(store, context.ground_window(), &[])?;
            self.ground = Some(CloudSurfaces::new(store, cloud.frame)?);
        }
        Ok(self)
    }

    fn add_layers(&mut self, cloud: &CloudInfo, context: &SurfaceModelContext<'_>) -> Result<()> {
        let metres = self.metres(cloud)?;
        let window = context.surface_window();
        let memory = context.store_memory();
        let first = context.read(no_noise(), Some(Return::First), window, memory)?;
        self.take_note(&first);
        self.notes.push(format!("surface: {} first returns", first.count()));
        let around = context.part.map(|(_, seen)| seen.around_surface()).unwrap_or_default();
        let first = context.limited(first, window, &around)?;
        if self.ground.is_none() {
            let note = "no ground found: the surface has all first returns and keeps its pits";
            self.notes.push(note.to_owned());
        }
        let ground = self.ground.as_ref();
        let layers = PitFreeLayers::new(first, ground, &metres, cloud.frame, context)?;
        self.top = Some(Box::new(layers));
        Ok(())
    }

    fn add_squares(
        &mut self,
        cloud: &CloudInfo,
        freeze: Option<f64>,
        buffer: f64,
        context: &SurfaceModelContext<'_>,
    ) -> Result<()> {
        let metres = self.metres(cloud)?;
        let spacing = context.pulses(&metres)?;
        let tally = SpikeFreeTally::new(SpikeFreeTiles::new(spacing, freeze, buffer, &metres));
        let source = context.source(no_noise(), None)?;
        let window = context.surface_window();
        let filling = PointStoreSetup { within: window, ..context.filling() };
        let store = context.store(&tiling(source.info()));
        let all = store.filled_and(&*source, &filling, &|batch| {
            tally.take(batch);
            Ok(())
        })?;
        self.take_note(&all);
        self.notes.push(frozen(all.count(), &tally.squares));
        let around = context.part.map(|(_, seen)| seen.around_surface()).unwrap_or_default();
        let all = context.limited(all, window, &around)?;
        let top = BySquare::new(all, tally, cloud.frame, context)?;
        self.top = Some(Box::new(top));
        Ok(())
    }

    /// Records the statistics of the last points read.
    fn take_note(&mut self, read: &PointStore) {
        self.census = *read.census();
        self.losses.add(read.losses());
    }

    /// Steps in metres; adds a note once if the unit is assumed.
    fn metres(&mut self, cloud: &CloudInfo) -> Result<MetricFrame> {
        let metres = MetricFrame::of(&cloud.crs, &cloud.frame)?;
        if metres.is_guess && !self.notes.iter().any(|note| note == MetricFrame::GUESS) {
            self.notes.push(MetricFrame::GUESS.to_owned());
        }
        Ok(metres)
    }

    /// Its values at the centres of cells, NaN where void.
    pub(super) fn values(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()> {
        if self.is_exceeded() {
            return Err(more_is_needed());
        }
        if let Some(top) = &self.top {
            top.values(piece, out)?;
        }
        let Some(ground) = self.ground.as_ref().filter(|_| self.preset != SurfaceModel::Dsm) else {
            return Ok(());
        };
        let linear = Statistic::linear(None);
        if self.preset == SurfaceModel::Dtm {
            return ground.values(linear, piece, out);
        }
        let mut below = vec![0.0; out.len()];
        ground.values(linear, piece, &mut below)?;
        for (top, below) in out.iter_mut().zip(below) {
            // Void where either is: a maximum would make that 0.
            *top -= below;
            *top = if *top < 0.0 { 0.0 } else { *top };
        }
        Ok(())
    }

    /// True if unread points were needed.
    pub(super) fn is_exceeded(&self) -> bool {
        let ground = self.ground.as_ref().is_some_and(|ground| ground.store().is_exceeded());
        ground || self.top.as_ref().is_some_and(|top| top.is_exceeded())
    }

    /// Bytes that went to temporary files.
    pub(super) fn spilled_bytes(&self) -> u64 {
        let ground = self.ground.as_ref().map_or(0, CloudSurfaces::spilled_bytes);
        self.spilled + ground + self.top.as_ref().map_or(0, |top| top.spilled())
    }
}

/// Least memory of a job for its ground method, or for a tile of its surface; 0 if unknown before the points
/// are read.
pub(super) fn min_memory(job: &GridJob, cloud: &CloudInfo, seen: Option<&CloudOverview>) -> u64 {
    let freezes = job.preset.is_some() && job.canopy.algorithm() != CanopyAlgorithm::PitFree;
    let usual = if freezes { cloud.count.min(spike_free::USUAL) } else { 0 };
    let surface = spike_free::min_memory(seen.map_or(usual, |seen| seen.square));
    surface.max(min_for_ground(job, cloud, seen))
}

fn min_for_ground(job: &GridJob, cloud: &CloudInfo, seen: Option<&CloudOverview>) -> u64 {
    let is_found = job.ground.is_method() || seen.is_some_and(|seen| !seen.by_class);
    if !job.needs_ground() || !is_found {
        return 0;
    }
    let method = job.ground.method();
    let extent =
        MetricFrame::of(&cloud.crs, &cloud.frame).map(|metres| metres.extent(cloud.bounds));
    extent.map_or(0, |extent| min_for(square_bytes(&method, extent)))
}

/// Least memory of a job for a tile of a ground method.
fn min_for(tile: u64) -> u64 {
    GridBudget::with_points(GroundSearchMemory::least(tile))
}
