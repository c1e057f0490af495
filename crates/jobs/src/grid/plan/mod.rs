//! Grids by plan: the cells are cut into tiles, each a task of its own that reads what lies near it;
//! the last task puts the tiles together. The grid is that of a single run, byte for byte.

mod manifest;
mod probe;
mod run;
mod tile;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::GridJob;
use super::extent::Extent;
use super::report::GridReport;
use crate::plan::{self, Forecast, Look, TaskReport, Told, last_output};
use crate::sift::Skipped;
use crate::{Cancel, Progress, Resources, Silent};
use manifest::{BLOCK, Manifest, TaskId};
pub use run::{RunGridJob, run_grid};
use terrane_base::error::{Error, Result};
use terrane_cloud as cloud;
use tile::{Opened, Survey};

/// A grid to plan.
#[derive(Clone, Debug)]
pub struct PlanGridJob {
    /// The grid to make; its output gives the format and is not written.
    pub grid: GridJob,
    /// The folder for the plan: a new or empty one, or one with the same plan.
    pub folder: PathBuf,
    /// Cells along a tile, a multiple of 256; as many as make a fair piece of work when `None`.
    pub tile: Option<u32>,
    /// Files that are left out of the input because they are bad, to be noted in the plan.
    pub skipped: Vec<Skipped>,
}

/// A plan of a grid, or how far the work on it has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridStatus {
    pub folder: String,
    pub plan_id: String,
    pub input: String,
    pub format: String,
    pub width: u32,
    pub height: u32,
    /// Cells, by the name that all kinds of plans have for what is worked on.
    pub work: u64,
    /// Points that the headers claim.
    pub points: u64,
    /// Cells along a tile.
    pub tile_cells: u32,
    /// Tasks that are not done; the last one is "finish".
    pub to_do: Vec<TaskReport>,
    /// Tasks that are done.
    pub done: u64,
    /// Tasks whose results are damaged; they are among those not done.
    pub damaged: Vec<String>,
    /// Bytes of all results so far.
    pub object_bytes: u64,
    /// What the rest takes.
    #[serde(flatten)]
    pub forecast: Forecast,
    /// The grid, once it is written.
    #[serde(flatten)]
    pub grid: Told,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// What a run of a plan did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridRun {
    pub folder: String,
    pub plan_id: String,
    /// Tasks of the plan.
    pub tasks: u64,
    /// Tasks that were done before, and
    pub found: u64,
    /// the bytes of their results.
    pub found_bytes: u64,
    /// Tasks that were done before and whose results were damaged.
    pub damaged: Vec<String>,
    /// Tasks done by this run.
    pub made: Vec<String>,
    pub made_bytes: u64,
    /// Points read by these; those near the borders of tiles are read for each.
    pub points: u64,
    pub spilled_bytes: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    /// Where the grid is, if it is written.
    pub written: Option<String>,
    /// The grid, if this run wrote it. Its points are those that the tiles are made of, which count
    /// for each tile they are near.
    pub grid: Option<GridReport>,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// Writes down what is to be made, from what, by which tasks, and what they need. A few small tiles are
/// made, to tell the size of the results, and thrown away.
///
/// # Errors
/// Those of opening the cloud and laying out the cells; `Usage` for a preset, whose points are found
/// in the whole cloud at once, for tiles that are not of multiples of 256 cells, and for a folder that
/// holds another plan or other files.
pub fn plan_grid(
    job: &PlanGridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridStatus> {
    let PlanGridJob { grid, folder, tile, skipped } = job;
    if grid.preset.is_some() {
        return Err(Error::usage("a model of the terrain is made of the whole cloud at once")
            .remedy("plan --stat tin --class 2, the ground by class, or run terrane grid"));
    }
    if let Some(side) = tile.filter(|side| *side == 0 || !side.is_multiple_of(BLOCK)) {
        return Err(Error::usage(format!("a tile of {side} cells is no multiple of {BLOCK}")));
    }
    grid.check()?;
    let points = cloud::source(&grid.input, &grid.cloud)?;
    let extent = Extent::new(points.info(), grid)?;
    let mut manifest = Manifest::new(grid, &*points, &extent, *tile)?;
    manifest.skipped.clone_from(skipped);
    let opened = Opened { job: grid.clone(), points, extent };
    manifest.needs = probe::expect(&opened, &manifest.grid, progress, cancel)?;
    plan::put(folder, &manifest)?;
    grid_status(folder)
}

/// How far the work in `folder` has come; results are looked at, not read through.
///
/// # Errors
/// A folder without the plan of a grid.
pub fn grid_status(folder: &Path) -> Result<GridStatus> {
    let (manifest, id) = plan::read::<Manifest>(folder)?;
    let (cells, cancel) = (&manifest.grid, Cancel::default());
    let survey = Survey::of((folder, id), cells, Look::Quick, &Silent, &cancel)?;
    let grid = last_output(folder, id)?;
    let left = cells.tiles().filter(|tile| !survey.done.contains_key(tile)).map(TaskId::Tile);
    let left: Vec<_> = left.chain(grid.output.is_none().then_some(TaskId::Finish)).collect();
    let report = |task: &TaskId| TaskReport {
        id: task.to_string(),
        after: Vec::new(),
        work: cells.cells(*task).len() as u64,
    };
    Ok(GridStatus {
        folder: folder.display().to_string(),
        plan_id: id.to_string(),
        input: manifest.method.label.clone(),
        format: manifest.method.format.clone(),
        width: cells.width,
        height: cells.height,
        work: cells.cells(TaskId::Finish).len() as u64,
        points: cells.points,
        tile_cells: cells.side,
        done: cells.count() + 1 - left.len() as u64,
        damaged: survey.damaged.iter().map(|tile| TaskId::Tile(*tile).to_string()).collect(),
        object_bytes: survey.done.values().map(|done| done.bytes).sum(),
        forecast: forecast(&manifest, &left),
        to_do: left.iter().map(report).collect(),
        grid,
        skipped: manifest.skipped.clone(),
    })
}

/// What the tasks that are `left` take.
fn forecast(plan: &Manifest, left: &[TaskId]) -> Forecast {
    let all = plan.grid.cells(TaskId::Finish).len() as f64;
    let tiles = left.iter().filter(|task| **task != TaskId::Finish);
    let cells: f64 = tiles.map(|task| plan.grid.cells(*task).len() as f64).sum();
    let writing = if left.contains(&TaskId::Finish) { all } else { 0.0 };
    let threads = plan.needs.threads(&Resources::default());
    let points = plan.grid.points as f64 * cells / all;
    Forecast {
        seconds: plan.needs.seconds(points, cells + writing, threads),
        threads,
        least_memory: plan.needs.memory,
        disk_needed: (plan.needs.tile_bytes as f64 * cells / all) as u64,
        output_bytes: plan.needs.output_bytes,
    }
}
