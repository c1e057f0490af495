//! Spatial index of polygon edges by height, for scanlines.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::{ControlFlow, Range};

use super::scan::{Labelled, PolygonScan};
use super::{ClipRings, PolygonEdge};
use terrane_base::geom::{Affine, Rect};

/// Polygon edges.
#[derive(Clone, Debug, PartialEq)]
pub struct PolygonEdgeIndex {
    /// Edges by lower end.
    pub(super) edges: Vec<PolygonEdge>,
    /// Highest upper end of each block of edges, and of each block of blocks, up to one.
    tops: Vec<Vec<f64>>,
    /// Maximum number of edges at one height.
    pub(super) max_at_once: usize,
}

/// Number of edges of a block, and of blocks of the next level.
const BLOCK: usize = 16;
/// Memory of a thread in bytes per edge on a scanline: its index, two columns and a feature, and half as many
/// columns again; growing lists take up to twice as much.
const AT_HAND: u64 = 48;

impl PolygonEdgeIndex {
    /// Index of `rings`. O(n log n) for n edges.
    pub fn new(rings: ClipRings) -> Self {
        Self::of_edges(rings.edges)
    }

    fn of_edges(mut edges: Vec<PolygonEdge>) -> Self {
        edges.sort_unstable_by(|a, b| a.low[1].total_cmp(&b.low[1]));
        edges.shrink_to_fit();
        let (tops, max_at_once) = (tops(&edges), max_at_once(&edges));
        Self { edges, tops, max_at_once }
    }

    /// True if there are no edges.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// The edges that decide about positions in a box, including its border (x and y min, x and y max): edges
    /// near the box, and, for all edges west of it, the fewest vertical ones with the same crossing counts.
    /// Clip hierarchically to keep the cost of many boxes proportional to their content. Rows must run east,
    /// as crossings are counted from the west.
    #[must_use]
    pub fn within(&self, [west, south, east, north]: [f64; 4]) -> Self {
        // A margin above rounding errors at any scale; samples outside the box are not queried.
        let [beside, above] = [west - west.abs().max(1.0), north + north.abs().max(1.0)];
        let (mut edges, mut ends, mut next) = (Vec::new(), Vec::new(), 0);
        while let Some(at) = self.reaching(next, south).filter(|at| self.edges[*at].low[1] <= north)
        {
            let edge = self.edges[at];
            next = at + 1;
            match [edge.low[0], edge.high[0]] {
                [a, b] if a.max(b) < west => {
                    // An edge includes its lower end and excludes its upper end.
                    ends.extend(
                        [edge.low[1], edge.high[1]]
                            .map(|y| (edge.feature, if y > north { above } else { y.max(south) })),
                    );
                }
                [a, b] if a.min(b) > east => (),
                _ => edges.push(edge),
            }
        }
        ends.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let odd = ends.chunk_by(|a, b| a.0 == b.0 && a.1 == b.1).filter(|same| same.len() % 2 == 1);
        let odd: Vec<_> = odd.map(|same| same[0]).collect();
        edges.extend(odd.chunks_exact(2).map(|pair| {
            let [low, high] = [pair[0].1, pair[1].1].map(|y| [beside, y]);
            PolygonEdge { low, high, feature: pair[0].0 }
        }));
        Self::of_edges(edges)
    }

    /// Calls `see` for each row of a lattice of the given size with its number and the columns inside a
    /// polygon or on its border, as sorted disjoint ranges. `map` transforms columns and rows to positions;
    /// rows come in no fixed order.
    pub fn rows(
        &self,
        map: Affine,
        [width, height]: [u32; 2],
        mut see: impl FnMut(u32, &[Range<u32>]),
    ) {
        let mut runs = Vec::new();
        let _ = PolygonScan::new(self, map, Rect::new(0, 0, width, height)).rows(
            |row, inside: &[Labelled]| {
                runs.clear();
                runs.extend(inside.iter().map(|(_, run)| run.clone()));
                see(row, &runs);
                ControlFlow::<()>::Continue(())
            },
        );
    }

    /// Memory of the edges in bytes.
    pub fn bytes(&self) -> u64 {
        self.edges.len() as u64 * ClipRings::EDGE_BYTES
    }

    /// Memory in bytes while `threads` threads use the index.
    pub fn memory_use(&self, threads: usize) -> u64 {
        let edges = self.edges.len() as u64;
        let tops = edges / (BLOCK as u64 - 1) * size_of::<f64>() as u64;
        let at_hand = self.max_at_once as u64 * AT_HAND * threads.max(1) as u64;
        self.bytes() + tops + at_hand
    }

    /// The first edge from index `from` on whose upper end is at `y` or above.
    pub(super) fn reaching(&self, mut from: usize, y: f64) -> Option<usize> {
        while from < self.edges.len() {
            let skipped = self.blocks_at(from).take_while(|(_, top)| *top < y).last();
            match skipped {
                Some((size, _)) => from += size,
                None if self.edges[from].high[1] >= y => return Some(from),
                None => from += 1,
            }
        }
        None
    }

    /// The blocks that begin at index `from`, smallest first: number of edges, and highest end.
    fn blocks_at(&self, from: usize) -> impl Iterator<Item = (usize, f64)> {
        let mut size = 1;
        self.tops.iter().map_while(move |tops| {
            size *= BLOCK;
            from.is_multiple_of(size).then(|| (size, tops[from / size]))
        })
    }
}

fn tops(edges: &[PolygonEdge]) -> Vec<Vec<f64>> {
    let blocks = edges.chunks(BLOCK).map(|block| maximum(block.iter().map(|edge| edge.high[1])));
    let mut levels = vec![blocks.collect::<Vec<_>>()];
    while let Some(below) = levels.last().filter(|level| level.len() > 1) {
        levels.push(below.chunks(BLOCK).map(|block| maximum(block.iter().copied())).collect());
    }
    levels
}

fn maximum(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, f64::max)
}

/// Maximum number of `edges`, sorted by lower end, that overlap at one height.
fn max_at_once(edges: &[PolygonEdge]) -> usize {
    let mut ends: BinaryHeap<Reverse<i64>> = BinaryHeap::new();
    let mut most = 0;
    for edge in edges {
        while ends.peek().is_some_and(|Reverse(end)| *end < rank(edge.low[1])) {
            ends.pop();
        }
        ends.push(Reverse(rank(edge.high[1])));
        most = most.max(ends.len());
    }
    most
}

/// An integer with the order of the float; both zeros are equal.
fn rank(value: f64) -> i64 {
    let bits = (value + 0.0).to_bits().cast_signed();
    if bits < 0 { i64::MIN - bits } else { bits }
}
