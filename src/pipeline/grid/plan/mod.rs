//! Grids by plan: the cells are cut into tiles, each a task of its own that reads what lies near it;
//! the last task puts the tiles together. The grid is that of a single run, byte for byte.

mod manifest;
mod run;
mod tile;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::GridJob;
use super::extent::Extent;
use super::report::GridReport;
use crate::cloud;
use crate::error::{Error, Result};
use crate::pipeline::Cancel;
use crate::pipeline::plan::{self, Digest};
use crate::pipeline::sift::Skipped;
use manifest::{BLOCK, Manifest, TaskId};
pub use run::{RunGridJob, run_grid};
use tile::Place;

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
    /// Points that the headers claim.
    pub points: u64,
    /// Cells along a tile.
    pub tile_cells: u32,
    /// Tasks that are not done; the last one is "finish".
    pub to_do: Vec<GridTask>,
    /// Tasks that are done.
    pub done: u64,
    /// Tasks whose results are damaged; they are among those not done.
    pub damaged: Vec<String>,
    /// Bytes of all results so far.
    pub object_bytes: u64,
    /// Where the grid is, once it is written.
    pub output: Option<String>,
    /// Files that were left out of the input when it was planned.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// A task that is not done.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GridTask {
    /// Its name.
    pub id: String,
    /// The tasks it waits for: none; "finish" waits for all others and names none.
    pub after: Vec<String>,
    /// Cells it computes.
    pub cells: u64,
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
}

/// Writes down what is to be made, from what, by which tasks. Headers are read, points are not.
///
/// # Errors
/// Those of opening the cloud and laying out the cells; `Usage` for a preset, whose points are found
/// in the whole cloud at once, for tiles that are not of multiples of 256 cells, and for a folder that
/// holds another plan or other files.
pub fn plan_grid(job: &PlanGridJob) -> Result<GridStatus> {
    let PlanGridJob { grid, folder, tile, skipped } = job;
    if grid.preset.is_some() {
        return Err(Error::usage("a model of the terrain is made of the whole cloud at once")
            .remedy("plan --stat tin --class 2, the ground by class, or run terrane grid"));
    }
    if let Some(side) = tile.filter(|side| *side == 0 || !side.is_multiple_of(BLOCK)) {
        return Err(Error::usage(format!("a tile of {side} cells is no multiple of {BLOCK}")));
    }
    grid.check()?;
    let points = cloud::synth::source(&grid.input, &grid.cloud)?;
    let extent = Extent::new(points.info(), grid)?;
    let mut manifest = Manifest::new(grid, &*points, &extent, *tile)?;
    manifest.skipped.clone_from(skipped);
    plan::put(folder, &manifest)?;
    grid_status(folder)
}

/// How far the work in `folder` has come; results are looked at, not read through.
///
/// # Errors
/// A folder without the plan of a grid.
pub fn grid_status(folder: &Path) -> Result<GridStatus> {
    let (manifest, id) = plan::read::<Manifest>(folder)?;
    let written = written(folder, id).filter(|written| written.path.exists());
    let mut status = GridStatus {
        folder: folder.display().to_string(),
        plan_id: id.to_string(),
        input: manifest.method.label.clone(),
        format: manifest.method.format.clone(),
        width: manifest.grid.width,
        height: manifest.grid.height,
        points: manifest.grid.points,
        tile_cells: manifest.grid.side,
        output: written.as_ref().map(|written| written.path.display().to_string()),
        skipped: manifest.skipped.clone(),
        ..GridStatus::default()
    };
    for task in manifest.grid.tasks() {
        let done = match task {
            TaskId::Finish => Ok(written.is_some()),
            TaskId::Tile(_) => {
                let found = Place::new(folder, id, task).look(false, &Cancel::default());
                found.map(|done| done.map(|done| status.object_bytes += done.bytes).is_some())
            }
        };
        if done.is_err() {
            status.damaged.push(task.to_string());
        }
        match done.unwrap_or(false) {
            true => status.done += 1,
            false => status.to_do.push(GridTask {
                id: task.to_string(),
                after: Vec::new(),
                cells: manifest.grid.cells(task).len() as u64,
            }),
        }
    }
    Ok(status)
}

/// A grid that is written.
#[derive(Clone, Debug, Serialize, serde::Deserialize)]
struct Written {
    plan_id: Digest,
    /// Absolute.
    #[serde(with = "plan::as_name")]
    path: PathBuf,
    /// Of its bytes; `None` while it is being written.
    digest: Option<Digest>,
}

/// The note on the grid that was written last, if it is from this plan and finished.
fn written(folder: &Path, id: Digest) -> Option<Written> {
    plan::note(folder).filter(|w: &Written| w.plan_id == id && w.digest.is_some())
}
