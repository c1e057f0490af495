//! Estimates the resources for a grid by making a few small tiles.

use std::path::Path;
use std::time::Instant;

use tempfile::TempDir;

use super::manifest::{BLOCK, GridTileTask, PlannedCells};
use super::tile::OpenedCloudGrid;
use crate::grid::budget::{GridBudget, GridWorkload};
use crate::grid::extent::GridExtent;
use crate::grid::job::GridJob;
use crate::grid::region_points::CellSurroundings;
use crate::grid::surface_model;
use crate::point_index::parts_in;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::memory::polygon_bytes;
use terrane_engine::plan::{PlanNeeds, RunControl, shared};
use terrane_files::name_of;
use terrane_gridding::StatisticRecipe;

/// Small tiles along each side of the grid.
const ALONG: u32 = 4;
/// Most points to read for one: in an unordered point cloud, each would read much of it.
const MAX_POINTS: u64 = 1 << 22;
/// Most tiles whose points are counted.
const MAX_COUNTED: usize = 256;
/// Nanoseconds of one thread for a point of LAZ that is put into its cell, and for one that is triangulated, as
/// measured on one machine; see benches/history/2026.md, 7. The second applies if nothing is sampled; the cost
/// of statistics depends on their radius and kind more than on the points.
const POINT: [f64; 2] = [130.0, 400.0];
/// Nanoseconds for a point of a ground method, halos included.
const FOUND: f64 = 15_000.0;
/// Nanoseconds for a point of a spike-free surface, halos included.
const FROZEN: f64 = 2_000.0;
/// Nanoseconds for a cell that is written.
const CELL: f64 = 60.0;
/// Safety factor: small tiles underestimate borders and tables of larger files.
const MARGIN: f64 = 1.06;

/// Resources of the plan of a grid with these `cells`.
pub(super) fn expect(
    opened: &OpenedCloudGrid,
    cells: &PlannedCells,
    at: RunControl<'_>,
) -> Result<PlanNeeds> {
    let folder = opened.job.resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    let folder = TempDir::new_in(&folder).map_err(|e| Error::write(&folder, e))?;
    let samples = sample_tiles(cells);
    let least = LeastMemory::of(opened, cells, folder.path())?;
    let mut seen = GridProbe { block: least.block, ..GridProbe::default() };
    at.progress.begin("sample", samples.len() as u64);
    for (number, rect) in samples.iter().enumerate() {
        let folder = folder.path().join(number.to_string());
        std::fs::create_dir(&folder).map_err(|e| Error::write(&folder, e))?;
        if let Some(sample) = probe(opened, *rect, &folder, at.silent())? {
            seen.add(*rect, sample);
        }
        at.progress.advance(1);
    }
    at.progress.end();
    let [objects, output] = seen.all(&opened.job, cells.all())?;
    let read = to_read(opened, cells) as f64;
    let points = match seen.making().filter(|_| !is_found(opened)) {
        Some(cell) => read * POINT[0] * 1e-9 + cells.all().len() as f64 * cell,
        None => read * point(opened) * 1e-9,
    };
    let writing = cells.all().len() as f64 * CELL * 1e-9;
    // What one thread cannot do without is more than a further one takes.
    let (memory, thread_memory) = (least.memory, least.memory);
    let memory = memory + polygon_bytes(&opened.job.cloud);
    Ok(PlanNeeds { memory, thread_memory, objects, output, seconds: [points + writing, writing] })
}

/// Whether a ground method or a spike-free surface works in tiles with halos, which small tiles overestimate.
fn is_found(OpenedCloudGrid { job, seen, .. }: &OpenedCloudGrid) -> bool {
    seen.as_ref().is_some_and(|seen| job.needs_ground() && !seen.by_class || seen.square > 0)
}

/// Nanoseconds for a point, if not measured.
fn point(opened: &OpenedCloudGrid) -> f64 {
    let OpenedCloudGrid { job, seen, extent, .. } = opened;
    let recipe = StatisticRecipe::new(&job.stats, &job.rules(extent.cell()));
    let usual = match seen {
        Some(seen) if job.needs_ground() && !seen.by_class => FOUND,
        _ => POINT[usize::from(recipe.triangulates())],
    };
    let freezes = seen.as_ref().is_some_and(|seen| seen.square > 0);
    usual + if freezes { FROZEN } else { 0.0 }
}

/// Points that all tiles read: each reads all parts with points near it.
fn to_read(opened: &OpenedCloudGrid, cells: &PlannedCells) -> u64 {
    let tiles: Vec<GridTileTask> = cells.tiles().collect();
    let stride = tiles.len().div_ceil(MAX_COUNTED).max(1);
    let counted = tiles.iter().step_by(stride);
    let count = counted.len() as u64;
    let points: u64 =
        counted.map(|tile| points_near(opened, opened.near(cells.cells(*tile)))).sum();
    (u128::from(points) * tiles.len() as u128 / u128::from(count.max(1))) as u64
}

/// Points of the parts near a tile.
fn points_near(opened: &OpenedCloudGrid, near: Option<CellSurroundings>) -> u64 {
    let points = &*opened.points;
    match near {
        Some(near) => {
            let parts = parts_in(points, &near.window());
            parts.iter().map(|part| points.points_of(*part)).sum()
        }
        None => points.info().count,
    }
}

/// A sampled tile.
struct GridTileSample {
    /// Bytes of the tile, and of the grid written from it.
    bytes: [u64; 2],
    /// Points read.
    points: u64,
    /// Seconds that one thread would have taken.
    seconds: f64,
}

/// Sampled cells and their cost.
#[derive(Default)]
struct GridProbe {
    points: u64,
    seconds: f64,
    cells: u64,
    /// Cells, with the padding of blocks of the written grid.
    padded: u64,
    tiles: u64,
    written: u64,
    /// Columns and rows of a block of the written grid.
    block: (u32, u32),
}

impl GridProbe {
    fn add(&mut self, rect: Rect, sample: GridTileSample) {
        let [tile, written] = sample.bytes;
        self.points += sample.points;
        self.seconds += sample.seconds;
        self.cells += rect.len() as u64;
        self.padded += self.padded(rect);
        self.tiles += tile;
        self.written += written;
    }

    /// Seconds of one thread for the values of a cell, without reading points; `None` if nothing was sampled.
    fn making(&self) -> Option<f64> {
        let reading = self.points as f64 * POINT[0] * 1e-9;
        (self.cells > 0).then(|| (self.seconds - reading).max(0.0) / self.cells as f64)
    }

    fn padded(&self, rect: Rect) -> u64 {
        let (width, height) = self.block;
        let [width, height] = [(rect.width, width), (rect.height, height)]
            .map(|(cells, block)| u64::from(cells).next_multiple_of(block.max(1).into()));
        width * height
    }

    /// Bytes of all tiles and of the written grid, as an upper estimate; uncompressed if nothing was sampled.
    fn all(&self, job: &GridJob, all: Rect) -> Result<[u64; 2]> {
        let values = job.stats.len() as u64;
        let plain = values * job.sample_type.bytes() as u64;
        let overviews = if job.format()?.has_overviews() { 4.0 / 3.0 } else { 1.0 };
        let cells = all.len() as u64;
        let (tiles, written) = match self.cells {
            0 => ((cells * values * 8) as f64, (self.padded(all) * plain) as f64),
            // What is not compressed fills its blocks.
            _ if self.written >= self.padded * plain => {
                let written = scaled(self.written, self.padded, self.padded(all));
                (scaled(self.tiles, self.cells, cells), written)
            }
            seen => (scaled(self.tiles, seen, cells), scaled(self.written, seen, cells)),
        };
        Ok([tiles as u64, (written * overviews) as u64])
    }
}

/// Estimated bytes of all cells from those of a sample.
fn scaled(bytes: u64, sampled: u64, all: u64) -> f64 {
    MARGIN * bytes as f64 * all as f64 / sampled as f64
}

/// Small tiles, evenly over the cells in both directions.
fn sample_tiles(cells: &PlannedCells) -> Vec<Rect> {
    let (width, height) = (BLOCK.min(cells.width), BLOCK.min(cells.height));
    let cols = sample_starts(cells.width);
    let rows = sample_starts(cells.height);
    rows.flat_map(|row| cols.clone().map(move |col| Rect::new(col, row, width, height))).collect()
}

/// The first columns, or rows, of small tiles along an axis with this number of cells.
fn sample_starts(cells: u32) -> impl Iterator<Item = u32> + Clone {
    // Of a small grid no more than a quarter is made.
    let count = (cells.div_ceil(BLOCK) / 2).clamp(1, ALONG);
    let range = u64::from(cells - BLOCK.min(cells));
    (0..count).map(move |i| (range * u64::from(2 * i + 1) / u64::from(2 * count)) as u32)
}

/// A small tile, and the grid written from it; `None` if it has to read too much.
fn probe(
    opened: &OpenedCloudGrid,
    rect: Rect,
    folder: &Path,
    at: RunControl<'_>,
) -> Result<Option<GridTileSample>> {
    at.cancel.check()?;
    let near = opened.near(rect);
    if points_near(opened, near) > MAX_POINTS {
        return Ok(None);
    }
    let (tile, started) = (folder.join("tile.tif"), Instant::now());
    let Some(made) = opened.try_make(rect, &tile, near, at)? else {
        return Ok(None);
    };
    let seconds = started.elapsed().as_secs_f64() / shared(1.0, made.run.threads);
    let extent = opened.extent.part(rect, opened.points.info());
    let files = [name_of(tile)?];
    let job = written_in(&opened.job, folder)?;
    let written = opened.write(&files, &job, &extent, at)?;
    let bytes = [made.output_bytes, written.output_bytes];
    Ok(Some(GridTileSample { bytes, points: made.points.read, seconds }))
}

/// The job whose output is in `folder`.
fn written_in(job: &GridJob, folder: &Path) -> Result<GridJob> {
    let format = job.format()?;
    let output = folder.join("grid").with_extension(format.extensions[0]);
    Ok(GridJob { output, format: Some(format.name.to_owned()), ..job.clone() })
}

/// The least that the work needs.
struct LeastMemory {
    /// Bytes, for the largest tile and for the writing of the grid.
    memory: u64,
    /// Columns and rows of a block of the written grid.
    block: (u32, u32),
}

impl LeastMemory {
    fn of(opened: &OpenedCloudGrid, cells: &PlannedCells, folder: &Path) -> Result<Self> {
        let tile = opened.extent.part(cells.cells(GridTileTask(0)), opened.points.info());
        let tile = Self::to_write(&opened.job_of(&folder.join("tile.tif")), &tile)?;
        // Formats without blocks have lines as long as the grid is wide.
        let rows = Rect::new(0, 0, cells.width, BLOCK.min(cells.height));
        let rows = opened.extent.part(rows, opened.points.info());
        let rows = Self::to_write(&written_in(&opened.job, folder)?, &rows)?;
        let ground =
            surface_model::min_memory(&opened.job, opened.points.info(), opened.seen.as_ref());
        Ok(Self { memory: rows.memory.max(tile.memory).max(ground), ..rows })
    }

    fn to_write(job: &GridJob, extent: &GridExtent) -> Result<Self> {
        let (format, info) = (job.format()?, extent.written(job));
        let recipe = StatisticRecipe::new(&job.stats, &job.rules(extent.cell()));
        let sink = format.create(&job.output, &info, &job.write_options())?;
        let work = GridWorkload { format, sink: sink.as_ref(), extent, recipe: &recipe };
        let memory = GridBudget::min_memory(work);
        Ok(Self { memory, block: sink.block() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lie_within_and_are_few() {
        for (width, height, count) in
            [(1, 1, 1), (256, 300, 1), (257, 5000, 4), (1100, 1100, 4), (80_000, 80_000, 16)]
        {
            let cells = PlannedCells::sized(width, height, BLOCK);
            let places = sample_tiles(&cells);
            assert_eq!(places.len(), count, "{width} x {height}");
            assert!(places.iter().all(|p| p.col + p.width <= width && p.row + p.height <= height));
            let distinct = |i: usize| places[..i].iter().all(|other| *other != places[i]);
            assert!((0..count).all(distinct), "{width} x {height}");
        }
    }
}
