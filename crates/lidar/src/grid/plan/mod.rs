//! Grids by plan: the cells are cut into tiles, each a task of its own that reads what lies near it;
//! the last task puts the tiles together. The grid is that of a single run, byte for byte.
//!
//! A task opens all headers, so that frame, extent and squares are those of the whole, and reads the
//! parts whose bounds touch the window of its cells. Where what was read is too little to tell, the tile
//! is made again with a window four times as wide around it.

mod manifest;
mod probe;
mod tile;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::extent::GridExtent;
use super::job::GridJob;
use super::options::GridOptions;
use super::preset::{CloudOverview, Making, SurfaceModel};
use super::report::GridReport;
use manifest::{BLOCK, CloudGridPlan, GridTileTask, MOST_SIDE};
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, PointCensus, PointSource};
use terrane_engine::operation::{Divisible, Operation, RunRequest};
use terrane_engine::plan::{
    self, DescribesRun, MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest,
    PlanStep, PlannedWork, RunControl, StatusReport, TaskSurvey,
};
use terrane_engine::sift::LostPoints;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::{name_of, refuse_held, shown_all};
use terrane_raster::write::{self, by_name};
use tile::OpenedCloudGrid;

/// A grid to plan.
pub type PlanGridJob = plan::PlanJob<GridJob>;
/// The plan of a grid, or how far the work on it has come.
pub type GridStatus = StatusReport<CellStatus>;

/// What is told of the plan of a grid alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct CellStatus {
    pub width: u32,
    pub height: u32,
    /// Points that the headers claim.
    pub points: u64,
}

/// What is told of a run on a grid alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CellRun {
    /// Points read by the tasks it did; those near the borders of tiles are read for each.
    pub points: u64,
    /// Where the grid is, if it is written.
    pub written: Option<String>,
    /// The grid, if this run wrote it. Its points are those that the tiles are made of, which count
    /// for each tile they are near.
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

    /// In a GeoTIFF unless told otherwise.
    fn plan(
        &self,
        request: RunRequest<'_>,
        task_size: Option<u32>,
    ) -> Result<StatusReport<CellStatus>> {
        let RunRequest { inputs, output: folder, skipped, progress, cancel, .. } = request;
        let format = by_name(self.file.format.as_deref().unwrap_or("GTiff"))?;
        let output = folder.join("grid").with_extension(format.extensions[0]);
        // What a plan wrote before is told of by the run.
        let mut planned = self.clone();
        planned.file.replacing.overwrite = true;
        planned.check(&output)?;
        let job = planned.job(inputs, &output)?;
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_grid(&PlanGridJob { job, folder, cut: task_size, skipped }, progress, cancel)
    }
}

/// Writes down what is to be made, from what, by which tasks, and what they need. For a model of the terrain the
/// points are looked at once. A few small tiles are made, to tell the size of the results, and thrown away.
///
/// # Errors
/// Those of opening the cloud and laying out the cells, and of a model without ground; `Usage` for water, whose
/// level is that of a whole bank, for tiles that are not of multiples of 256 cells, and for a folder that holds
/// another plan or other files.
pub fn plan_grid(
    job: &PlanGridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridStatus> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    if job.water.is_some() {
        return Err(Error::usage("‹water› makes the level of a lake of its whole bank at once")
            .remedy(
                "plan without it, and pass ‹water› to ‹terrane convert›, ‹terrane tin› or ‹terrane contour› of the grid",
            ));
    }
    if let Some(side) = cut.filter(|side| *side == 0 || !side.is_multiple_of(BLOCK)) {
        return Err(Error::usage(format!(
            "‹task_size› is {side}: tiles have a multiple of {BLOCK} cells along a side"
        ))
        .remedy(format!("pass {BLOCK}, or {} and so on", 2 * BLOCK)));
    }
    if let Some(side) = cut.filter(|side| *side > MOST_SIDE) {
        return Err(Error::usage(format!(
            "‹task_size› is {side}: a tile of so many cells is too large"
        ))
        .remedy(format!("choose {MOST_SIDE} at most")));
    }
    refuse_held(job.input.iter().chain(&job.placement.like))?;
    job.check()?;
    let job = &job.settled()?;
    let points = cloud::source(&job.input, &job.cloud)?;
    let extent = GridExtent::new(points.info(), job)?;
    let (there, at) =
        (PlanManifest::<CloudGridPlan>::there(folder), RunControl { progress, cancel });
    let look = |preset| look(preset, job, (&*points, &extent), at);
    let seen = match &there {
        Some(plan) => plan.work.seen.clone(),
        None => job.preset.map(look).transpose()?,
    };
    let opened = OpenedCloudGrid { job: job.clone(), points, extent, seen };
    let grid = CloudGridPlan::new(&opened, *cut)?;
    let files = grid.files(&*opened.points);
    let expect = || probe::expect(&opened, &grid.grid, at);
    let needs = there.map_or_else(expect, |plan| Ok(plan.needs))?;
    let label = shown_all(&job.input);
    PlanManifest::new(grid, (label, files), needs, skipped)?.put(folder)?;
    plan::status::<CloudGridPlan>(folder)
}

/// What a model of the terrain has to know of the whole cloud.
fn look(
    preset: SurfaceModel,
    job: &GridJob,
    (points, extent): (&dyn PointSource, &GridExtent),
    RunControl { progress, cancel }: RunControl<'_>,
) -> Result<CloudOverview> {
    let reading = job.reading();
    let Resources { threads, memory, .. } = job.resources;
    let part = None;
    let making = Making { job, extent, reading, threads, memory, points, part, progress, cancel };
    CloudOverview::look(preset, points.info(), &making)
}

/// The points a tile is made of.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct TilePointCounts {
    read: u64,
    kept: u64,
    /// Files whose damage was passed over.
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

    fn tell(&self) -> GridStatus {
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
        survey: &TaskSurvey<'_, Self>,
        run: &mut CellRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<TilePointCounts>> {
        let made = opened.make(survey.folder.plan.work.grid.cells(tile), object, at)?;
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
        survey: &TaskSurvey<'_, Self>,
        run: &mut CellRun,
        at: RunControl<'_>,
    ) -> Result<()> {
        let (mut points, mut losses) = (PointCensus::default(), LostPoints::default());
        for done in survey.done.values() {
            points.read += done.facts.read;
            points.kept += done.facts.kept;
            losses.add(&done.facts.losses);
        }
        let file = |tile: &GridTileTask| name_of(survey.object(*tile)?.0);
        let files = survey.done.keys().map(file).collect::<Result<Vec<_>>>()?;
        let made = opened.write(&files, &opened.job, &opened.extent, at)?;
        let PlanManifest { label, work: CloudGridPlan { grid: cells, .. }, .. } =
            &survey.folder.plan;
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
