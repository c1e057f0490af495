//! Segments made lines, by following them from node to node.

use super::sweep::{CrossingNode, ENTERED, EXACT, NONE, TAKEN};
use super::vertex::{ContourVertex, CrossedEdge};
use terrane_base::Cancel;
use terrane_base::error::Result;
use terrane_base::geom::Rect;

/// A line of [`WindowContours`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowContour {
    /// The number of its level.
    pub level: i32,
    /// One past its last vertex.
    pub end: usize,
    /// True for a ring: its last vertex is its first again.
    pub closed: bool,
    /// For a line along samples that are exactly on the level: the sum of the cross products of each such
    /// sample (column, row) with the next, in wrapping arithmetic. 0 for a ring around samples without a cell
    /// among them; sums of parts add up.
    pub around: Option<i64>,
}

/// The lines of a window, each directed with higher ground on its right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowContours {
    /// The vertices of all lines, one after the other.
    pub vertices: Vec<ContourVertex>,
    /// The lines: first those that end at the rim or at voids, then rings.
    pub lines: Vec<WindowContour>,
}

impl WindowContours {
    /// Forgets all lines.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.lines.clear();
    }

    /// The vertices of line `index`.
    pub fn of(&self, index: usize) -> &[ContourVertex] {
        let start = index.checked_sub(1).map_or(0, |before| self.lines[before].end);
        &self.vertices[start..self.lines[index].end]
    }

    /// Fills itself from the nodes of a window.
    pub(super) fn link(
        &mut self,
        nodes: &mut [CrossingNode],
        rect: Rect,
        grid_width: u32,
        cancel: &Cancel,
    ) -> Result<()> {
        let frame = ContourFrame { rect, grid_width };
        for only_open in [true, false] {
            for first in 0..nodes.len() {
                let CrossingNode { next, marks, .. } = nodes[first];
                let is_start = marks & ENTERED == 0 || !only_open;
                if next != NONE && marks & TAKEN == 0 && is_start {
                    cancel.check()?;
                    self.follow(nodes, first, frame);
                }
            }
        }
        Ok(())
    }

    /// Appends the line from node `first` on, to its end or back to `first`.
    fn follow(&mut self, nodes: &mut [CrossingNode], first: usize, frame: ContourFrame) {
        let level = nodes[first].level;
        let start = self.vertices.len();
        let (mut at, mut is_exact, mut closed) = (first, true, false);
        loop {
            let node = &mut nodes[at];
            node.marks |= TAKEN;
            is_exact &= node.marks & EXACT != 0;
            self.vertices.push(frame.vertex(node));
            if node.next == NONE {
                break;
            }
            at = node.next as usize;
            if at == first {
                closed = true;
                self.vertices.push(self.vertices[start]);
                break;
            }
        }
        let around = is_exact.then(|| around(&self.vertices[start..], frame.grid_width));
        self.lines.push(WindowContour { level, end: self.vertices.len(), closed, around });
    }
}

/// See [`WindowContour::around`].
fn around(vertices: &[ContourVertex], grid_width: u32) -> i64 {
    vertices.windows(2).fold(0, |sum: i64, pair| {
        let [(ax, ay), (bx, by)] = [pair[0], pair[1]].map(|vertex| {
            let (col, row) = vertex.nearer(grid_width);
            (i64::from(col), i64::from(row))
        });
        sum.wrapping_add(ax.wrapping_mul(by).wrapping_sub(ay.wrapping_mul(bx)))
    })
}

/// From a window to its grid.
#[derive(Clone, Copy)]
struct ContourFrame {
    rect: Rect,
    grid_width: u32,
}

impl ContourFrame {
    fn vertex(&self, node: &CrossingNode) -> ContourVertex {
        let (index, is_down) = (node.edge / 2, node.edge % 2 == 1);
        let (col, row) = (index % self.rect.width, index / self.rect.width);
        let (col, row) = (self.rect.col + col, self.rect.row + row);
        ContourVertex { edge: CrossedEdge::new(col, row, is_down, self.grid_width), at: node.at }
    }
}
