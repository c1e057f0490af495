//! The points of the ground, if these differ from the requested points.

use super::context::TranslateContext;
use super::height_above_ground::results::AnnotatedRecords;
use super::input_records::InputRecords;
use super::job::TranslateJob;
use super::noise::noise_index::Noise;
use super::tile_subset::TileSubset;
use crate::grid::surface_model::{CloudOverview, MetricFrame, around};
use crate::records::{PointRecords, over};
use terrane_base::error::Result;
use terrane_cloud::{
    CloudFilter, CloudOpenOptions, LasOutputFormat, PointCloud, PointFormatConverter,
};
use terrane_delaunay::SiteWindow;

/// A point cloud with more than the requested points.
pub(super) struct GroundInput {
    cloud: PointCloud,
    target: LasOutputFormat,
    /// Whether it has the requested points only, for work on a subset of tiles.
    is_same: bool,
}

impl TranslateJob {
    /// All candidate points of the ground, if these are not the requested ones, or a part of them.
    pub(super) fn ground_input(&self, is_part: bool) -> Result<Option<GroundInput>> {
        let options = self.reading();
        let chosen = &options.filter;
        let is_same =
            chosen.classes.is_none() && chosen.returns.is_none() && chosen.condition.is_none();
        if (is_same && !is_part) || !self.above.is_requested() {
            return Ok(None);
        }
        let filter =
            CloudFilter { classes: None, returns: None, condition: None, ..options.filter };
        let cloud = terrane_cloud::open(&self.input, &CloudOpenOptions { filter, ..options })?;
        Ok(Some(GroundInput { cloud, target: self.target()?, is_same }))
    }
}

impl TranslateContext<'_> {
    /// The records with heights and classes.
    pub(super) fn annotate<'r>(
        &self,
        records: &'r dyn PointRecords,
        ground_input: Option<&GroundInput>,
    ) -> Result<AnnotatedRecords<'r>> {
        let search = self.ground_search();
        let heights_at = self.converter.heights_at();
        let Some(GroundInput { cloud, target, is_same }) = ground_input else {
            return search.annotate(records, None, heights_at);
        };
        let converter = PointFormatConverter::new(cloud, *target, heights_at.is_some())?;
        let noise = self.subset.and_then(TileSubset::noise).map(Noise::of_ground);
        let all = InputRecords::within(cloud, &converter, self.around_ground()?).with(noise);
        let single = if *is_same { self.single(&all)? } else { None };
        let all = over(&single, &all);
        let marked = self.mark(all)?;
        search.annotate(records, Some(over(&marked, all)), heights_at)
    }

    /// Statistics of the ground of all points, with recorded noise.
    pub(super) fn scan_ground_input(
        &self,
        input: &GroundInput,
        noise: Option<&mut Noise>,
    ) -> Result<CloudOverview> {
        let converter = PointFormatConverter::new(
            &input.cloud,
            input.target,
            self.converter.heights_at().is_some(),
        )?;
        let all = InputRecords::within(&input.cloud, &converter, None);
        let marked = self.mark(&all)?;
        if let Some((noise, marked)) = noise.zip(marked.as_ref()) {
            noise.ground = Some(marked.noted(None)?);
        }
        self.ground_search().scan(over(&marked, &all))
    }

    /// The window of the points of the ground of the tiles, if not everywhere.
    fn around_ground(&self) -> Result<Option<SiteWindow>> {
        let Some(subset) = self.subset else { return Ok(None) };
        let Some(seen) = subset.knowledge.seen.as_ref().filter(|seen| !seen.by_class) else {
            return Ok(Some(subset.ground()));
        };
        let metres = MetricFrame::of(&self.cloud.crs, &self.cloud.frame)?;
        let method = self.job.above.from.method();
        Ok(Some(around(&method, &metres, seen.last, subset.ground())))
    }
}
