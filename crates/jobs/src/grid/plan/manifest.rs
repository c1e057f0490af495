//! The plan of a grid on paper: the job, what it is made from, and how its cells are cut into tiles.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::grid::extent::Extent;
use crate::grid::{Compat, GridJob, GroundFrom, Placement};
use crate::plan::{self, InputFile, Planned};
use crate::sift::Skipped;
use crate::{REVISION, Resources};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Rect};
use terrane_base::limits;
use terrane_cloud::{self as cloud, Filter, OpenOptions, PointSource};
use terrane_files::{name_of, path_of, shown};
use terrane_gridding::Asked;
use terrane_raster::SampleType;

/// Sides of tiles are multiples of this many cells, the usual blocks of files.
pub(super) const BLOCK: u32 = 256;
/// Most cells along a tile.
const MOST_SIDE: u32 = 1 << 14;
/// Points that a tile has about, unless told otherwise.
const TILE_POINTS: f64 = (1_u64 << 26) as f64;
/// Most tiles.
const MOST_TILES: u64 = 1 << 22;

/// A plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Manifest {
    /// "grid".
    kind: String,
    /// Version of the program that made it.
    terrane: String,
    revision: u32,
    pub(super) method: Method,
    pub(super) grid: Cells,
    files: Vec<InputFile>,
    /// Files that are left out of the input because they are bad.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) skipped: Vec<Skipped>,
    pub(super) needs: Needs,
}

/// What the work will take, about.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Needs {
    /// Bytes of all tiles' results, and
    pub(super) tile_bytes: u64,
    /// of what is written at the end.
    pub(super) output_bytes: u64,
    /// Least bytes of memory for a task.
    pub(super) memory: u64,
    /// Of one thread.
    pub(super) point_nanoseconds: f64,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Method {
    /// Names of files, or of a synthetic cloud.
    input: Vec<String>,
    /// What the user called them.
    pub(super) label: String,
    filter: Filter,
    salvage: bool,
    crs: Option<Crs>,
    pub(super) format: String,
    creation: Vec<(String, String)>,
    stats: Vec<Asked>,
    placement: Placement,
    compat: Compat,
    radius: Option<f64>,
    power: Option<f64>,
    max_edge: Option<f64>,
    fill: u32,
    sample_type: SampleType,
    round: bool,
    /// As text, because it may be NaN.
    nodata: String,
}

/// What the cells are, as found when the plan was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cells {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Cells along a tile.
    pub(super) side: u32,
    /// Points that the headers claim.
    pub(super) points: u64,
    /// World position of the centre of the first cell.
    first: [f64; 2],
    crs: String,
}

/// A task: a tile by its number, row by row, or the writing of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TaskId {
    Tile(u32),
    Finish,
}

impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tile(tile) => write!(f, "tile-{tile}"),
            Self::Finish => f.write_str("finish"),
        }
    }
}

impl FromStr for TaskId {
    type Err = Error;

    fn from_str(text: &str) -> std::result::Result<Self, Error> {
        let tile = text.strip_prefix("tile-").and_then(|number| number.parse().ok());
        tile.map(Self::Tile).or((text == "finish").then_some(Self::Finish)).ok_or_else(|| {
            Error::usage(format!("\"{text}\" is no task"))
                .remedy("tasks are tile-0, tile-1, ..., finish: see terrane status")
        })
    }
}

impl Manifest {
    /// The plan for a job over an opened cloud; tiles are of `side` cells, or of as many as make a
    /// fair piece of work.
    pub(super) fn new(
        job: &GridJob,
        points: &dyn PointSource,
        extent: &Extent,
        side: Option<u32>,
    ) -> Result<Self> {
        let mut placement = job.placement.clone();
        placement.like = placement.like.map(absolute).transpose()?;
        let label = job.input.iter().map(|name| shown(name)).collect::<Vec<_>>().join(", ");
        let is_synthetic = points.files().is_empty();
        let input = match is_synthetic {
            true => job.input.clone(),
            false => points.files().iter().cloned().map(absolute).collect::<Result<_>>()?,
        };
        let on_disk = if is_synthetic { &[][..] } else { &input };
        let paths: Vec<PathBuf> =
            on_disk.iter().chain(&placement.like).map(|name| path_of(name).into_owned()).collect();
        let method = Method {
            input,
            label,
            filter: job.cloud.filter.clone(),
            salvage: job.cloud.salvage,
            crs: job.cloud.crs.clone(),
            format: job.format()?.name.to_owned(),
            creation: job.creation.clone(),
            stats: job.stats.clone(),
            placement,
            compat: job.compat,
            radius: job.radius,
            power: job.power,
            max_edge: job.max_edge,
            fill: job.fill,
            sample_type: job.sample_type,
            round: job.round,
            nodata: job.nodata.to_string(),
        };
        let grid = Cells::of(points, extent, side);
        limits::check("number of tiles", grid.count(), MOST_TILES)?;
        Ok(Self {
            kind: Self::KIND.to_owned(),
            terrane: env!("CARGO_PKG_VERSION").to_owned(),
            revision: REVISION,
            method,
            grid,
            files: plan::look_at(&plan::with_companions(paths))?,
            skipped: Vec::new(),
            needs: Needs::default(),
        })
    }

    /// The job that writes the grid to `output`.
    pub(super) fn job(&self, output: PathBuf, overwrite: bool, resources: Resources) -> GridJob {
        let method = self.method.clone();
        GridJob {
            input: method.input,
            cloud: OpenOptions {
                filter: method.filter,
                salvage: method.salvage,
                crs: method.crs,
                threads: resources.threads,
            },
            output,
            format: Some(method.format),
            creation: method.creation,
            stats: method.stats,
            preset: None,
            ground: GroundFrom::Auto,
            placement: method.placement,
            compat: method.compat,
            radius: method.radius,
            power: method.power,
            max_edge: method.max_edge,
            fill: method.fill,
            sample_type: method.sample_type,
            round: method.round,
            nodata: method.nodata.parse().unwrap_or(f64::NAN),
            overwrite,
            resources,
        }
    }

    /// Opens the cloud and lays out the cells; fails when they are not those of the plan.
    pub(super) fn open(&self, job: &GridJob) -> Result<(Box<dyn PointSource>, Extent)> {
        let points = cloud::source(&job.input, &job.cloud)?;
        let extent = Extent::new(points.info(), job)?;
        let here = Cells::of(&*points, &extent, Some(self.grid.side));
        match plan::difference(&self.grid, &here) {
            None => Ok((points, extent)),
            Some(how) => {
                Err(Error::bad_input(format!("is not the cloud the plan was made for: {how}"))
                    .in_file(Path::new(&self.method.label))
                    .remedy("put it back, or plan anew in another folder"))
            }
        }
    }
}

/// A path that holds wherever a task is run on this file system.
fn absolute(path: String) -> Result<String> {
    name_of(plan::noted_path(&path_of(&path))?)
}

impl Planned for Manifest {
    const KIND: &'static str = "grid";

    fn made_by(&self) -> (&str, u32) {
        (&self.terrane, self.revision)
    }

    fn check(&self) -> std::result::Result<(), String> {
        let Cells { width, height, side, .. } = self.grid;
        let is_side = side > 0 && side.is_multiple_of(BLOCK) && side <= MOST_SIDE;
        if !is_side || width == 0 || height == 0 {
            return Err("it has no cells, or tiles of none".to_owned());
        }
        limits::check("columns or rows", width.max(height).into(), limits::MAX_SIDE)
            .and_then(|()| limits::check("number of tiles", self.grid.count(), MOST_TILES))
            .map_err(|e| e.to_string())
    }

    fn files(&self) -> &[InputFile] {
        &self.files
    }

    fn files_mut(&mut self) -> &mut [InputFile] {
        &mut self.files
    }

    fn skipped(&self) -> &[Skipped] {
        &self.skipped
    }

    fn skipped_mut(&mut self) -> &mut Vec<Skipped> {
        &mut self.skipped
    }
}

impl Cells {
    fn of(points: &dyn PointSource, extent: &Extent, side: Option<u32>) -> Self {
        let Rect { col, row, width, height } = extent.output;
        let t = extent.lattice.transform().shifted(f64::from(col), f64::from(row));
        let info = points.info();
        let fair = || fair_side(u64::from(width) * u64::from(height), info.count);
        let crs = extent.crs.wkt.clone().unwrap_or_else(|| extent.crs.label());
        let (side, points) = (side.unwrap_or_else(fair), info.count);
        Self { width, height, side, points, first: [t.x0, t.y0], crs }
    }

    /// Of nothing in particular.
    #[cfg(test)]
    pub(super) fn sized(width: u32, height: u32, side: u32) -> Self {
        Self { width, height, side, points: 1, first: [0.0; 2], crs: String::new() }
    }

    /// Tiles from west to east and from north to south.
    fn counts(&self) -> [u32; 2] {
        [self.width, self.height].map(|cells| cells.div_ceil(self.side))
    }

    /// Number of tiles.
    pub(super) fn count(&self) -> u64 {
        self.counts().into_iter().map(u64::from).product()
    }

    /// The numbers of all tiles.
    pub(super) fn tiles(&self) -> impl Iterator<Item = u32> + use<> {
        0..self.count() as u32
    }

    /// True when there is such a task.
    pub(super) fn has(&self, task: TaskId) -> bool {
        match task {
            TaskId::Tile(tile) => u64::from(tile) < self.count(),
            TaskId::Finish => true,
        }
    }

    /// The cells of a task.
    pub(super) fn cells(&self, task: TaskId) -> Rect {
        let TaskId::Tile(tile) = task else { return Rect::new(0, 0, self.width, self.height) };
        let across = self.counts()[0];
        let (col, row) = (tile % across * self.side, tile / across * self.side);
        let (width, height) = (self.side.min(self.width - col), self.side.min(self.height - row));
        Rect::new(col, row, width, height)
    }
}

/// Cells along a tile with about [`TILE_POINTS`] points.
fn fair_side(cells: u64, points: u64) -> u32 {
    let a_point = cells as f64 / points.max(1) as f64;
    let blocks = ((TILE_POINTS * a_point).sqrt() / f64::from(BLOCK)).round();
    BLOCK * (blocks as u32).clamp(1, MOST_SIDE / BLOCK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_cell_once() {
        for (width, height, side) in [(1, 1, 256), (256, 256, 256), (1000, 300, 256), (513, 1, 512)]
        {
            let grid = Cells::sized(width, height, side);
            let mut seen = vec![0_u8; width as usize * height as usize];
            for tile in 0..grid.count() as u32 {
                let Rect { col, row, width: w, height: h } = grid.cells(TaskId::Tile(tile));
                for at in (row..row + h).flat_map(|row| (col..col + w).map(move |col| (col, row))) {
                    seen[(at.1 * width + at.0) as usize] += 1;
                }
            }
            assert!(seen.iter().all(|times| *times == 1), "{width} x {height} by {side}");
            assert!(!grid.has(TaskId::Tile(grid.count() as u32)));
        }
    }

    #[test]
    fn tiles_have_more_cells_where_points_are_fewer() {
        assert_eq!(fair_side(1, 1 << 60), BLOCK);
        assert_eq!(fair_side(1 << 40, 1), MOST_SIDE);
        assert_eq!(fair_side(1_000_000, 8_000_000), 2816);
    }

    #[test]
    fn tasks_have_names() {
        for task in [TaskId::Tile(17), TaskId::Finish] {
            assert_eq!(task.to_string().parse::<TaskId>().unwrap(), task);
        }
        assert!("strip-1".parse::<TaskId>().is_err() && "tile-x".parse::<TaskId>().is_err());
    }
}
