//! An open grid, and the division of its work.

use std::path::PathBuf;

use super::division::{REGION, TilesDivision};
use super::georeference::{self, GridFootprint, HeightReference};
use super::job::{TilesJob, check_formats};
use super::mask::TileWaterMask;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::plan;
use terrane_globe::{
    DEEPEST, GatheredOverview, GridGeolocation, GridOverview, HeightPatch, OverviewPlan,
    SampleBlocks, deepest_for,
};
use terrane_raster::GridSource;

/// Largest magnitude of a height in metres.
const MAX_HEIGHT: f64 = 1e6;
/// Margin of samples around a region, for slopes.
pub(super) const APRON: u32 = 10;

/// An open grid with its division of work.
pub(super) struct OpenedTilesGrid {
    pub(super) job: TilesJob,
    pub(super) grid: Box<dyn GridSource>,
    pub(super) shares: MemoryShares,
    pub(super) heights: HeightReference,
    /// Water, for water masks.
    pub(super) mask: Option<TileWaterMask>,
    pub(super) division: TilesDivision,
    /// Plan of the first pass.
    pub(super) survey: OverviewPlan,
}

/// Largest number of samples of a region with its margin; twice as many for a bent grid, whose rows may cross
/// it.
pub(super) fn max_samples(chart: &GridGeolocation) -> u64 {
    let side = REGION as u64 + 2 * APRON as u64 + 4;
    if chart.is_bent() { 2 * side * side } else { side * side }
}

/// Memory in bytes of a worker for near or far levels: two samples of each block with their points, and a row
/// of blocks.
pub(super) fn worker_bytes(plan: &OverviewPlan) -> u64 {
    /// Two points in a list that grows, and the place of the next of each.
    const BLOCK: u64 = 2 * (2 * 12 + 4);
    let SampleBlocks { side, counts, .. } = plan.blocks;
    let blocks = counts.map(u64::from).iter().product::<u64>();
    let row = u64::from(plan.chart().size()[0]) * u64::from(side) * 8;
    near_bytes(plan.chart()).max((8 << 20) + blocks * BLOCK + row)
}

/// Memory in bytes of a worker for near levels: the samples of a region, and the points of a tile with their
/// data.
fn near_bytes(chart: &GridGeolocation) -> u64 {
    let place = if chart.is_bent() { HeightPatch::PLACE_BYTES } else { 0 };
    max_samples(chart) * (8 + place) + (24 << 20)
}

impl OpenedTilesGrid {
    pub(super) fn new(job: &TilesJob) -> Result<Self> {
        if let Some(level) = job.tiles.max_level.filter(|level| *level > DEEPEST) {
            return Err(Error::usage(format!(
                "‹max_level› {level} exceeds the limit of {DEEPEST}"
            ))
            .remedy(format!("pass {DEEPEST} or less")));
        }
        check_formats(&job.tiles)?;
        let options = job.reading.options(&job.resources, 0)?;
        let preview = memory::open_for_estimate(&job.input, &options)?;
        let (geoid, resources) = (job.tiles.geoid.as_deref(), &job.resources);
        let (chart, heights) = georeference::of(preview.info(), &job.input, geoid, resources)?;
        let chart = chart.sloping(job.tiles.beyond.slope());
        let last = job.tiles.max_level.unwrap_or_else(|| deepest_for(chart.spacing()));
        let water = options.water.as_ref().filter(|_| job.tiles.water_mask);
        let mask = water.map(|water| TileWaterMask::of(water, preview.info(), last, resources));
        let mask = mask.transpose()?;
        let division = TilesDivision::new(GridFootprint::of(&chart), last);
        let [meridians, parallels] = division.lines();
        let survey = OverviewPlan::new(chart, [&meridians, &parallels]);
        let [shared, each] = mask.as_ref().map_or([0; 2], |mask| mask.bytes(resources.threads));
        let fixed_bytes = memory::with_slack(survey.bytes() + heights.lift.bytes() + shared);
        let worker = worker_bytes(&survey) + each;
        let (grid, shares) =
            memory::open_beside(fixed_bytes, &job.input, &options, &job.resources, worker)?;
        Ok(Self { job: job.clone(), grid, shares, heights, mask, division, survey })
    }

    /// Reads heights in metres.
    pub(super) fn read(&self, rect: Rect, heights: &mut Vec<f64>) -> Result<()> {
        heights.clear();
        heights.resize(rect.len(), 0.0);
        self.grid.read_f64(rect, heights)?;
        let width = rect.width as usize;
        self.heights.lift.lift(heights, |number| {
            let [col, row] = [number % width, number / width].map(|at| at as f64);
            let [first, top] = [rect.col, rect.row].map(f64::from);
            Ok(self.survey.chart().place([first + col, top + row]))
        })
    }

    /// Input files.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let Self { job, grid, .. } = self;
        let geoid = job.tiles.geoid.iter().map(PathBuf::from);
        plan::grid_files(&job.input, &job.reading, &**grid).into_iter().chain(geoid).collect()
    }

    /// Name of the grid.
    pub(super) fn name(&self) -> PathBuf {
        PathBuf::from(self.job.input.to_string())
    }

    /// Overview of the grid.
    ///
    /// # Errors
    /// A grid without valid samples, or with heights out of range.
    pub(super) fn overview(&self, gathered: GatheredOverview) -> Result<GridOverview> {
        let overview = gathered.finish().ok_or_else(|| {
            Error::bad_input("the grid has no valid sample")
                .in_file(&self.name())
                .remedy("check its nodata value, or choose another ‹band›")
        })?;
        let [lowest, highest] = overview.range;
        let furthest = if lowest < -MAX_HEIGHT { lowest } else { highest };
        if furthest.abs() > MAX_HEIGHT {
            // Converted to the stored type, to report the digits of the file.
            let stored = (furthest / self.heights.lift.metres) as f32;
            return Err(Error::bad_input(format!("height {stored:e} is out of range"))
                .in_file(&self.name())
                .remedy(format!("if it is nodata, pass ‹nodata› {stored:e}")));
        }
        Ok(overview)
    }
}
