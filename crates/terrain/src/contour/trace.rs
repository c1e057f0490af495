//! The lines of one tile: read, traced and simplified.

use super::budget::Budget;
use super::simplify::{Simplifier, Tolerance};
use super::tiles::Tiles;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_raster::GridSource;
use terrane_window::contour::{self as contour, Levels, Line, Lines, Scratch, Window};

/// What all workers share.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) source: &'a dyn GridSource,
    pub(super) levels: &'a Levels,
    pub(super) tiles: Tiles,
    pub(super) budget: Budget,
    pub(super) tolerance: Option<Tolerance>,
    pub(super) cancel: &'a Cancel,
}

/// The lines of a tile.
pub(super) struct Traced<'a> {
    pub(super) lines: &'a Lines,
    /// Vertices before anything was left out.
    pub(super) original_vertices: u64,
    /// Rings around nothing, which are not among the lines.
    pub(super) left_out: u64,
}

/// One thread and its buffers.
pub(super) struct Worker<'a, 'b> {
    task: &'b Task<'a>,
    narrow: Vec<f32>,
    wide: Vec<f64>,
    scratch: Scratch,
    lines: Lines,
    simplifier: Option<Simplifier>,
}

impl<'a, 'b> Worker<'a, 'b> {
    pub(super) fn new(task: &'b Task<'a>) -> Self {
        let transform = task.source.info().transform;
        Self {
            task,
            narrow: Vec::new(),
            wide: Vec::new(),
            scratch: Scratch::default(),
            lines: Lines::default(),
            simplifier: task.tolerance.map(|tolerance| Simplifier::new(tolerance, transform)),
        }
    }

    /// Reads, traces and simplifies a tile.
    pub(super) fn trace(&mut self, tile: u64) -> Result<Traced<'_>> {
        let Task { source, tiles, .. } = *self.task;
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
        let lines = match &mut self.simplifier {
            Some(simplifier) => simplifier.simplify(&self.lines, rect, tiles, self.task.cancel)?,
            None => &self.lines,
        };
        Ok(Traced { lines, original_vertices, left_out })
    }

    fn lines_of<H: Copy + Into<f64>>(
        task: &Task<'_>,
        rect: Rect,
        heights: &[H],
        scratch: &mut Scratch,
        lines: &mut Lines,
    ) -> Result<()> {
        let window = Window { rect, grid_width: task.tiles.width, heights };
        contour::trace(&window, task.levels, task.budget.crossings, scratch, lines, task.cancel)
    }
}

/// Takes out the rings that go around nothing; how many.
fn leave_out(lines: &mut Lines) -> u64 {
    let is_nothing = |line: &Line| line.closed && line.around == Some(0);
    if !lines.lines.iter().any(is_nothing) {
        return 0;
    }
    let mut kept = Lines::default();
    for (index, line) in lines.lines.iter().enumerate().filter(|(_, line)| !is_nothing(line)) {
        kept.vertices.extend_from_slice(lines.of(index));
        kept.lines.push(Line { end: kept.vertices.len(), ..*line });
    }
    let left_out = lines.lines.len() - kept.lines.len();
    *lines = kept;
    left_out as u64
}
