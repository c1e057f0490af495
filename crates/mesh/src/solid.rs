//! The outline of a mesh in bounded memory: edges of only one triangle.
//!
//! Because neighbouring triangles arrive together, most edges meet their counterpart in a small table of recent
//! edges. Evicted edges go to a buffer. A full buffer is sorted and pairs are removed; if it is still more than half
//! full, it is written to a file as a sorted run. Runs are merged (pairs cancel) when there are many, and at the end.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use crate::sink::MeshHeader;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::AppendWriter;

/// Slots of the table of recent edges, as a power of two: 768 KiB, to stay in cache.
const RECENT_BITS: u32 = 14;
/// Edges of the buffer: 10 MiB.
const BUFFER_EDGES: usize = 1 << 18;
/// Runs merged at once.
const MAX_RUNS: usize = 32;

/// A directed edge of a triangle: the surface lies on its left.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct DirectedEdge {
    /// Ids of its start and end vertices.
    pub(super) ids: [u64; 2],
    /// Positions of both vertices.
    pub(super) ends: [[f32; 3]; 2],
}

const EDGE_BYTES: usize = size_of::<DirectedEdge>();

/// Sort key; both directions of an edge are adjacent.
type Key = (u64, u64, bool);

impl DirectedEdge {
    fn key(&self) -> Key {
        let [from, to] = self.ids;
        (from.min(to), from.max(to), from > to)
    }

    /// Slot of this edge, the same for both directions.
    fn slot(&self) -> usize {
        const MIX: u64 = 0x9E37_79B9_7F4A_7C15;
        let (low, high, _) = self.key();
        ((low.wrapping_mul(MIX) ^ high).wrapping_mul(MIX) >> (64 - RECENT_BITS)) as usize
    }

    fn is_opposite(&self, other: &DirectedEdge) -> bool {
        self.ids[0] == other.ids[1] && self.ids[1] == other.ids[0]
    }
}

/// The flat bottom of a solid.
pub(super) struct SolidBase {
    /// The requested height.
    height: f64,
    /// Stored height relative to the origin.
    stored: f32,
    /// Height of the origin.
    origin: f64,
    /// Stored units per unit of heights.
    scale: f64,
}

impl SolidBase {
    /// A base at `height`; fails if it is known not to be below the surface.
    pub(super) fn new(height: f64, header: &MeshHeader) -> Result<Self> {
        let (origin, scale) = (header.origin[2], header.scale[2]);
        // Compared as it is stored: the rounding of the base and that of heights must not meet.
        let stored = ((height - origin) * scale) as f32;
        if !stored.is_finite() {
            return Err(Error::usage(format!(
                "the base height {height} of the solid is not finite"
            )));
        }
        let base = Self { height, stored, origin, scale };
        let lowest = ((header.bounds[0][2] - origin) * scale) as f32;
        if lowest.is_nan() { Ok(base) } else { base.check(lowest).map(|()| base) }
    }

    /// Stored height.
    pub(super) fn stored(&self) -> f32 {
        self.stored
    }

    /// Fails unless a stored height is above the base.
    pub(super) fn check(&self, stored: f32) -> Result<()> {
        if stored > self.stored {
            return Ok(());
        }
        let (lowest, base) = (self.origin + f64::from(stored) / self.scale, self.height);
        let message =
            format!("the lowest height {lowest} is not above the base {base} of the solid");
        Err(Error::usage(message).remedy("choose a base below the lowest height"))
    }
}

/// A stored position moved to the base.
pub(super) fn lowered([x, y, _]: [f32; 3], base: f32) -> [f32; 3] {
    [x, y, base]
}

/// Collects edges and returns those without a counterpart.
pub(super) struct SolidOutline {
    recent: Vec<Option<DirectedEdge>>,
    edges: Vec<DirectedEdge>,
    runs: Vec<SortedEdgeRun>,
    capacity: usize,
    folder: PathBuf,
}

impl SolidOutline {
    /// With runs in anonymous files in `folder`.
    pub(super) fn new(folder: &Path) -> Self {
        Self::with_capacity(folder, BUFFER_EDGES)
    }

    fn with_capacity(folder: &Path, capacity: usize) -> Self {
        let recent = vec![None; 1 << RECENT_BITS];
        let folder = folder.to_path_buf();
        Self { recent, edges: Vec::new(), runs: Vec::new(), capacity, folder }
    }

    /// Adds the edges of a triangle.
    pub(super) fn push(&mut self, ids: [u64; 3], corners: [[f32; 3]; 3]) -> Result<()> {
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            self.add(DirectedEdge { ids: [ids[a], ids[b]], ends: [corners[a], corners[b]] });
        }
        if self.edges.len() >= self.capacity { self.relieve() } else { Ok(()) }
    }

    /// Cancels the edge with its counterpart, or stores it in place of an older one.
    fn add(&mut self, edge: DirectedEdge) {
        // The triangle beside mostly comes soon: only edges that are pushed out of their slot are sorted.
        let slot = &mut self.recent[edge.slot()];
        if slot.is_some_and(|other| other.is_opposite(&edge)) {
            *slot = None;
        } else if let Some(older) = slot.replace(edge) {
            self.edges.push(older);
        }
    }

    /// Passes every edge without a counterpart to `each`, sorted by ids regardless of direction.
    pub(super) fn complete(
        mut self,
        mut each: impl FnMut(DirectedEdge) -> Result<()>,
    ) -> Result<()> {
        self.edges.extend(self.recent.drain(..).flatten());
        cancel_in_place(&mut self.edges);
        if self.runs.is_empty() {
            return self.edges.into_iter().try_for_each(each);
        }
        let last = self.spill()?;
        self.runs.push(last);
        merge(self.runs, &mut each)
    }

    /// Empties the buffer.
    fn relieve(&mut self) -> Result<()> {
        cancel_in_place(&mut self.edges);
        // Only where half stays: then each sort is paid for by as many pushes.
        if self.edges.len() > self.capacity / 2 {
            let run = self.spill()?;
            self.runs.push(run);
        }
        if self.runs.len() >= MAX_RUNS { self.merge_runs() } else { Ok(()) }
    }

    fn spill(&mut self) -> Result<SortedEdgeRun> {
        let mut out = AppendWriter::spool(&self.folder)?;
        out.lines(&self.edges, |edge, buffer| buffer.extend_from_slice(bytemuck::bytes_of(edge)))?;
        self.edges.clear();
        SortedEdgeRun::new(out, &self.folder)
    }

    fn merge_runs(&mut self) -> Result<()> {
        let mut out = AppendWriter::spool(&self.folder)?;
        let runs = std::mem::take(&mut self.runs);
        merge(runs, &mut |edge| out.write(bytemuck::bytes_of(&edge)))?;
        self.runs.push(SortedEdgeRun::new(out, &self.folder)?);
        Ok(())
    }
}

/// Cancels pairs of edges in sorted order; the rest is returned sorted.
#[derive(Default)]
struct EdgePairing {
    waiting: Vec<DirectedEdge>,
}

impl EdgePairing {
    fn push(
        &mut self,
        edge: DirectedEdge,
        each: &mut impl FnMut(DirectedEdge) -> Result<()>,
    ) -> Result<()> {
        match self.waiting.last() {
            Some(last) if last.is_opposite(&edge) => {
                self.waiting.pop();
            }
            Some(last) if last.ids == edge.ids => self.waiting.push(edge),
            _ => {
                self.complete(each)?;
                self.waiting.push(edge);
            }
        }
        Ok(())
    }

    fn complete(&mut self, each: &mut impl FnMut(DirectedEdge) -> Result<()>) -> Result<()> {
        self.waiting.drain(..).try_for_each(each)
    }
}

/// Sorts the edges and removes pairs of opposite ones.
fn cancel_in_place(edges: &mut Vec<DirectedEdge>) {
    edges.sort_unstable_by_key(DirectedEdge::key);
    let mut count = 0;
    for i in 0..edges.len() {
        let edge = edges[i];
        if count > 0 && edges[count - 1].is_opposite(&edge) {
            count -= 1;
        } else {
            edges[count] = edge;
            count += 1;
        }
    }
    edges.truncate(count);
}

/// A sorted run of edges in a file.
struct SortedEdgeRun {
    reader: BufReader<File>,
    left: u64,
    folder: PathBuf,
}

impl SortedEdgeRun {
    fn new(out: AppendWriter, folder: &Path) -> Result<Self> {
        let file = out.into_file()?;
        let left = file.metadata().map_err(|e| unreadable(folder, e))?.len() / EDGE_BYTES as u64;
        let reader = BufReader::with_capacity(64 << 10, file);
        Ok(Self { reader, left, folder: folder.to_path_buf() })
    }

    fn next(&mut self) -> Result<Option<DirectedEdge>> {
        if self.left == 0 {
            return Ok(None);
        }
        let mut bytes = [0; EDGE_BYTES];
        self.reader.read_exact(&mut bytes).map_err(|e| unreadable(&self.folder, e))?;
        self.left -= 1;
        Ok(Some(bytemuck::pod_read_unaligned(&bytes)))
    }
}

fn unreadable(folder: &Path, error: std::io::Error) -> Error {
    Error::io(ErrorKind::Io, "read a temporary file back", error).in_file(folder)
}

/// Merges runs into `each`; pairs cancel.
fn merge(
    mut runs: Vec<SortedEdgeRun>,
    each: &mut impl FnMut(DirectedEdge) -> Result<()>,
) -> Result<()> {
    let mut heads = Vec::with_capacity(runs.len());
    let mut queue = BinaryHeap::with_capacity(runs.len());
    for (i, run) in runs.iter_mut().enumerate() {
        let head = run.next()?;
        queue.extend(head.map(|edge| Reverse((edge.key(), i))));
        heads.push(head);
    }
    let mut pairing = EdgePairing::default();
    while let Some(Reverse((_, i))) = queue.pop() {
        let next = runs[i].next()?;
        queue.extend(next.map(|edge| Reverse((edge.key(), i))));
        if let Some(edge) = std::mem::replace(&mut heads[i], next) {
            pairing.push(edge, each)?;
        }
    }
    pairing.complete(each)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// The triangles of a lattice of `side` x `side` cells, every `hole`-th cell left out, in an
    /// order that takes `step` cells at a time.
    fn triangles(side: u64, hole: u64, step: u64) -> Vec<[u64; 3]> {
        let cells = side * side;
        let scattered = (0..cells).map(|i| i * step % cells).filter(|cell| cell % hole != 5);
        let halves = scattered.flat_map(|cell| {
            let a = cell / side * (side + 1) + cell % side;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            [[a, b, d], [d, c, a]]
        });
        halves.collect()
    }

    fn position(id: u64) -> [f32; 3] {
        [id as f32, -(id as f32), 1.0]
    }

    /// The slow twin: all edges in a map.
    fn outline_by_map(triangles: &[[u64; 3]]) -> Vec<[u64; 2]> {
        let mut balance: HashMap<(u64, u64), i64> = HashMap::new();
        for &[a, b, c] in triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *balance.entry((from.min(to), from.max(to))).or_default() +=
                    if from < to { 1 } else { -1 };
            }
        }
        let mut left: Vec<[u64; 2]> = Vec::new();
        for ((low, high), n) in balance {
            let edge = if n > 0 { [low, high] } else { [high, low] };
            left.extend(std::iter::repeat_n(edge, n.unsigned_abs() as usize));
        }
        left.sort_by_key(|e| (e[0].min(e[1]), e[0].max(e[1]), e[0] > e[1]));
        left
    }

    fn outline(triangles: &[[u64; 3]], capacity: usize) -> Vec<[u64; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let mut outline = SolidOutline::with_capacity(folder.path(), capacity);
        for &ids in triangles {
            outline.push(ids, ids.map(position)).unwrap();
            assert!(outline.edges.len() < capacity + 3 && outline.runs.len() < MAX_RUNS);
        }
        let mut found = Vec::new();
        let keep = |edge: DirectedEdge| {
            assert_eq!(edge.ends, edge.ids.map(position));
            found.push(edge.ids);
            Ok(())
        };
        outline.complete(keep).unwrap();
        found
    }

    #[test]
    fn the_outline_is_the_same_however_little_fits_in_memory() {
        for step in [1, 7919] {
            let mut triangles = triangles(120, 13, step);
            triangles.extend([[0, 1, 122], [0, 1, 122], [50_000, 60_000, 70_000]]);
            let expected = outline_by_map(&triangles);
            assert!(expected.len() > 480);
            for capacity in [100, 1000, 1 << 20] {
                assert_eq!(outline(&triangles, capacity), expected, "capacity {capacity}");
            }
        }
    }
}
