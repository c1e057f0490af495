//! The points that the ground may come from, if these differ from the requested points.

use super::HeightQuery;
use super::ground_search::{GroundHeightSearch, STORES};
use super::queries::HeightsAs;
use crate::grid::surface_model::{CloudOverview, GroundSearchMemory, MetricFrame, around};
use crate::points::context::TranslateContext;
use crate::points::input_records::InputRecords;
use crate::points::job::TranslateJob;
use crate::points::stages::noise::ClassifyNoise;
use crate::points::stages::noise::noise_index::Noise;
use crate::points::stages::{PointSetEffect, StageContext, StageOutput};
use crate::points::tile_subset::TileSubset;
use crate::records::PointRecords;
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::{
    CloudFilter, CloudInfo, CloudOpenOptions, LasOutputFormat, NewDimension, NewDimensionValue,
    PointCloud, PointFormatConverter,
};
use terrane_delaunay::SiteWindow;

/// The dimension of heights above ground, as other programs name it.
const HEIGHTS: &str = "HeightAboveGround";

/// The dimension of heights above ground.
pub(super) fn height_dimension() -> NewDimension {
    NewDimension::new(HEIGHTS, "Height above ground", NewDimensionValue::HeightSteps)
}

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
        let is_same = !Self::is_filtered(chosen);
        if is_same && !is_part {
            return Ok(None);
        }
        let filter =
            CloudFilter { classes: None, returns: None, condition: None, ..options.filter };
        let cloud = terrane_cloud::open(&job.input, &CloudOpenOptions { filter, ..options })?;
        Ok(Some(Self { cloud, target: job.target()?, is_same }))
    }

    /// Whether a filter keeps points from the output that may be ground.
    pub(in crate::points) fn is_filtered(filter: &CloudFilter) -> bool {
        filter.classes.is_some() || filter.returns.is_some() || filter.condition.is_some()
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
    ) -> Result<StageOutput<'r>> {
        let work = around.work;
        let (info, shift) = method_frame(around);
        let search = self.search(around, &info, shift);
        let heights_at = match self.heights {
            Some(HeightsAs::Dimension) => work.converter.added_at(HEIGHTS),
            _ => None,
        };
        // The ground is searched among more points than the requested ones unless a stage before has chosen some.
        let input = match around.is_selected() {
            true => None,
            false => GroundInput::open(work.job, work.subset.is_some())?,
        };
        let Some(input) = input else { return search.annotate(records, None, heights_at) };
        let converter = input.converter(work.job)?;
        let noise = work.subset.and_then(TileSubset::noise).map(Noise::of_ground);
        let all =
            InputRecords::within(&input.cloud, &converter, self.around_ground(work)?).with(noise);
        // Of more classes, all duplicates may be ground.
        let is_wanted = match input.is_same {
            true => |effect| effect != PointSetEffect::Reorders,
            false => |effect| effect == PointSetEffect::Unchanged,
        };
        around.run_before(is_wanted, &all, |all| search.annotate(records, Some(all), heights_at))
    }

    /// Statistics of the ground for a plan: among `input`, with its noise recorded, or among `records`.
    pub(in crate::points) fn scan(
        &self,
        records: &dyn PointRecords,
        around: &StageContext<'_>,
        input: Option<&GroundInput>,
        known: Option<(&ClassifyNoise, StageContext<'_>, &mut Noise)>,
    ) -> Result<CloudOverview> {
        let (info, shift) = method_frame(around);
        let search = self.search(around, &info, shift);
        let Some(input) = input else { return search.scan(records) };
        let converter = input.converter(around.work.job)?;
        let all = InputRecords::within(&input.cloud, &converter, None);
        let Some((stage, context, noise)) = known else { return search.scan(&all) };
        let marks = stage.mark(&all, &context)?;
        noise.ground = Some(marks.noted(None)?);
        search.scan(&marks.records())
    }

    fn search<'a>(
        &'a self,
        around: &StageContext<'a>,
        info: &'a CloudInfo,
        shift: [i32; 3],
    ) -> GroundHeightSearch<'a> {
        let (work, shares) = (around.work, &around.work.shares);
        let (tile, threads) = (self.square(info), shares.threads);
        GroundHeightSearch {
            above: self,
            info,
            shift,
            format: work.converter.format(),
            flow: shares.flow,
            threads,
            memory: GroundSearchMemory::divide(around.memory(), STORES, tile, threads),
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

/// Frame, bounds and CRS that the methods work in, and the offset of records in steps: those of the cloud along axes that
/// no stage has changed.
fn method_frame(around: &StageContext<'_>) -> (CloudInfo, [i32; 3]) {
    let (cloud, input) = (around.work.cloud, around.work.converter.info());
    let (mut info, mut shift) = (around.info.clone(), [0; 3]);
    let axis_of = |frame: &PointFrame, axis: usize| (frame.scale[axis], frame.offset[axis]);
    let is_kept = |axis| axis_of(&around.info.frame, axis) == axis_of(&input.frame, axis);
    let is_moved = !(is_kept(0) && is_kept(1))
        || around.info.crs.horizontal_unit() != input.crs.horizontal_unit();
    if is_moved {
        return (info, shift);
    }
    for axis in (0..3).filter(|axis| is_kept(*axis)) {
        info.frame.offset[axis] = cloud.frame.offset[axis];
        shift[axis] = around.work.converter.shift()[axis];
    }
    info.bounds = info.bounds.map(|ends| {
        ends.map(|Point { x, y, z }| Point {
            x: x.wrapping_sub(shift[0]),
            y: y.wrapping_sub(shift[1]),
            z: z.wrapping_sub(shift[2]),
        })
    });
    (info, shift)
}
