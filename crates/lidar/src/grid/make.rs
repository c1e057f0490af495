//! Making a grid, or a rectangle of one, from points: read, accumulate, write.

use std::time::Instant;

use super::blocks::CellBlocks;
use super::budget::{GridBudget, GridWorkload};
use super::extent::GridExtent;
use super::heights::HeightSource;
use super::job::GridJob;
use super::level;
use super::neighbours::{CloudSurfaces, tiling};
use super::reading::{CloudReader, ReadOutcome};
use super::region_points::CellSurroundings;
use super::report::{GridReport, GridStage};
use super::source::{CellBands, FinishedGrid};
use super::surface_model::{self, CloudOverview, PreparedSurfaceModel, SurfaceModelContext};
use crate::point_index::{PointStore, PointStoreCoverage, parts_in};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::PointFrame;
use terrane_cloud::{self as cloud, PointSource};
use terrane_engine::memory::with_polygons;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::{Cancel, Progress};
use terrane_gridding::{CellUnits, StatisticRecipe};
use terrane_raster::GridInfo;

/// Runs the job. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// Errors of the inputs, the output and the memory; more points in a cell than can be counted.
pub fn run(job: &GridJob, progress: &dyn Progress, cancel: &Cancel) -> Result<GridReport> {
    job.check()?;
    let job = &job.settled()?;
    if let Some(water) = &job.water {
        return level::run(job, water, |ground| run(ground, progress, cancel), progress, cancel);
    }
    let start = Instant::now();
    let cloud = cloud::source(&job.input, &job.reading())?;
    let opened = GridStage::since("open", start);
    let mut report = with_polygons(&job.cloud, &job.resources, |resources| {
        let job = GridJob { resources, ..job.clone() };
        GridMaker::of_whole(&*cloud, &job, progress, cancel)?.make()
    })?;
    report.run.memory_budget = job.resources.memory;
    let stages = [vec![opened], report.stages].concat();
    report.run.wall_seconds = start.elapsed().as_secs_f64();
    let lost = report.losses.notes().collect();
    let notes = [cloud.notes().to_vec(), lost, report.notes].concat();
    let files = cloud.files().len();
    Ok(GridReport { stages, notes, files, ..report })
}

/// As [`run`], for points from any source (`job.input` is only used in the report).
pub fn grid(
    points: &dyn PointSource,
    job: &GridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridReport> {
    if job.preset.is_some() {
        let message = "‹dtm›, ‹dsm› and ‹chm› read the point cloud several times";
        return Err(Error::usage(message).remedy("pass the name of the file"));
    }
    job.check()?;
    GridMaker::of_whole(points, job, progress, cancel)?.make()
}

/// A grid to be made of a cloud, whole or in part.
pub(super) struct GridMaker<'a> {
    pub(super) points: &'a dyn PointSource,
    pub(super) job: &'a GridJob,
    pub(super) extent: GridExtent,
    /// The window to read, if not all; a terrain model then needs statistics of the whole point cloud.
    pub(super) within: Option<CellSurroundings>,
    pub(super) seen: Option<&'a CloudOverview>,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl<'a> GridMaker<'a> {
    /// All cells of a checked job.
    pub(super) fn of_whole(
        points: &'a dyn PointSource,
        job: &'a GridJob,
        progress: &'a dyn Progress,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let extent = GridExtent::new(points.info(), job)?;
        Ok(Self { points, job, extent, within: None, seen: None, progress, cancel })
    }

    /// Makes and writes it from the whole point cloud.
    pub(super) fn make(&self) -> Result<GridReport> {
        self.try_make()?
            .ok_or_else(|| Error::new(ErrorKind::Internal, "the whole point cloud did not suffice"))
    }

    /// Makes and writes it; `None` if the points `within` do not suffice for some cell.
    pub(super) fn try_make(&self) -> Result<Option<GridReport>> {
        let start = Instant::now();
        let Self { job, extent, progress, cancel, .. } = self;
        let recipe = StatisticRecipe::new(&job.stats, &job.rules(extent.cell()));
        let selection = self.points.select(&recipe.attributes())?;
        let info = extent.written(job);
        let format = job.format()?;
        let mut sink = format.create(&job.output, &info, &job.write_options())?;
        let parts = self.parts();
        let count = parts.iter().map(|part| self.points.points_of(*part)).sum();
        let work = GridWorkload { format, sink: sink.as_ref(), extent, recipe: &recipe };
        if job.preset.is_some() {
            let least = surface_model::min_memory(job, self.points.info(), self.seen);
            GridBudget::check(&job.resources, work, least)?;
        }
        let budget = GridBudget::divide(&job.resources, work, count)?;
        let blocks = CellBlocks::new(&recipe, extent, &budget, job.spill_folder());
        let reader = CloudReader {
            source: self.points,
            selection: &selection,
            parts,
            extent,
            recipe: &recipe,
            blocks: &blocks,
        };
        let (outcome, heights) = self.gather(&reader, budget.threads, budget.points)?;
        let accumulated = GridStage::since("points", start);
        let write_start = Instant::now();
        let (units, max_edge) = (self.units(), job.max_edge);
        let finished = FinishedGrid { blocks: &blocks, extent, units, heights, max_edge };
        let bands = CellBands { cells: &finished, bands: recipe.bands(), info: &info };
        let valid = bands.write(sink.as_mut(), budget.threads, *progress, cancel);
        if finished.heights.as_ref().is_some_and(HeightSource::is_exceeded) {
            return Ok(None);
        }
        let valid = valid?;
        cancel.check()?;
        let spilled = finished.heights.as_ref().map_or(0, HeightSource::spilled_bytes);
        let of_points = finished.heights.as_ref().map_or(&[][..], HeightSource::notes).to_vec();
        let notes = [extent.notes.clone(), of_points, sink.notes()].concat();
        let output_bytes = sink.finish()?;
        let mut losses = LostPoints::of(self.points);
        finished.heights.iter().filter_map(HeightSource::losses).for_each(|more| losses.add(more));
        Ok(Some(GridReport {
            points: outcome.census,
            losses,
            outside_grid: outcome.outside,
            bands: bands.reports(&valid),
            notes,
            output_bytes,
            points_per_second: outcome.census.read as f64 / accumulated.seconds,
            stages: vec![accumulated, GridStage::since("write", write_start)],
            run: RunStatistics::since(start, &job.resources)
                .with_threads(budget.threads)
                .with_spilled(blocks.spilled_bytes() + spilled),
            ..report(job, &info, extent)
        }))
    }

    /// The parts to read.
    fn parts(&self) -> Vec<usize> {
        match &self.within {
            Some(near) => parts_in(self.points, &near.window()),
            None => (0..self.points.parts()).collect(),
        }
    }

    /// Reads the points; surfaces may store `memory` bytes of them.
    fn gather(
        &self,
        reader: &CloudReader<'_>,
        threads: usize,
        memory: u64,
    ) -> Result<(ReadOutcome, Option<HeightSource>)> {
        let Self { points, job, progress, cancel, .. } = *self;
        if let Some(preset) = job.preset {
            let reading = job.reading();
            let part = self.within.zip(self.seen);
            let extent = &self.extent;
            let context = SurfaceModelContext {
                job,
                extent,
                reading,
                threads,
                memory,
                points,
                part,
                progress,
                cancel,
            };
            let model = PreparedSurfaceModel::new(preset, points.info(), &context)?;
            let outcome = ReadOutcome { census: model.census, outside: 0 };
            return Ok((outcome, Some(HeightSource::Model(Box::new(model)))));
        }
        let store = (memory > 0).then(|| {
            let limits = self.within.map(|near| PointStoreCoverage::new(points, near.window()));
            PointStore::empty(tiling(points.info()), job.spill_folder(), memory).limited(limits)
        });
        let outcome = reader.run(store.as_ref(), threads, progress, cancel)?;
        let surfaces = store.map(|store| CloudSurfaces::new(store, points.info().frame));
        Ok((outcome, surfaces.transpose()?.map(Box::new).map(HeightSource::Surfaces)))
    }

    fn units(&self) -> CellUnits {
        let PointFrame { scale, offset } = self.points.info().frame;
        CellUnits { scale: scale[2], offset: offset[2], area: self.extent.lattice.area() }
    }
}

/// The report before the grid is made.
pub(super) fn report(job: &GridJob, info: &GridInfo, extent: &GridExtent) -> GridReport {
    let t = info.transform;
    GridReport {
        input: job.label(),
        output: job.output.display().to_string(),
        format: job.format().map_or(String::new(), |format| format.name.to_owned()),
        width: info.width,
        height: info.height,
        cells: u64::from(info.width) * u64::from(info.height),
        cell: [t.a, -t.e],
        corner: [t.x0 - 0.5 * t.a, t.y0 - 0.5 * t.e],
        crs: info.crs.label(),
        vertical_unit: info.crs.vertical_unit.clone(),
        sample_type: info.sample_type.name().to_owned(),
        nodata: job.nodata,
        radius: extent.radius(&job.rules(extent.cell()), job),
        ..GridReport::default()
    }
}
