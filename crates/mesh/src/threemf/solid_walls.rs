//! Conversion of a surface to a solid in which every edge has two triangles: every triangle is repeated at the
//! bottom, reversed, and upright triangles are added under the outline.
//!
//! Vertex v of the surface is vertex 2 v of the solid, and the vertex below it is 2 v + 1. Where two voids touch at a
//! corner, two loops of the outline pass through one vertex, and the upright edge below it would have four triangles.
//! The walls of each loop but the first therefore turn at an additional vertex in the middle of that edge, so that
//! they have two shorter edges of their own.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::parts::{push_triangle, push_vertex};
use crate::solid::{DirectedEdge, SolidBase, SolidOutline};
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::AppendWriter;

/// Maximum number of vertices with several loops.
const MAX_PINCHES: u64 = 1 << 20;

/// Converts a surface to a solid.
pub(super) struct SolidWalls {
    base: SolidBase,
    outline: SolidOutline,
    folder: PathBuf,
    /// Vertices of the surface.
    vertices: u64,
}

impl SolidWalls {
    /// With a bottom at `base`; buffered data go to anonymous files in `folder`.
    pub(super) fn new(base: SolidBase, folder: &Path) -> Self {
        let outline = SolidOutline::new(folder);
        Self { base, outline, folder: folder.to_path_buf(), vertices: 0 }
    }

    /// Stored height of the bottom.
    pub(super) fn base(&self) -> f32 {
        self.base.stored()
    }

    /// Counts vertices of the surface.
    pub(super) fn note_vertices(&mut self, count: usize) {
        self.vertices += count as u64;
    }

    /// The triangles of the solid for one of the surface.
    pub(super) fn push(&mut self, ids: [u64; 3], corners: [[f32; 3]; 3]) -> Result<[[u64; 3]; 2]> {
        let [a, b, c] = corners;
        self.base.check(a[2].min(b[2]).min(c[2]))?;
        self.outline.push(ids, corners)?;
        let [a, b, c] = ids.map(top);
        Ok([[a, b, c], [c + 1, b + 1, a + 1]])
    }

    /// Appends the walls and their vertices. `body` has all other vertices. Returns the total counts.
    pub(super) fn complete(self, body: &mut AppendWriter, tail: &mut AppendWriter) -> Result<u64> {
        let base = self.base();
        let mut edges = AppendWriter::spool(&self.folder)?;
        let mut starts = OutlineStarts::default();
        self.outline.complete(|edge| {
            starts.note(edge.ids[0])?;
            edges.write(bytemuck::bytes_of(&edge))
        })?;
        let mut corners = WallCorners::new(starts.pinches(), top(self.vertices));
        let mut reader = BufReader::with_capacity(256 << 10, edges.into_file()?);
        let mut bytes = [0; size_of::<DirectedEdge>()];
        while read(&mut reader, &mut bytes, &self.folder)? {
            let edge: DirectedEdge = bytemuck::pod_read_unaligned(&bytes);
            let turns = [0, 1].map(|end| corners.turn(edge.ids[end], end));
            for (turn, position) in turns.iter().zip(edge.ends) {
                if let Some((_, true)) = turn {
                    let [x, y, z] = position;
                    push_vertex([x, y, f32::midpoint(z, base)], &mut body.buffer);
                    body.settle()?;
                }
            }
            let [from, to] = edge.ids.map(top);
            let wall = wall([from, to], turns.map(|turn| turn.map(|(id, _)| id)));
            tail.lines(&wall, |ids, text| push_triangle(*ids, text))?;
        }
        Ok(corners.next)
    }
}

/// Vertex of the solid for a vertex of the surface.
fn top(id: u64) -> u64 {
    2 * id
}

fn read(reader: &mut impl Read, bytes: &mut [u8], folder: &Path) -> Result<bool> {
    match reader.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(Error::read(folder, e)),
    }
}

/// The triangles under an edge with the surface on its left, and the middle vertices at which the wall turns, if any.
fn wall([from, to]: [u64; 2], middles: [Option<u64>; 2]) -> Vec<[u64; 3]> {
    let (low_from, low_to) = (from + 1, to + 1);
    match middles {
        [None, None] => vec![[to, from, low_from], [to, low_from, low_to]],
        [Some(middle), None] => {
            vec![[to, from, middle], [to, middle, low_from], [to, low_from, low_to]]
        }
        [None, Some(middle)] => {
            vec![[from, low_from, low_to], [from, low_to, middle], [from, middle, to]]
        }
        [Some(one), Some(other)] => {
            vec![[one, low_from, low_to], [one, low_to, other], [one, other, to], [one, to, from]]
        }
    }
}

/// Number of outline edges that begin at each vertex, if more than one.
#[derive(Default)]
struct OutlineStarts {
    seen: Vec<u64>,
    several: BTreeMap<u64, u64>,
}

impl OutlineStarts {
    fn note(&mut self, id: u64) -> Result<()> {
        let (word, bit) = ((id / 64) as usize, 1 << (id % 64));
        if self.seen.len() <= word {
            self.seen.resize(word + 1, 0);
        }
        if self.seen[word] & bit == 0 {
            self.seen[word] |= bit;
            return Ok(());
        }
        *self.several.entry(id).or_insert(1) += 1;
        limits::check("number of corners where voids touch", self.several.len() as u64, MAX_PINCHES)
    }

    fn pinches(self) -> impl Iterator<Item = u64> {
        self.several.into_keys()
    }
}

/// Middle vertices of walls at vertices with several loops.
struct WallCorners {
    /// Number of walls that began and that ended at each vertex.
    passed: BTreeMap<u64, [u64; 2]>,
    /// Middle vertices by vertex and number of the wall.
    middles: BTreeMap<(u64, u64), u64>,
    /// Id of the next middle vertex.
    next: u64,
}

impl WallCorners {
    fn new(pinches: impl Iterator<Item = u64>, next: u64) -> Self {
        Self { passed: pinches.map(|id| (id, [0; 2])).collect(), middles: BTreeMap::new(), next }
    }

    /// The middle vertex at which a wall that begins (`end` 0) or ends (1) at a vertex turns, if any, and whether it
    /// is new. The n-th wall that begins there continues the n-th that ends there.
    fn turn(&mut self, id: u64, end: usize) -> Option<(u64, bool)> {
        let passed = self.passed.get_mut(&id)?;
        let pass = passed[end];
        passed[end] += 1;
        if pass == 0 {
            return None;
        }
        let (next, is_new) = (self.next, !self.middles.contains_key(&(id, pass)));
        self.next += u64::from(is_new);
        Some((*self.middles.entry((id, pass)).or_insert(next), is_new))
    }
}
