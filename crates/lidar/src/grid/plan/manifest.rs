//! The manifest of the plan of a grid: the job, and the tiling of its cells.

use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::tile::OpenedCloudGrid;
use crate::grid::extent::GridExtent;
use crate::grid::job::GridJob;
use crate::grid::surface_model::CloudOverview;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;
use terrane_cloud::{self as cloud, PointSource};
use terrane_engine::memory::beside_polygons;
use terrane_engine::plan::{self, OutputRequest};
use terrane_files::{name_of, path_of};

/// Sides of tiles are multiples of this many cells, the usual blocks of files.
pub(super) const BLOCK: u32 = 256;
/// Most cells along a tile.
pub(super) const MOST_SIDE: u32 = 1 << 14;
/// Approximate default number of points of a tile.
const TILE_POINTS: f64 = (1_u64 << 26) as f64;

/// A grid to make of a cloud.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct CloudGridPlan {
    /// The job, with paths that are valid wherever a task runs on this file system.
    pub(super) method: GridJob,
    pub(super) grid: PlannedCells,
    /// Statistics of the whole point cloud for a terrain model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) seen: Option<CloudOverview>,
}

/// The cells, as found when the plan was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PlannedCells {
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

/// A task: a tile by its number, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct GridTileTask(pub(super) u32);

impl fmt::Display for GridTileTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tile-{}", self.0)
    }
}

impl CloudGridPlan {
    /// The plan of an opened job; tiles have `side` cells a side, or the default.
    pub(super) fn new(
        OpenedCloudGrid { job, points, extent, seen }: &OpenedCloudGrid,
        side: Option<u32>,
    ) -> Result<Self> {
        let grid = PlannedCells::of(&**points, extent, side);
        limits::check("number of tiles", grid.count(), plan::MAX_TASKS)?;
        let mut method = GridJob { format: Some(job.format()?.name.to_owned()), ..job.clone() };
        method.placement.like = method.placement.like.map(absolute).transpose()?;
        if !points.files().is_empty() {
            let files = points.files().iter().cloned();
            method.input = files.map(absolute).collect::<Result<_>>()?;
        }
        Ok(Self { method, grid, seen: seen.clone() })
    }

    /// Its input files, from an opened point cloud.
    pub(super) fn files(&self, points: &dyn PointSource) -> Vec<PathBuf> {
        let on_disk = if points.files().is_empty() { &[][..] } else { &self.method.input };
        let all = on_disk.iter().chain(&self.method.placement.like);
        all.map(|name| path_of(name).into_owned()).collect()
    }

    /// Opens the point cloud and computes the cells; fails if they differ from those of the plan.
    pub(super) fn open(&self, label: &str, order: OutputRequest) -> Result<OpenedCloudGrid> {
        let OutputRequest { output, overwrite, resources, .. } = order;
        let resources = beside_polygons(&self.method.cloud, &resources);
        let mut job = GridJob { output, overwrite, resources, ..self.method.clone() };
        job.cloud.threads = job.resources.threads;
        let points = cloud::source(&job.input, &job.cloud)?;
        let extent = GridExtent::new(points.info(), &job)?;
        let here = PlannedCells::of(&*points, &extent, Some(self.grid.side));
        plan::refuse_another("cloud", label, &self.grid, &here)?;
        Ok(OpenedCloudGrid { job, points, extent, seen: self.seen.clone() })
    }

    /// Fails if there are no cells, or too many.
    pub(super) fn check_cells(&self) -> Result<()> {
        let PlannedCells { width, height, side, .. } = self.grid;
        let is_side = side > 0 && side.is_multiple_of(BLOCK) && side <= MOST_SIDE;
        if !is_side || width == 0 || height == 0 {
            return Err(Error::bad_input("it has no cells, or an invalid tile size"));
        }
        limits::check("number of columns or rows", width.max(height).into(), limits::MAX_SIDE)?;
        limits::check("number of tiles", self.grid.count(), plan::MAX_TASKS)
    }
}

/// A path that is valid wherever a task runs on this file system.
fn absolute(path: String) -> Result<String> {
    name_of(plan::noted_path(&path_of(&path))?)
}

impl PlannedCells {
    fn of(points: &dyn PointSource, extent: &GridExtent, side: Option<u32>) -> Self {
        let Rect { col, row, width, height } = extent.output;
        let t = extent.lattice.transform().shifted(f64::from(col), f64::from(row));
        let info = points.info();
        let crs = extent.crs.wkt.clone().unwrap_or_else(|| extent.crs.label());
        let points = info.count;
        let side =
            side.unwrap_or_else(|| default_side(u64::from(width) * u64::from(height), points));
        Self { width, height, side, points, first: [t.x0, t.y0], crs }
    }

    /// Cells of any point cloud.
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

    /// All tiles, row by row.
    pub(super) fn tiles(&self) -> impl Iterator<Item = GridTileTask> + use<> {
        (0..self.count() as u32).map(GridTileTask)
    }

    /// All cells.
    pub(super) fn all(&self) -> Rect {
        Rect::new(0, 0, self.width, self.height)
    }

    /// The cells of a tile.
    pub(super) fn cells(&self, GridTileTask(tile): GridTileTask) -> Rect {
        let across = self.counts()[0];
        let (col, row) = (tile % across * self.side, tile / across * self.side);
        let (width, height) = (self.side.min(self.width - col), self.side.min(self.height - row));
        Rect::new(col, row, width, height)
    }
}

/// Cells along a tile with about [`TILE_POINTS`] points.
fn default_side(cells: u64, points: u64) -> u32 {
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
            let grid = PlannedCells::sized(width, height, side);
            let mut seen = vec![0_u8; width as usize * height as usize];
            for tile in grid.tiles() {
                let Rect { col, row, width: w, height: h } = grid.cells(tile);
                for at in (row..row + h).flat_map(|row| (col..col + w).map(move |col| (col, row))) {
                    seen[(at.1 * width + at.0) as usize] += 1;
                }
            }
            assert!(seen.iter().all(|times| *times == 1), "{width} x {height} by {side}");
        }
    }

    #[test]
    fn tiles_have_more_cells_where_points_are_fewer() {
        assert_eq!(default_side(1, 1 << 60), BLOCK);
        assert_eq!(default_side(1 << 40, 1), MOST_SIDE);
        assert_eq!(default_side(1_000_000, 8_000_000), 2816);
    }
}
