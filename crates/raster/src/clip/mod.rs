//! Grids clipped to polygons: samples inside a polygon or on its border stay, all others are voids.
//!
//! A sample is where `Affine::apply` puts it, in floats, and every decision about it is exact
//! ([`plane`]). What lies within a feature is told by crossings (even-odd, so that rings within rings are
//! holes), and features are united. Edges are kept by their lower ends, with the upper ends of blocks of
//! them above one another, so that a window costs what the edges at its height cost.

mod layer;
mod scan;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::{Path, PathBuf};

pub(crate) use layer::{cache_beside, clipped};
pub(crate) use scan::{Labelled, Scan, join};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, plane};

/// A position (x, y).
type Xy = [f64; 2];

/// An edge of a ring, its lower end first.
#[derive(Clone, Copy, Debug)]
struct Edge {
    low: Xy,
    high: Xy,
    feature: u32,
}

/// Polygons that are being gathered: feature by feature, ring by ring.
#[derive(Debug, Default)]
pub struct ClipRings {
    edges: Vec<Edge>,
    features: u32,
}

impl ClipRings {
    /// Bytes that an edge takes, without those of threads that look at it.
    pub const EDGE_BYTES: u64 = size_of::<Edge>() as u64;

    /// Begins another feature.
    ///
    /// # Errors
    /// More than 2^32 of them.
    pub fn begin_feature(&mut self) -> Result<()> {
        let too_many = || Error::limit("number of polygons", "above 2^32", u32::MAX);
        self.features = self.features.checked_add(1).ok_or_else(too_many)?;
        Ok(())
    }

    /// Adds a ring to the feature begun last, its first position again at the end or not.
    ///
    /// # Errors
    /// A coordinate that is not finite, or of a magnitude that signs are not exact for; more than 2^32
    /// edges in all.
    pub fn push(&mut self, ring: &[Xy]) -> Result<()> {
        if let Some(at) = ring.iter().find(|at| !at.iter().all(|c| is_exact(*c))) {
            return Err(Error::bad_input(format!(
                "position {at:?} is not finite, or out of reach"
            ))
            .remedy(format!(
                "coordinates are 0, or from {:e} to {:e}",
                plane::LEAST,
                plane::MOST
            )));
        }
        if u32::try_from(self.edges.len() + ring.len()).is_err() {
            return Err(Error::limit("number of edges of polygons", "above 2^32", u32::MAX)
                .remedy("simplify them with terrane line"));
        }
        let feature = self.features;
        let nexts = ring.iter().skip(1).chain(ring.first());
        let edge = |(a, b): (&Xy, &Xy)| match is_lower(a, b) {
            true => Edge { low: *a, high: *b, feature },
            false => Edge { low: *b, high: *a, feature },
        };
        // One from a position to itself is a border that small.
        self.edges.extend(ring.iter().zip(nexts).map(edge));
        Ok(())
    }
}

fn is_exact(coordinate: f64) -> bool {
    coordinate == 0.0 || (plane::LEAST..=plane::MOST).contains(&coordinate.abs())
}

fn is_lower(a: &Xy, b: &Xy) -> bool {
    (a[1], a[0]) <= (b[1], b[0])
}

/// What a grid is clipped to. Takes [`held`](Self::held) bytes, whatever the grid.
#[derive(Debug)]
pub struct Clip {
    path: PathBuf,
    crs: Crs,
    /// By their lower ends.
    edges: Vec<Edge>,
    /// The highest upper end of each block of edges, and of each block of those, up to one.
    tops: Vec<Vec<f64>>,
    /// Most edges at one height.
    most_at_once: usize,
}

/// Edges of a block, and blocks of the one above it.
const BLOCK: usize = 16;
/// Bytes that a thread takes for each edge at the height of the row at hand: its number, two columns and
/// a feature, and half as many columns again; and lists that grow take up to twice as much.
const AT_HAND: u64 = 48;

impl Clip {
    /// The polygons of the file `path`, in the system `crs`. Takes O(n log n) time for n edges.
    pub fn new(rings: ClipRings, path: &Path, crs: Crs) -> Self {
        let mut edges = rings.edges;
        edges.sort_unstable_by(|a, b| a.low[1].total_cmp(&b.low[1]));
        edges.shrink_to_fit();
        let (tops, most_at_once) = (tops(&edges), most_at_once(&edges));
        Self { path: path.to_path_buf(), crs, edges, tops, most_at_once }
    }

    /// The file that they are from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes that they take while so many threads read a clipped grid.
    pub fn held(&self, threads: usize) -> u64 {
        let edges = self.edges.len() as u64;
        let tops = edges / (BLOCK as u64 - 1) * size_of::<f64>() as u64;
        let at_hand = self.most_at_once as u64 * AT_HAND * threads.max(1) as u64;
        edges * ClipRings::EDGE_BYTES + tops + at_hand
    }

    /// The first edge from number `from` on whose upper end is at `y` or above.
    fn reaching(&self, mut from: usize, y: f64) -> Option<usize> {
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

    /// The blocks that begin at number `from`, the smallest first: how many edges, and the highest end.
    fn blocks_at(&self, from: usize) -> impl Iterator<Item = (usize, f64)> {
        let mut size = 1;
        self.tops.iter().map_while(move |tops| {
            size *= BLOCK;
            from.is_multiple_of(size).then(|| (size, tops[from / size]))
        })
    }
}

fn tops(edges: &[Edge]) -> Vec<Vec<f64>> {
    let highest = |ends: &[f64]| ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let of_edges =
        |block: &[Edge]| block.iter().map(|e| e.high[1]).fold(f64::NEG_INFINITY, f64::max);
    let mut levels = vec![edges.chunks(BLOCK).map(of_edges).collect::<Vec<_>>()];
    while let Some(below) = levels.last().filter(|level| level.len() > 1) {
        levels.push(below.chunks(BLOCK).map(highest).collect());
    }
    levels
}

/// Most edges that have one height in common, of `edges` by their lower ends.
fn most_at_once(edges: &[Edge]) -> usize {
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

/// A whole number for each float, in the same order, and one for both zeros.
fn rank(value: f64) -> i64 {
    let bits = (value + 0.0).to_bits().cast_signed();
    if bits < 0 { i64::MIN - bits } else { bits }
}
