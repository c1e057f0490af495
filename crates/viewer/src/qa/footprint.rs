//! Footprints of files: the union of their occupied cells, as polygons along the borders of cells.
//!
//! Each border edge runs with its cell on the left. Where two cells touch at a corner only, a ring turns left, around
//! its own cell. A ring that comes back to a corner is cut there: rings are simple, counterclockwise around cells connected
//! by sides, and clockwise around their holes.

use std::collections::HashMap;
use std::path::Path;

use bytemuck::{Pod, Zeroable};

use super::lattice::QaLattice;
use super::voids::root;
use terrane_base::error::Result;
use terrane_files::{AggregatedRecords, KeyedRecord};
use terrane_vector::CoordinateSequence;

/// Most runs of a footprint; beyond, its bounding box is written.
pub(super) const MAX_RUNS: usize = 1 << 17;
/// Bytes of the largest footprint while it is made: its runs, their border and its corners.
pub(super) const POLYGON_BYTES: u64 = MAX_RUNS as u64 * 256;
/// Runs that are gathered before they are sorted.
const GATHERED: usize = 1 << 12;

/// Cells of a file next to each other in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FootprintRun {
    pub(super) file: u32,
    row: i32,
    /// First and last column.
    from: i32,
    to: i32,
}

impl KeyedRecord for FootprintRun {
    fn key(&self) -> u128 {
        let [row, from] = [self.row, self.from].map(|at| u128::from(at as u32 ^ 1 << 31));
        u128::from(self.file) << 64 | row << 32 | from
    }

    fn merge(&mut self, other: &Self) {
        self.to = self.to.max(other.to);
    }
}

/// Joins cells, which come in the order of rows, to runs.
pub(super) struct RunWriter {
    open: HashMap<u32, FootprintRun>,
    gathered: Vec<FootprintRun>,
    sorted: AggregatedRecords<FootprintRun>,
}

impl RunWriter {
    pub(super) fn new(files: usize, folder: &Path, budget: u64) -> Self {
        let range = [0, (files as u128) << 64];
        Self {
            open: HashMap::new(),
            gathered: Vec::with_capacity(GATHERED),
            sorted: AggregatedRecords::new(folder, range, budget),
        }
    }

    pub(super) fn add(&mut self, file: u32, [row, col]: [i32; 2]) -> Result<()> {
        let new = FootprintRun { file, row, from: col, to: col };
        let run = self.open.entry(file).or_insert(new);
        if run.row == row && i64::from(run.to) + 1 >= i64::from(col) {
            run.to = col;
            return Ok(());
        }
        let ended = std::mem::replace(run, new);
        self.gathered.push(ended);
        if self.gathered.len() == GATHERED { self.sorted.push(&mut self.gathered) } else { Ok(()) }
    }

    pub(super) fn finish(mut self) -> Result<AggregatedRecords<FootprintRun>> {
        self.gathered.extend(self.open.values());
        self.sorted.push(&mut self.gathered)?;
        Ok(self.sorted)
    }
}

/// A corner of cells: row, then column.
type Corner = [i32; 2];

/// A piece of the border, with its cell on the left.
#[derive(Clone, Copy, Debug)]
struct BorderEdge {
    from: Corner,
    to: Corner,
    /// Index of the run of its cell.
    run: usize,
}

impl BorderEdge {
    fn direction(&self) -> [i32; 2] {
        [(self.to[0] - self.from[0]).signum(), (self.to[1] - self.from[1]).signum()]
    }
}

/// The polygons of the runs of a file, which are in the order of rows and columns.
pub(super) fn polygons(runs: &[FootprintRun], lattice: &QaLattice) -> CoordinateSequence {
    let mut parents: Vec<usize> = (0..runs.len()).collect();
    let mut edges = edges(runs, &mut parents);
    edges.sort_unstable_by_key(|edge| (edge.from, edge.to));
    // By component, the outer ring first.
    let mut rings: Vec<(usize, bool, Vec<Corner>)> = Vec::new();
    let mut used = vec![false; edges.len()];
    for start in 0..edges.len() {
        if used[start] {
            continue;
        }
        let component = root(&mut parents, edges[start].run);
        for ring in simple_rings(&traced(&edges, &mut used, start)) {
            rings.push((component, area(&ring) < 0, ring));
        }
    }
    rings.sort();
    let mut out = CoordinateSequence::default();
    for (at, (component, _, ring)) in rings.iter().enumerate() {
        if at > 0 && rings[at - 1].0 != *component {
            out.end_polygon();
        }
        for corner in ring.iter().chain(ring.first()) {
            out.push(lattice.corner(corner.map(i64::from)), None, None);
        }
        out.end_part();
    }
    out.end_polygon();
    out
}

/// All pieces of the border. Joins runs that share a side.
fn edges(runs: &[FootprintRun], parents: &mut [usize]) -> Vec<BorderEdge> {
    let mut edges = Vec::new();
    let rows: Vec<&[FootprintRun]> = runs.chunk_by(|a, b| a.row == b.row).collect();
    let (mut below, mut first_below): (&[FootprintRun], usize) = (&[], 0);
    let mut first = 0;
    for row in rows {
        let at = row[0].row;
        if below.first().is_some_and(|run| run.row + 1 != at) {
            // Nothing lies on top of the row below.
            horizontal(below[0].row + 1, (below, first_below), (&[], 0), parents, &mut edges);
            below = &[];
        }
        horizontal(at, (below, first_below), (row, first), parents, &mut edges);
        for (run, FootprintRun { from, to, .. }) in (first..).zip(row) {
            let [top, right] = [at + 1, to + 1];
            edges.push(BorderEdge { from: [at, right], to: [top, right], run });
            edges.push(BorderEdge { from: [top, *from], to: [at, *from], run });
        }
        (below, first_below, first) = (row, first, first + row.len());
    }
    if let Some(run) = below.first() {
        horizontal(run.row + 1, (below, first_below), (&[], 0), parents, &mut edges);
    }
    edges
}

/// The border along the line between two rows, each with the index of its first run.
fn horizontal(
    line: i32,
    (below, first_below): (&[FootprintRun], usize),
    (above, first_above): (&[FootprintRun], usize),
    parents: &mut [usize],
    edges: &mut Vec<BorderEdge>,
) {
    let mut ends: Vec<i32> =
        below.iter().chain(above).flat_map(|run| [run.from, run.to + 1]).collect();
    ends.sort_unstable();
    ends.dedup();
    let (mut b, mut a) = (0, 0);
    for pair in ends.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        while below.get(b).is_some_and(|run| run.to < from) {
            b += 1;
        }
        while above.get(a).is_some_and(|run| run.to < from) {
            a += 1;
        }
        let under = below.get(b).is_some_and(|run| run.from <= from);
        let over = above.get(a).is_some_and(|run| run.from <= from);
        let [own, other] = [first_above + a, first_below + b];
        match (under, over) {
            (true, true) => {
                let [x, y] = [own, other].map(|run| root(parents, run));
                // The first run of a component is its number.
                parents[x.max(y)] = x.min(y);
            }
            (false, true) => {
                edges.push(BorderEdge { from: [line, from], to: [line, to], run: own });
            }
            (true, false) => {
                edges.push(BorderEdge { from: [line, to], to: [line, from], run: other });
            }
            (false, false) => {}
        }
    }
}

/// The closed path from an edge, without corners on straight lines.
fn traced(edges: &[BorderEdge], used: &mut [bool], start: usize) -> Vec<Corner> {
    let mut path = Vec::new();
    let mut at = start;
    loop {
        used[at] = true;
        let edge = edges[at];
        let [dy, dx] = edge.direction();
        let first = edges.partition_point(|other| other.from < edge.to);
        let next = (first..edges.len()).take_while(|i| edges[*i].from == edge.to);
        // Two edges leave where cells touch at a corner.
        let left = next.clone().find(|i| edges[*i].direction() == [dx, -dy]);
        let Some(next) = left.or(next.into_iter().find(|i| !used[*i] || *i == start)) else {
            return path;
        };
        if edges[next].direction() != [dy, dx] {
            path.push(edge.to);
        }
        if next == start {
            return path;
        }
        at = next;
    }
}

/// Cuts a path where it comes back to one of its corners.
fn simple_rings(path: &[Corner]) -> Vec<Vec<Corner>> {
    let (mut rings, mut open): (_, Vec<Corner>) = (Vec::new(), Vec::new());
    let mut places: HashMap<Corner, usize> = HashMap::new();
    for corner in path {
        if let Some(place) = places.get(corner).copied() {
            let ring = open.split_off(place);
            for cut in &ring {
                places.remove(cut);
            }
            rings.push(turned(ring));
        }
        places.insert(*corner, open.len());
        open.push(*corner);
    }
    rings.push(turned(open));
    rings
}

/// A ring from its lowest corner on.
fn turned(mut ring: Vec<Corner>) -> Vec<Corner> {
    let lowest = (0..ring.len()).min_by_key(|i| ring[*i]).unwrap_or(0);
    ring.rotate_left(lowest);
    ring
}

/// Twice the signed area in cells, positive counterclockwise.
fn area(ring: &[Corner]) -> i128 {
    let next = ring.iter().cycle().skip(1);
    let product = |a: i32, b: i32| i128::from(a) * i128::from(b);
    ring.iter().zip(next).map(|(a, b)| product(a[1], b[0]) - product(b[1], a[0])).sum()
}
