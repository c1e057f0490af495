//! The object of one task: a GeoTIFF with the values of a tile's cells.

use std::path::Path;
use std::time::Instant;

use crate::grid::budget::{GridBudget, GridWorkload};
use crate::grid::extent::GridExtent;
use crate::grid::job::GridJob;
use crate::grid::make::{GridMaker, report};
use crate::grid::neighbours;
use crate::grid::region_points::{CellSurroundings, near_steps};
use crate::grid::report::{GridReport, GridStage};
use crate::grid::source::{CellBands, CellSource};
use crate::grid::surface_model::CloudOverview;
use crate::point_index::reach;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_cloud::PointSource;
use terrane_delaunay::SiteWindow;
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_gridding::{LatticeAxis, Statistic, StatisticRecipe, SurfaceInterpolation};
use terrane_raster::write::GridSink;
use terrane_raster::{self as raster, GridSource, SampleType};

/// Values are kept as they were computed, and compressed.
const CREATION: [(&str, &str); 3] = [("COMPRESS", "ZSTD"), ("PREDICTOR", "3"), ("BIGTIFF", "YES")];

/// A plan's cloud and cells, opened.
pub(super) struct OpenedCloudGrid {
    pub(super) job: GridJob,
    pub(super) points: Box<dyn PointSource>,
    pub(super) extent: GridExtent,
    /// Statistics of the whole point cloud for a terrain model.
    pub(super) seen: Option<CloudOverview>,
}

impl OpenedCloudGrid {
    /// Writes the tile of these `cells` to `file` from the points near it, with a wider margin if necessary.
    pub(super) fn make(&self, cells: Rect, file: &Path, at: RunControl<'_>) -> Result<GridReport> {
        let mut near = self.near(cells);
        loop {
            if let Some(made) = self.try_make(cells, file, near, at)? {
                return Ok(made);
            }
            near = near.map(CellSurroundings::wider);
        }
    }

    /// Writes the tile of these `cells` to `file` from the parts `within`; `None` if these do not suffice.
    pub(super) fn try_make(
        &self,
        cells: Rect,
        file: &Path,
        near: Option<CellSurroundings>,
        RunControl { progress, cancel }: RunControl<'_>,
    ) -> Result<Option<GridReport>> {
        let (points, job) = (&*self.points, self.job_of(file));
        let extent = self.extent.part(cells, points.info());
        let seen = self.seen.as_ref();
        GridMaker { points, job: &job, extent, within: near, seen, progress, cancel }.try_make()
    }

    /// The first window to read for the tile of these `cells`; `None` for the whole point cloud.
    pub(super) fn near(&self, cells: Rect) -> Option<CellSurroundings> {
        let extent = self.extent.part(cells, self.points.info());
        let recipe = StatisticRecipe::new(&self.job.stats, &self.job.rules(extent.cell()));
        let cells = self.window(&extent, recipe.reach());
        let margin = self.margin(&recipe, &cells)?;
        Some(CellSurroundings { cells, margin })
    }

    /// The job whose output is a tile's result.
    pub(super) fn job_of(&self, file: &Path) -> GridJob {
        let creation = CREATION.map(|(key, value)| (key.to_owned(), value.to_owned()));
        GridJob {
            output: file.to_path_buf(),
            format: Some("GTiff".to_owned()),
            creation: creation.to_vec(),
            sample_type: SampleType::F64,
            round: false,
            nodata: f64::NAN,
            overwrite: true,
            ..self.job.clone()
        }
    }

    /// The sink of the grid of `job` with the cells of `extent`; fails if it cannot be written.
    pub(super) fn sink(&self, job: &GridJob, extent: &GridExtent) -> Result<Box<dyn GridSink>> {
        job.format()?.create(&job.output, &extent.written(job), &job.write_options())
    }

    /// Assembles the tiles in `files` into the output of `job` with the cells of `extent`.
    pub(super) fn write(
        &self,
        files: &[String],
        job: &GridJob,
        extent: &GridExtent,
        RunControl { progress, cancel }: RunControl<'_>,
    ) -> Result<GridReport> {
        let started = Instant::now();
        let (format, info) = (job.format()?, extent.written(job));
        let recipe = StatisticRecipe::new(&job.stats, &job.rules(extent.cell()));
        let mut sink = self.sink(job, extent)?;
        let work = GridWorkload { format, sink: sink.as_ref(), extent, recipe: &recipe };
        let budget = GridBudget::writing(&job.resources, work)?;
        let bands = u32::try_from(job.stats.len()).unwrap_or(u32::MAX);
        let mut options = raster::GridOpenOptions {
            cache_bytes: (budget.blocks / u64::from(bands)) as usize,
            threads: budget.threads,
            temp_dir: job.resources.temp_dir.clone(),
            ..raster::GridOpenOptions::default()
        };
        let mut tiles = GridTileValues { bands: Vec::new() };
        for band in 1..=bands {
            options.band = band;
            tiles.bands.push(raster::open_all(files, &options)?);
        }
        let bands = CellBands { cells: &tiles, bands: recipe.bands(), info: &info };
        let valid = bands.write(sink.as_mut(), budget.threads, progress, cancel)?;
        cancel.check()?;
        let seen = self.seen.iter().flat_map(|seen| seen.notes.clone()).collect();
        let notes =
            [self.points.notes().to_vec(), extent.notes.clone(), seen, sink.notes()].concat();
        Ok(GridReport {
            files: self.points.files().len(),
            bands: bands.reports(&valid),
            notes,
            output_bytes: sink.finish()?,
            run: RunStatistics::since(started, &job.resources)
                .with_threads(budget.threads)
                .with_spilled(0),
            stages: vec![GridStage::since("write", started)],
            ..report(job, &info, extent)
        })
    }

    /// The window of all points in a cell or within `reach` world units of its centre.
    fn window(&self, extent: &GridExtent, reach: f64) -> SiteWindow {
        let (width, height) = extent.lattice.size();
        let [west, east] = self.steps_near(0, extent.lattice.x, width, reach);
        let [south, north] = self.steps_near(1, extent.lattice.y, height, reach);
        SiteWindow { low: [west, south], high: [east, north] }
    }

    /// The steps along an axis in its first `count` cells or within `reach` of their centres.
    fn steps_near(&self, axis: usize, cells: LatticeAxis, count: u32, reach: f64) -> [i32; 2] {
        let [a, b] = [0, count - 1].map(|cell| cells.world_centre(i64::from(cell)));
        let margin = cells.world_cell().max(reach);
        near_steps(&self.points.info().frame, axis, [a.min(b) - margin, a.max(b) + margin])
    }

    /// First margin around the cells, in steps; `None` for the whole point cloud.
    fn margin(&self, recipe: &StatisticRecipe, cells: &SiteWindow) -> Option<i32> {
        let margins = recipe.bands().iter().map(|band| self.margin_of(&band.statistic));
        let margin = margins.reduce(|a, b| Some(a?.max(b?))).flatten()?;
        let margin = margin.max(self.seen.as_ref().map_or(0, |seen| seen.reach));
        let [x, y] = [0, 1].map(|axis| cells.high[axis].abs_diff(cells.low[axis]) / 8);
        // A narrow tile among far points: some of its own size at least.
        Some(if margin == 0 { 0 } else { margin.max(x.min(y) as i32) })
    }

    /// First margin for a statistic, in steps; `None` for the whole point cloud.
    fn margin_of(&self, statistic: &Statistic) -> Option<i32> {
        let info = self.points.info();
        match statistic.shape() {
            Some(SurfaceInterpolation::Natural) => None,
            Some(SurfaceInterpolation::Linear { max_edge }) => {
                // What has long edges is void, whatever lies further away.
                let longest = max_edge.or(self.job.max_edge).map(|edge| reach(&info.frame, edge));
                Some(longest.unwrap_or(0).max(neighbours::tiling(info).side()).saturating_add(4))
            }
            None => Some(0),
        }
    }
}

/// The values of the cells of all tiles.
pub(super) struct GridTileValues {
    /// By band.
    pub(super) bands: Vec<Box<dyn GridSource>>,
}

impl CellSource for GridTileValues {
    fn values(
        &self,
        number: usize,
        _: &terrane_gridding::StatisticBand,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        self.bands[number].read_f64(rect, out)
    }
}
