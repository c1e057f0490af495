//! Pieces of lines, joined where they meet on the rims of tiles.

use std::collections::HashMap;
use std::path::Path;

use bytemuck::Zeroable;

use super::bands::BandParts;
use super::budget::{ContourMemory, SIDE_BYTES, VERTEX_BYTES};
use super::tiles::{ContourTiles, lowest};
use super::trace::TracedTile;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_files::Buckets;
use terrane_window::contour::{ContourVertex, CrossedEdge};

/// Vertices handed over between two checks for cancellation.
const PUSHED: usize = 1 << 16;

/// Marks the lack of a piece.
const NONE: u32 = u32::MAX;

/// A part of a line, from one rim to another; or a whole one.
#[derive(Clone, Copy, Debug)]
struct ContourPiece {
    /// Address of its vertices.
    at: u64,
    /// Its first edge, and the lowest.
    first: CrossedEdge,
    low: CrossedEdge,
    /// See [`terrane_window::contour::WindowContour::around`].
    around: Option<i64>,
    count: u32,
    level: i32,
    /// The piece that continues from its last vertex, or [`NONE`]; itself if it is a ring.
    next: u32,
    /// True when another piece, or it itself, ends at its first vertex.
    is_entered: bool,
}

/// An open end that waits for its counterpart.
#[derive(Clone, Copy, Debug)]
enum OpenEnd {
    First(u32),
    Last(u32),
}

/// A line made of pieces. Lines are written in this order; no two are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct JoinedContour {
    /// The number of its level.
    pub(super) level: i32,
    /// Where it begins: of a ring, its lowest edge. A crossing belongs to one line only.
    pub(super) start: CrossedEdge,
    /// The first piece: of a ring, the one with that edge.
    first: u32,
    pub(super) closed: bool,
    /// See [`terrane_window::contour::WindowContour::around`].
    pub(super) around: Option<i64>,
}

/// All pieces so far.
pub(super) struct ContourPieces {
    pieces: Vec<ContourPiece>,
    /// Bytes for all of them and the sides of the border, and of one.
    waiting: u64,
    piece_bytes: u64,
    /// The vertices of all of them: one bucket.
    vertices: Buckets<ContourVertex>,
    /// Open ends by their crossing. Looked up only, so its order leaves no trace.
    ends: HashMap<(CrossedEdge, i32), OpenEnd>,
    pub(super) original_vertices: u64,
    pub(super) left_out: u64,
    /// What polygons need besides.
    pub(super) bands: Option<BandParts>,
}

impl ContourPieces {
    pub(super) fn new(budget: &ContourMemory, folder: &Path) -> Self {
        // The rest is for the vertices of a tile on their way here.
        let waiting = budget.vertices * VERTEX_BYTES / 3 * 2;
        Self {
            pieces: Vec::new(),
            waiting: budget.waiting,
            piece_bytes: budget.piece_bytes,
            vertices: Buckets::new(folder, 1, waiting),
            ends: HashMap::new(),
            original_vertices: 0,
            left_out: 0,
            bands: None,
        }
    }

    /// The error of more than fits into memory.
    fn too_many(&self) -> Error {
        let pieces = self.waiting / self.piece_bytes;
        let (what, remedy) = match self.bands {
            None => (
                format!("more than {pieces} contour segments"),
                "raise ‹memory›, ‹tile› or ‹interval›",
            ),
            Some(_) => (
                format!(
                    "more than {pieces} contour segments, or {} sides of voids",
                    self.waiting / SIDE_BYTES
                ),
                "raise ‹memory›, choose fewer levels, or fill voids first (‹terrane fill›)",
            ),
        };
        Error::new(ErrorKind::Resource, what).remedy(remedy)
    }

    /// Takes over the lines of a tile with the samples `rect`.
    pub(super) fn add(
        &mut self,
        traced: TracedTile<'_>,
        rect: Rect,
        tiles: ContourTiles,
        cancel: &Cancel,
    ) -> Result<()> {
        let TracedTile { lines, original_vertices, left_out, bands } = traced;
        self.original_vertices += original_vertices;
        self.left_out += left_out;
        if let (Some(parts), Some(tile)) = (&mut self.bands, bands) {
            parts.add(tile, lines, self.pieces.len() as u32);
        }
        let pieces = (self.pieces.len() + lines.lines.len()) as u64;
        let sides = self.bands.as_ref().map_or(0, BandParts::border_parts) as u64;
        let bytes = pieces * self.piece_bytes + sides * SIDE_BYTES;
        if bytes > self.waiting || pieces >= u64::from(NONE) {
            return Err(self.too_many());
        }
        let first_address = self.vertices.len(0);
        for vertices in lines.vertices.chunks(PUSHED) {
            cancel.check()?;
            self.vertices.push(0, vertices)?;
        }
        let mut start = 0;
        for (index, line) in lines.lines.iter().enumerate() {
            let vertices = lines.of(index);
            let id = self.pieces.len() as u32;
            self.pieces.push(ContourPiece {
                at: first_address + start,
                first: vertices[0].edge,
                low: vertices[lowest(vertices)].edge,
                around: line.around,
                count: vertices.len() as u32,
                level: line.level,
                next: if line.closed { id } else { NONE },
                is_entered: line.closed,
            });
            start += vertices.len() as u64;
            if let (false, [first, .., last]) = (line.closed, vertices) {
                for (vertex, end) in [(first, OpenEnd::First(id)), (last, OpenEnd::Last(id))] {
                    if tiles.rim(rect, vertex).is_some() {
                        self.meet((vertex.edge, line.level), end);
                    }
                }
            }
        }
        Ok(())
    }

    /// Joins an end to its counterpart, or lets it wait.
    fn meet(&mut self, crossing: (CrossedEdge, i32), end: OpenEnd) {
        let (last, first) = match (self.ends.remove(&crossing), end) {
            (Some(OpenEnd::Last(last)), OpenEnd::First(first))
            | (Some(OpenEnd::First(first)), OpenEnd::Last(last)) => (last, first),
            // A crossing has one line in and one out, so there is none but a counterpart.
            _ => {
                self.ends.insert(crossing, end);
                return;
            }
        };
        // The two pieces have a vertex in common.
        self.original_vertices -= 1;
        self.pieces[last as usize].next = first;
        self.pieces[first as usize].is_entered = true;
    }

    /// All lines in the order in which they are written. Call it when all tiles are there.
    pub(super) fn lines(&mut self) -> Vec<JoinedContour> {
        self.ends = HashMap::new();
        let mut visited = vec![false; self.pieces.len()];
        let mut lines = Vec::new();
        for only_open in [true, false] {
            for first in 0..self.pieces.len() {
                if !(visited[first] || only_open && self.pieces[first].is_entered) {
                    let line = self.line(first as u32, &mut visited);
                    // A joined ring counts its first vertex twice.
                    let is_joined = self.pieces[first].next != first as u32;
                    self.original_vertices += u64::from(line.closed && is_joined);
                    lines.push(line);
                }
            }
        }
        lines.sort_unstable();
        lines
    }

    /// The line that starts with piece `start`.
    fn line(&self, start: u32, visited: &mut [bool]) -> JoinedContour {
        let ContourPiece { level, first, low, is_entered: closed, .. } =
            self.pieces[start as usize];
        let begins = if closed { low } else { first };
        let mut line =
            JoinedContour { level, start: begins, first: start, closed, around: Some(0) };
        for id in self.from(start) {
            let piece = self.pieces[id as usize];
            visited[id as usize] = true;
            let sum = line.around.zip(piece.around);
            line.around = sum.map(|(a, b)| a.wrapping_add(b));
            if closed && piece.low < line.start {
                (line.start, line.first) = (piece.low, id);
            }
        }
        line
    }

    /// The pieces of a line from `start` on, each once.
    fn from(&self, start: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(start), move |id| {
            Some(self.pieces[*id as usize].next).filter(|&next| next != NONE && next != start)
        })
    }

    /// The pieces of a line.
    pub(super) fn ids(&self, line: &JoinedContour) -> impl Iterator<Item = u32> {
        self.from(line.first)
    }

    /// Upper bound of the number of vertices of `line`.
    pub(super) fn count(&self, line: &JoinedContour) -> u64 {
        self.from(line.first).map(|id| u64::from(self.pieces[id as usize].count)).sum()
    }

    /// Fills `vertices` with those of `line`. A ring begins, and ends, at its lowest edge.
    pub(super) fn read(
        &mut self,
        line: &JoinedContour,
        vertices: &mut Vec<ContourVertex>,
    ) -> Result<()> {
        vertices.clear();
        let mut id = line.first;
        loop {
            let ContourPiece { at, count, next, .. } = self.pieces[id as usize];
            // A piece begins with the vertex that the one before it ends with.
            vertices.pop();
            let start = vertices.len();
            vertices.resize(start + count as usize, ContourVertex::zeroed());
            self.vertices.read_from(0, at, &mut vertices[start..])?;
            id = next;
            if id == NONE || id == line.first {
                break;
            }
        }
        if line.closed {
            vertices.pop();
            let low = vertices.iter().position(|v| v.edge == line.start).unwrap_or_default();
            vertices.rotate_left(low);
            vertices.push(vertices[0]);
        }
        Ok(())
    }

    /// Bytes of the temporary file.
    pub(super) fn spilled(&self) -> u64 {
        self.vertices.spilled()
    }
}
