//! The points that the ground may come from, if these differ from the requested points.

use super::HeightQuery;
use super::ground_search::GroundHeightSearch;
use super::queries::HeightsAs;
use super::results::AnnotatedRecords;
use crate::grid::surface_model::{CloudOverview, MetricFrame, around};
use crate::points::context::TranslateContext;
use crate::points::input_records::InputRecords;
use crate::points::job::TranslateJob;
use crate::points::stages::StageContext;
use crate::points::stages::noise::ClassifyNoise;
use crate::points::stages::noise::noise_index::Noise;
use crate::points::tile_subset::TileSubset;
use crate::records::{PointRecords, over};
use terrane_base::error::Result;
use terrane_cloud::{
    CloudFilter, CloudOpenOptions, LasOutputFormat, NewDimension, NewDimensionValue, PointCloud,
    PointFormatConverter,
};
use terrane_delaunay::SiteWindow;

/// The dimension of heights above ground, as other programs name it.
pub(super) const HEIGHTS: NewDimension = NewDimension {
    name: "HeightAboveGround",
    about: "Height above ground",
    value: NewDimensionValue::HeightSteps,
};

/// A point cloud with more than the requested points.
pub(in crate::points) struct GroundInput {
    cloud: PointCloud,
    target: LasOutputFormat,
    /// Whether it has the requested points only, for work on a subset of tiles.
    is_same: bool,
}

impl GroundInput {
    /// All points of a job that the ground may come from, if these are not the requested ones, or a part of them.
    ///
    /// # Errors
    /// Those of [`terrane_cloud::open`].
    pub(in crate::points) fn open(job: &TranslateJob, is_part: bool) -> Result<Option<Self>> {
        let options = job.reading();
        let chosen = &options.filter;
        let is_same =
            chosen.classes.is_none() && chosen.returns.is_none() && chosen.condition.is_none();
        if is_same && !is_part {
            return Ok(None);
        }
        let filter =
            CloudFilter { classes: None, returns: None, condition: None, ..options.filter };
        let cloud = terrane_cloud::open(&job.input, &CloudOpenOptions { filter, ..options })?;
        Ok(Some(Self { cloud, target: job.target()?, is_same }))
    }

    fn converter(&self, job: &TranslateJob) -> Result<PointFormatConverter<'_>> {
        PointFormatConverter::new(&self.cloud, self.target, &job.dimensions())
    }
}

impl HeightQuery {
    /// The records with heights and classes.
    pub(super) fn annotate<'r>(
        &self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<AnnotatedRecords<'r>> {
        let (work, search) = (around.work, self.search(around));
        let heights_at = match self.heights {
            Some(HeightsAs::Dimension) => work.converter.added_at(HEIGHTS.name),
            _ => None,
        };
        let Some(input) = GroundInput::open(work.job, work.subset.is_some())? else {
            return search.annotate(records, None, heights_at);
        };
        let converter = input.converter(work.job)?;
        let noise = work.subset.and_then(TileSubset::noise).map(Noise::of_ground);
        let all =
            InputRecords::within(&input.cloud, &converter, self.around_ground(work)?).with(noise);
        around
            .run_before(input.is_same, &all, |all| search.annotate(records, Some(all), heights_at))
    }

    /// Statistics of the ground for a plan: among `input`, with its noise recorded, or among `records`.
    pub(in crate::points) fn scan(
        &self,
        records: &dyn PointRecords,
        around: &StageContext<'_>,
        input: Option<&GroundInput>,
        known: Option<(&ClassifyNoise, StageContext<'_>, &mut Noise)>,
    ) -> Result<CloudOverview> {
        let search = self.search(around);
        let Some(input) = input else { return search.scan(records) };
        let converter = input.converter(around.work.job)?;
        let all = InputRecords::within(&input.cloud, &converter, None);
        let marked = match known {
            Some((stage, context, noise)) => {
                let marked = stage.mark(&all, &context)?;
                noise.ground = Some(marked.noted(None)?);
                Some(marked)
            }
            None => None,
        };
        search.scan(over(&marked, &all))
    }

    fn search<'a>(&'a self, around: &StageContext<'a>) -> GroundHeightSearch<'a> {
        let (work, shares) = (around.work, &around.work.shares);
        // The methods work in the frame of the cloud, until a stage changes it.
        let is_input = around.info.frame == work.converter.info().frame;
        let (info, shift) = match is_input {
            true => (work.cloud, work.converter.shift()),
            false => (around.info, [0; 3]),
        };
        let square = self.square(info);
        GroundHeightSearch {
            above: self,
            info,
            shift,
            format: work.converter.format(),
            flow: shares.flow,
            threads: shares.threads,
            memory: shares.marks.saturating_sub(square),
            square,
            folder: work.folder(),
            keeps_withheld: work.job.cloud.filter.keep_withheld,
            subset: work.subset,
            at: work.at,
        }
    }

    /// The window of the points of the ground of the tiles, if not everywhere.
    fn around_ground(&self, work: &TranslateContext<'_>) -> Result<Option<SiteWindow>> {
        let Some(subset) = work.subset else { return Ok(None) };
        let Some(seen) = subset.knowledge.seen.as_ref().filter(|seen| !seen.by_class) else {
            return Ok(Some(subset.ground()));
        };
        let metres = MetricFrame::of(&work.cloud.crs, &work.cloud.frame)?;
        Ok(Some(around(&self.from.method(), &metres, seen.last, subset.ground())))
    }
}
