//! The tiles of a grid, and tracing one of them.

use super::Tolerance;
use super::budget::Budget;
use super::simplify::Simplifier;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_raster::{GridInfo, GridSource};
use terrane_window::contour::{self as contour, Levels, Line, Lines, Scratch, Vertex, Window};

/// Squares of cells; neighbours share the samples on their rim.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tiles {
    pub(super) width: u32,
    height: u32,
    cells: u32,
}

/// The four rims of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rim {
    North,
    East,
    South,
    West,
}

impl Tiles {
    pub(super) fn new(info: &GridInfo, cells: u32) -> Self {
        Self { width: info.width, height: info.height, cells }
    }

    fn across(&self) -> u32 {
        (self.width - 1).div_ceil(self.cells).max(1)
    }

    pub(super) fn count(&self) -> u64 {
        let down = (self.height - 1).div_ceil(self.cells).max(1);
        u64::from(self.across()) * u64::from(down)
    }

    /// The samples of a tile.
    pub(super) fn rect(&self, tile: u64) -> Rect {
        let across = u64::from(self.across());
        let (col, row) = ((tile % across) as u32 * self.cells, (tile / across) as u32 * self.cells);
        let (width, height) = (self.width - col, self.height - row);
        Rect::new(col, row, width.min(self.cells + 1), height.min(self.cells + 1))
    }

    /// The samples of a tile that no later one in its row or column has.
    fn done(&self, tile: u64) -> Rect {
        let rect = self.rect(tile);
        let is_last = [rect.end_col() == self.width, rect.end_row() == self.height];
        let [less_width, less_height] = is_last.map(|last| u32::from(!last));
        Rect::new(rect.col, rect.row, rect.width - less_width, rect.height - less_height)
    }

    /// How many samples a tile counts for.
    pub(super) fn owned(&self, tile: u64) -> u64 {
        self.done(tile).len() as u64
    }

    /// The rim of a tile, with another tile beyond it, that a vertex is on.
    pub(super) fn rim(&self, rect: Rect, vertex: &Vertex) -> Option<Rim> {
        let (col, row) = vertex.edge.first(self.width);
        let (east, south) = (rect.end_col() - 1, rect.end_row() - 1);
        match vertex.edge.is_down() {
            false if row == rect.row && row > 0 => Some(Rim::North),
            false if row == south && south + 1 < self.height => Some(Rim::South),
            true if col == rect.col && col > 0 => Some(Rim::West),
            true if col == east && east + 1 < self.width => Some(Rim::East),
            _ => None,
        }
    }
}

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

/// The vertex with the lowest edge.
pub(super) fn lowest(vertices: &[Vertex]) -> usize {
    let edge = |at: &usize| vertices[*at].edge;
    (0..vertices.len()).min_by_key(edge).unwrap_or(0)
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
