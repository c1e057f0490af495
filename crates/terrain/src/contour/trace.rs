//! The lines of one tile: read, traced and simplified.

use super::bands::TileBands;
use super::budget::ContourMemory;
use super::simplify::{MetricTolerance, Simplifier};
use super::tiles::ContourTiles;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_raster::GridSource;
use terrane_window::contour::{
    self as contour, ContourLevels, ContourScratch, ContourWindow, WindowContour, WindowContours,
};

/// What all workers share.
#[derive(Clone, Copy)]
pub(super) struct ContourTask<'a> {
    pub(super) source: &'a dyn GridSource,
    pub(super) levels: &'a ContourLevels,
    pub(super) tiles: ContourTiles,
    pub(super) budget: ContourMemory,
    pub(super) tolerance: Option<MetricTolerance>,
    pub(super) polygons: bool,
    pub(super) cancel: &'a Cancel,
}

/// The lines of a tile.
pub(super) struct TracedTile<'a> {
    pub(super) lines: &'a WindowContours,
    /// Vertices before anything was left out.
    pub(super) original_vertices: u64,
    /// Number of rings left out because they enclose no cell.
    pub(super) left_out: u64,
    pub(super) bands: Option<&'a TileBands>,
}

/// One thread and its buffers.
pub(super) struct ContourWorker<'a, 'b> {
    task: &'b ContourTask<'a>,
    narrow: Vec<f32>,
    wide: Vec<f64>,
    scratch: ContourScratch,
    lines: WindowContours,
    simplifier: Option<Simplifier>,
    bands: Option<TileBands>,
}

impl<'a, 'b> ContourWorker<'a, 'b> {
    pub(super) fn new(task: &'b ContourTask<'a>) -> Self {
        let transform = task.source.info().transform;
        Self {
            task,
            narrow: Vec::new(),
            wide: Vec::new(),
            scratch: ContourScratch::default(),
            lines: WindowContours::default(),
            simplifier: task.tolerance.map(|tolerance| Simplifier::new(tolerance, transform)),
            bands: task.polygons.then(TileBands::default),
        }
    }

    /// Reads, traces and simplifies a tile.
    pub(super) fn trace(&mut self, tile: u64) -> Result<TracedTile<'_>> {
        let ContourTask { source, tiles, .. } = *self.task;
        let rect = tiles.rect(tile);
        if source.info().exact_in_f32() {
            self.narrow.resize(rect.len(), 0.0);
            source.read_f32(rect, &mut self.narrow)?;
            Self::lines_of(self.task, rect, &self.narrow, &mut self.scratch, &mut self.lines)?;
        } else {
            self.wide.resize(rect.len(), 0.0);
            source.read_f64(rect, &mut self.wide)?;
            Self::lines_of(self.task, rect, &self.wide, &mut self.scratch, &mut self.lines)?;
        }
        source.release(tiles.done(tile));
        let original_vertices = self.lines.vertices.len() as u64;
        let left_out = leave_out(&mut self.lines);
        if let Some(bands) = &mut self.bands {
            let narrow = source.info().exact_in_f32();
            let (task, lines) = (self.task, &self.lines);
            match narrow {
                true => bands.fill((rect, &self.narrow), task, lines)?,
                false => bands.fill((rect, &self.wide), task, lines)?,
            }
        }
        let bands = self.bands.as_ref();
        let lines = match &mut self.simplifier {
            Some(simplifier) => {
                simplifier.simplify(&self.lines, rect, tiles, bands, self.task.cancel)?
            }
            None => &self.lines,
        };
        Ok(TracedTile { lines, original_vertices, left_out, bands })
    }

    fn lines_of<H: Copy + Into<f64>>(
        task: &ContourTask<'_>,
        rect: Rect,
        heights: &[H],
        scratch: &mut ContourScratch,
        lines: &mut WindowContours,
    ) -> Result<()> {
        let window = ContourWindow { rect, grid_width: task.tiles.width, heights };
        contour::trace(&window, task.levels, task.budget.crossings, scratch, lines, task.cancel)
    }
}

/// True for a ring that encloses no cell.
fn is_empty_ring(line: &WindowContour) -> bool {
    line.closed && line.around == Some(0)
}

/// Removes rings that enclose no cell; returns their number.
fn leave_out(lines: &mut WindowContours) -> u64 {
    if !lines.lines.iter().any(is_empty_ring) {
        return 0;
    }
    let mut kept = WindowContours::default();
    for (index, line) in lines.lines.iter().enumerate().filter(|(_, line)| !is_empty_ring(line)) {
        kept.vertices.extend_from_slice(lines.of(index));
        kept.lines.push(WindowContour { end: kept.vertices.len(), ..*line });
    }
    let left_out = lines.lines.len() - kept.lines.len();
    *lines = kept;
    left_out as u64
}
