//! A scan of the whole point cloud, for models of its parts.

use super::context::{SurfaceModelContext, no_noise};
use super::filter::spacing;
use super::kinds::{GroundFrom, SurfaceModel};
use super::lengths::MetricFrame;
use super::notes::{frozen, named, no_ground, not_of_class};
use super::scan_result::{CloudOverview, places};
use super::tiles::{SpikeFreeTally, SpikeFreeTiles};
use terrane_base::error::Result;
use terrane_base::geom::REACH;
use terrane_cloud::{CloudInfo, Return};
use terrane_gridding::canopy::CanopyAlgorithm;
use terrane_gridding::pitfree::PitFree;

impl CloudOverview {
    /// Reads all points of a model once.
    ///
    /// # Errors
    /// No ground if it is required; coordinates without a unit of length.
    pub(in crate::grid) fn scan(
        preset: SurfaceModel,
        cloud: &CloudInfo,
        context: &SurfaceModelContext<'_>,
    ) -> Result<Self> {
        let mut seen = Self::default();
        if context.job.needs_ground() {
            seen.scan_ground(preset, cloud, context)?;
        }
        if preset != SurfaceModel::Dtm {
            seen.scan_surface(cloud, context)?;
        }
        Ok(seen)
    }

    fn scan_ground(
        &mut self,
        preset: SurfaceModel,
        cloud: &CloudInfo,
        context: &SurfaceModelContext<'_>,
    ) -> Result<()> {
        self.scan_classes(context)?;
        if self.by_class {
            return Ok(());
        }
        let mut last = context.outlined(no_noise(), Some(Return::Last), &|_| ())?;
        self.all_returns = context.all_returns(&last)?;
        if self.all_returns {
            last = context.outlined(no_noise(), None, &|_| ())?;
        }
        if last.count() == 0 && preset != SurfaceModel::Dsm {
            return Err(no_ground());
        }
        self.add_candidates(&[&last], cloud, context.job.ground)
    }

    fn scan_surface(&mut self, cloud: &CloudInfo, context: &SurfaceModelContext<'_>) -> Result<()> {
        let metres = MetricFrame::of(&cloud.crs, &cloud.frame)?;
        let first = context.outlined(no_noise(), Some(Return::First), &|_| ())?;
        self.first = spacing(&[&first], &metres);
        let CanopyAlgorithm::SpikeFree { freeze, buffer } = context.job.canopy.algorithm() else {
            self.reach = reach(self.first, &metres);
            self.surface = places(&first.hull()?);
            self.notes.push(format!("surface: {} first returns", first.count()));
            return Ok(());
        };
        let tally = SpikeFreeTally::new(SpikeFreeTiles::new(self.first, freeze, buffer, &metres));
        let all = context.outlined(no_noise(), None, &|batch| tally.take(batch))?;
        self.reach = tally.squares.reach();
        self.surface = places(&all.hull()?);
        self.notes.push(frozen(all.count(), &tally.squares));
        self.square = tally.counts().into_values().max().unwrap_or(0);
        Ok(())
    }

    fn scan_classes(&mut self, context: &SurfaceModelContext<'_>) -> Result<()> {
        if context.job.ground.is_method() {
            return Ok(());
        }
        let classes = context.classes();
        let ground = context.outlined(classes.clone(), None, &|_| ())?;
        if ground.count() == 0 && context.job.ground == GroundFrom::Class {
            return Err(not_of_class(&named(&classes)));
        }
        self.add_classes(&ground, &classes)
    }
}

/// Steps along the longest edge above the first triangulation, for this point spacing.
fn reach(spacing: f64, metres: &MetricFrame) -> i32 {
    let [x, y, _] = metres.step;
    (PitFree::metres(spacing).max_edge() / x.min(y)).ceil().min(f64::from(REACH)) as i32
}
