//! Grids by plan: the cells are divided into tiles, each a task that reads the points near it; the last task
//! assembles the tiles. The grid is that of a single run, byte for byte.
//!
//! A task opens all headers, so that frame, extent and tiling are those of the whole, and reads the parts whose
//! bounds touch the window of its cells. If these do not suffice, the tile is made again with a margin four
//! times as wide.

mod manifest;
mod probe;
mod tile;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::extent::GridExtent;
use super::job::GridJob;
use super::options::GridOptions;
use super::report::GridReport;
use super::surface_model::{CloudOverview, SurfaceModel, SurfaceModelContext};
use crate::points::StagedPlace;
use manifest::{BLOCK, CloudGridPlan, GridTileTask, MOST_SIDE};
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, PointSource, ReturnCounts};
use terrane_engine::operation::{Divisible, Operation, RunRequest};
use terrane_engine::plan::{
    self, DescribesRun, MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest,
    PlanStep, PlannedWork, RunControl, StatusReport, TaskStates,
};
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::{name_of, refuse_in_memory};
use terrane_raster::write::{self, by_name};
use tile::OpenedCloudGrid;

/// A grid to plan.
pub type PlanGridJob = plan::PlanJob<GridJob>;
/// The plan of a grid and its progress.
pub type GridStatus = StatusReport<CellStatus>;

/// Part of the status that is specific to grids.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct CellStatus {
    pub width: u32,
    pub height: u32,
    /// Points that the headers claim.
    pub points: u64,
}

/// Part of the run report that is specific to grids.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CellRun {
    /// Points read by the tasks of this run; points near the borders of tiles are read repeatedly.
    pub points: u64,
    /// Path of the grid, if written.
    pub written: Option<String>,
    /// The grid, if this run wrote it. Its points are those of all tiles, counted for each tile that reads
    /// them.
    pub grid: Option<GridReport>,
}

impl DescribesRun for CellRun {
    fn written(&self) -> Option<&str> {
        self.written.as_deref()
    }
}

impl Divisible for GridOptions {
    const TASK_SIZE: &'static str = "Tile side in cells, a multiple of 256; each tile is a task [default: about 67 \
        million points]";
    terrane_engine::planned_as!(CloudGridPlan, CellStatus, CellRun);

    /// The default format is GeoTIFF.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<CellStatus>> {
        let RunRequest { output: folder, skipped, progress, cancel, .. } = request;
        let format = by_name(self.file.format.as_deref().unwrap_or("GTiff"))?;
        let output = folder.join("grid").with_extension(format.extensions[0]);
        // What a plan wrote before is told of by the run.
        let mut planned = self.clone();
        planned.file.replacing.overwrite = true;
        planned.check(&output)?;
        check_task(&planned.water, task_size)?;
        let (status, _) =
            planned.with_job(request, &output, StagedPlace::of_plan(folder)?, |job| {
                let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
                plan_grid(&PlanGridJob { job, folder, cut: task_size, skipped }, progress, cancel)
            })?;
        Ok(status)
    }
}

/// Writes a plan: the job, its input, its tasks and their resources. For a terrain model the points are read
/// once. A few small tiles are made to estimate the size of the results, and discarded.
///
/// # Errors
/// Those of opening the cloud and laying out the cells, and of a terrain model without ground; `Usage` for
/// water, for tile sizes that are not multiples of 256 cells, and for a folder that holds another plan or other
/// files.
pub fn plan_grid(
    job: &PlanGridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridStatus> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    check_task(&job.water, *cut)?;
    refuse_in_memory(job.input.iter().chain(&job.placement.like))?;
    job.check()?;
    let job = &job.settled()?;
    let points = cloud::source(&job.input, &job.cloud)?;
    let extent = GridExtent::new(points.info(), job)?;
    let (existing, at) =
        (PlanManifest::<CloudGridPlan>::existing(folder), RunControl { progress, cancel });
    let seen = match (&existing, job.preset) {
        (Some(plan), _) => plan.work.seen.clone(),
        (None, Some(preset)) => Some(scan(preset, job, &*points, &extent, at)?),
        (None, None) => None,
    };
    let opened = OpenedCloudGrid { job: job.clone(), points, extent, seen };
    let grid = CloudGridPlan::new(&opened, *cut)?;
    let files = grid.files(&*opened.points);
    let needs = match existing {
        Some(plan) => plan.needs,
        None => probe::expect(&opened, &grid.grid, at)?,
    };
    PlanManifest::new(grid, (job.label(), files), needs, skipped)?.put(folder)?;
    plan::status::<CloudGridPlan>(folder)
}

/// Fails for water, and for tile sizes that are not multiples of 256 cells.
fn check_task(water: &Option<String>, cut: Option<u32>) -> Result<()> {
    if water.is_some() {
        return Err(Error::usage("‹water› is not supported by `plan grid` (the level of a lake needs its whole bank)")
            .remedy(
                "plan without it, and pass ‹water› to ‹terrane convert›, ‹terrane tin› or ‹terrane contour› afterwards",
            ));
    }
    if let Some(side) = cut.filter(|side| *side == 0 || !side.is_multiple_of(BLOCK)) {
        return Err(Error::usage(format!("‹task_size› {side} is not a multiple of {BLOCK}"))
            .remedy(format!("pass a multiple such as {BLOCK} or {}", 2 * BLOCK)));
    }
    if let Some(side) = cut.filter(|side| *side > MOST_SIDE) {
        return Err(Error::usage(format!("‹task_size› {side} exceeds the limit of {MOST_SIDE}"))
            .remedy(format!("pass {MOST_SIDE} or less")));
    }
    Ok(())
}

/// Statistics of the whole point cloud for a terrain model.
fn scan(
    preset: SurfaceModel,
    job: &GridJob,
    points: &dyn PointSource,
    extent: &GridExtent,
    RunControl { progress, cancel }: RunControl<'_>,
) -> Result<CloudOverview> {
    let reading = job.reading();
    let Resources { threads, memory, .. } = job.resources;
    let part = None;
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
    CloudOverview::scan(preset, points.info(), &context)
}

/// The points of a tile.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct TilePointCounts {
    read: u64,
    kept: u64,
    /// Files with skipped damage.
    #[serde(default, skip_serializing_if = "LostPoints::is_empty")]
    losses: LostPoints,
}

impl PlannedWork for CloudGridPlan {
    const KIND: PlanKind = PlanKind::Grid;
    const ENDING: &'static str = "tif";
    const NAMES: &'static [Numbered<GridTileTask>] = &[("tile", GridTileTask)];

    type Task = GridTileTask;
    type Facts = TilePointCounts;
    type Run = CellRun;
    type Note = ();
    type Status = CellStatus;
    type Opened = OpenedCloudGrid;

    fn check(&self) -> Result<()> {
        self.check_cells()
    }

    fn tasks(&self) -> Vec<GridTileTask> {
        self.grid.tiles().collect()
    }

    fn before(&self, _: GridTileTask) -> Vec<GridTileTask> {
        Vec::new()
    }

    fn size(&self, task: PlanStep<GridTileTask>) -> u64 {
        match task {
            PlanStep::Task(tile) => self.grid.cells(tile).len() as u64,
            PlanStep::Finish => self.grid.all().len() as u64,
        }
    }

    fn status(&self) -> GridStatus {
        let manifest::PlannedCells { width, height, points, side, .. } = self.grid;
        StatusReport {
            format: self.method.format.clone().unwrap_or_default(),
            tile_cells: side,
            of: CellStatus { width, height, points },
            ..StatusReport::default()
        }
    }

    fn output(&self, _: &OutputForm) -> Result<PathBuf> {
        let format = write::by_name(self.method.format.as_deref().unwrap_or_default())?;
        Ok(Path::new("grid").with_extension(format.extensions[0]))
    }

    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<OpenedCloudGrid> {
        plan.work.open(&plan.label, order)
    }

    fn check_output(opened: &OpenedCloudGrid, _: RunControl<'_>) -> Result<()> {
        opened.sink(&opened.job, &opened.extent).map(drop)
    }

    fn make(
        opened: &OpenedCloudGrid,
        (tile, object): (GridTileTask, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut CellRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<TilePointCounts>> {
        let made = opened.make(states.folder.plan.work.grid.cells(tile), object, at)?;
        run.points += made.points.read;
        Ok(MadeArtifact {
            facts: TilePointCounts {
                read: made.points.read,
                kept: made.points.kept,
                losses: made.losses,
            },
            digest: None,
            spilled: made.run.spilled_bytes.unwrap_or_default(),
        })
    }

    fn write(
        opened: &OpenedCloudGrid,
        states: &TaskStates<'_, Self>,
        run: &mut CellRun,
        at: RunControl<'_>,
    ) -> Result<()> {
        let (mut points, mut losses) = (ReturnCounts::default(), LostPoints::default());
        for done in states.done.values() {
            points.read += done.facts.read;
            points.kept += done.facts.kept;
            losses.add(&done.facts.losses);
        }
        let files = states.done.keys().map(|tile| name_of(states.object(*tile)?.0));
        let files = files.collect::<Result<Vec<_>>>()?;
        let made = opened.write(&files, &opened.job, &opened.extent, at)?;
        let PlanManifest { label, work: CloudGridPlan { grid: cells, .. }, .. } =
            &states.folder.plan;
        let notes = losses.notes().chain(made.notes).collect();
        let (cloud_points, input) = (Some(cells.points), label.clone());
        run.grid = Some(GridReport { points, cloud_points, input, notes, ..made });
        Self::written((), &opened.job.output, run);
        Ok(())
    }

    fn written((): (), output: &Path, run: &mut CellRun) {
        run.written = Some(output.display().to_string());
    }
}
