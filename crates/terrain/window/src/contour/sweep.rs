//! One pass over a window, row by row: crossings of lines with edges, and segments in cells.
//!
//! A sample is known by its rank among the levels; an edge is crossed by the levels between the ranks of its
//! ends. Most samples have the ranks of their neighbours, which a few instructions compare for many at a time.

use super::levels::{ContourLevels, VOID};
use terrane_base::Cancel;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;

/// How near to a sample an edge is crossed, in parts of the edge.
pub const NEAREST: f64 = 1.0 / 65_536.0;

/// Samples to trace: a rectangle of a grid.
#[derive(Clone, Copy, Debug)]
pub struct ContourWindow<'a, H> {
    /// Where they are in the grid.
    pub rect: Rect,
    /// Columns of the grid.
    pub grid_width: u32,
    /// Row by row; NaN for voids.
    pub heights: &'a [H],
}

/// Marks the lack of a node.
pub(super) const NONE: u32 = u32::MAX;

/// A segment ends at the node.
pub(super) const ENTERED: u32 = 1;
/// The higher sample of the edge is exactly on the level.
pub(super) const EXACT: u32 = 2;
/// The node is in a line already.
pub(super) const TAKEN: u32 = 4;

/// A crossing of an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossingNode {
    /// How far along the edge.
    pub(super) at: f64,
    /// The edge: twice the index of its first sample in the window, plus one where it goes down.
    pub(super) edge: u32,
    pub(super) level: i32,
    /// The node at the end of the segment that begins here, or [`NONE`].
    pub(super) next: u32,
    pub(super) marks: u32,
}

/// Columns of a chunk.
const CHUNK: usize = 16;

/// The state of a pass, and its result.
#[derive(Debug, Default)]
pub(super) struct ContourSweep {
    pub(super) nodes: Vec<CrossingNode>,
    /// Ranks of the row above, and of the row at hand.
    above: Vec<i32>,
    ranks: Vec<i32>,
    /// The first node of each edge that is crossed: edges along the row above, those along the row at
    /// hand, and those between the two.
    along_above: Vec<u32>,
    along: Vec<u32>,
    down: Vec<u32>,
    /// Chunks in which an edge along the row above is crossed.
    busy_above: Vec<bool>,
    busy: Vec<bool>,
}

impl ContourSweep {
    /// Fills `nodes`, linked by segments.
    pub(super) fn run<H: Copy + Into<f64>>(
        &mut self,
        window: &ContourWindow<'_, H>,
        levels: &ContourLevels,
        max_crossings: u64,
        cancel: &Cancel,
    ) -> Result<()> {
        let (width, height) = (window.rect.width as usize, window.rect.height as usize);
        self.nodes.clear();
        for ranks in [&mut self.above, &mut self.ranks] {
            ranks.resize(width, 0);
        }
        for firsts in [&mut self.along_above, &mut self.along, &mut self.down] {
            firsts.resize(width, 0);
        }
        for busy in [&mut self.busy_above, &mut self.busy] {
            busy.resize(width.div_ceil(CHUNK), false);
        }
        for row in 0..height {
            cancel.check()?;
            std::mem::swap(&mut self.above, &mut self.ranks);
            std::mem::swap(&mut self.along_above, &mut self.along);
            std::mem::swap(&mut self.busy_above, &mut self.busy);
            let heights = &window.heights[row * width..][..width];
            let ranked = levels.rank(heights, &mut self.ranks);
            ranked.map_err(|col| no_rank(window, col, row))?;
            SweepRow { window, levels, max_crossings, row, width }.sweep(self)?;
        }
        Ok(())
    }
}

/// One step of a pass: a row of samples, and the cells between it and the row above.
struct SweepRow<'a, 'b, H> {
    window: &'a ContourWindow<'b, H>,
    levels: &'a ContourLevels,
    max_crossings: u64,
    row: usize,
    width: usize,
}

impl<H: Copy + Into<f64>> SweepRow<'_, '_, H> {
    fn sweep(&self, s: &mut ContourSweep) -> Result<()> {
        for (chunk, start) in (0..self.width).step_by(CHUNK).enumerate() {
            let end = (start + CHUNK).min(self.width);
            let last = (end + 1).min(self.width);
            let along = differ(&s.ranks[start..last - 1], &s.ranks[start + 1..last]);
            let down = self.row > 0 && differ(&s.above[start..end], &s.ranks[start..end]);
            s.busy[chunk] = along;
            if along {
                (start..last - 1).try_for_each(|col| self.cross_along(s, col))?;
            }
            if down {
                (start..end).try_for_each(|col| self.cross_down(s, col))?;
            }
            // The last cell of a chunk has an edge in the next one.
            let cells = start.saturating_sub(1)..end - 1;
            if self.row > 0 && (along || down || s.busy_above[chunk]) {
                cells.for_each(|col| self.join(s, col));
            } else if self.row > 0 && start > 0 {
                self.join(s, start - 1);
            }
        }
        Ok(())
    }

    fn height(&self, row: usize, col: usize) -> f64 {
        self.window.heights[row * self.width + col].into()
    }

    fn cross_along(&self, s: &mut ContourSweep, col: usize) -> Result<()> {
        let ranks = [s.ranks[col], s.ranks[col + 1]];
        if is_crossed(ranks) {
            s.along[col] = s.nodes.len() as u32;
            let heights = [self.height(self.row, col), self.height(self.row, col + 1)];
            self.cross(s, 2 * (self.row * self.width + col), ranks, heights)?;
        }
        Ok(())
    }

    fn cross_down(&self, s: &mut ContourSweep, col: usize) -> Result<()> {
        let ranks = [s.above[col], s.ranks[col]];
        if is_crossed(ranks) {
            s.down[col] = s.nodes.len() as u32;
            let heights = [self.height(self.row - 1, col), self.height(self.row, col)];
            self.cross(s, 2 * ((self.row - 1) * self.width + col) + 1, ranks, heights)?;
        }
        Ok(())
    }

    /// Appends the crossings of an edge, upwards.
    fn cross(
        &self,
        s: &mut ContourSweep,
        edge: usize,
        ranks: [i32; 2],
        heights: [f64; 2],
    ) -> Result<()> {
        let (low, high) = (ranks[0].min(ranks[1]), ranks[0].max(ranks[1]));
        if s.nodes.len() as u64 + u64::from(high.abs_diff(low)) > self.max_crossings {
            return Err(too_many(self.max_crossings));
        }
        let [from, to] = heights;
        let highest = from.max(to);
        for level in low + 1..=high {
            let height = self.levels.height(level);
            // A crossing in a sample itself would be one position for all of its edges, and lines would touch there.
            let at = ((height - from) / (to - from)).clamp(NEAREST, 1.0 - NEAREST);
            let marks = if height == highest { EXACT } else { 0 };
            s.nodes.push(CrossingNode { at, edge: edge as u32, level, next: NONE, marks });
        }
        Ok(())
    }

    /// Joins the crossings of the cell whose first sample is in the row above.
    #[inline]
    fn join(&self, s: &mut ContourSweep, col: usize) {
        let corners = [s.above[col], s.above[col + 1], s.ranks[col + 1], s.ranks[col]];
        let [nw, ne, se, sw] = corners;
        if nw == ne && ne == se && se == sw || corners.contains(&VOID) {
            return;
        }
        let (low, high) = (nw.min(ne).min(se.min(sw)), nw.max(ne).max(se.max(sw)));
        // In the order of sides: north, east, south, west.
        let firsts = [s.along_above[col], s.down[col + 1], s.along[col], s.down[col]];
        let lows = [nw.min(ne), ne.min(se), se.min(sw), sw.min(nw)];
        for level in low + 1..=high {
            let above = corners.map(|rank| rank >= level);
            let node = |side: usize| firsts[side].wrapping_add((level - lows[side] - 1) as u32);
            match above {
                [true, false, true, false] | [false, true, false, true] => {
                    // A corner that is above is cut off when the middle is below, and the other way
                    // round; it is the corner between the sides `cut` and `cut` + 1.
                    let first = usize::from(above[0] == self.middle_is_above(col, level));
                    for corner in [first, first + 2] {
                        let (side, before) = (corner % 4, (corner + 3) % 4);
                        link(s, above[corner % 4], node(side), node(before));
                    }
                }
                _ => {
                    // The side where the line enters has its right end, seen from the middle, above.
                    let enters = (0..4).find(|&side| above[side] && !above[(side + 1) % 4]);
                    let leaves = (0..4).find(|&side| !above[side] && above[(side + 1) % 4]);
                    if let (Some(from), Some(to)) = (enters, leaves) {
                        link(s, true, node(from), node(to));
                    }
                }
            }
        }
    }

    fn middle_is_above(&self, col: usize, level: i32) -> bool {
        let [above, below] =
            [self.row - 1, self.row].map(|row| self.height(row, col) + self.height(row, col + 1));
        (above + below) / 4.0 >= self.levels.height(level)
    }
}

/// Makes a segment, or the one the other way.
#[inline]
fn link(s: &mut ContourSweep, is_forward: bool, from: u32, to: u32) {
    let (from, to) = if is_forward { (from, to) } else { (to, from) };
    s.nodes[from as usize].next = to;
    s.nodes[to as usize].marks |= ENTERED;
}

#[inline]
fn is_crossed(ranks: [i32; 2]) -> bool {
    ranks[0] != ranks[1] && ranks[0] != VOID && ranks[1] != VOID
}

/// True when two rows differ anywhere.
#[inline]
fn differ(a: &[i32], b: &[i32]) -> bool {
    a.iter().zip(b).fold(0, |bits, (a, b)| bits | (a ^ b)) != 0
}

fn no_rank<H: Copy + Into<f64>>(window: &ContourWindow<'_, H>, col: usize, row: usize) -> Error {
    let height: f64 = window.heights[row * window.rect.width as usize + col].into();
    let (col, row) = (col + window.rect.col as usize, row + window.rect.row as usize);
    Error::bad_input(format!(
        "the height {height:e} at column {col}, row {row} is too large for the contour interval"
    ))
    .remedy(format!("pass ‹nodata› {height:e} if it is nodata, or raise ‹interval›"))
}

fn too_many(max_crossings: u64) -> Error {
    Error::new(ErrorKind::Resource, format!("more than {max_crossings} contour vertices in a tile"))
        .remedy("raise ‹memory› or ‹interval›, or reduce ‹tile›")
}
