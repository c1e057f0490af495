//! Grids clipped to polygons: samples inside a polygon or on its border stay, all others are voids.
//!
//! Samples are at the positions of `Affine::apply` in floats, and every predicate on them is exact ([`plane`]). A
//! position is inside a feature by the even-odd rule, so that nested rings are holes; features are united. Edges are
//! sorted by their lower ends, with a hierarchy of the upper ends of blocks of edges, so that the cost of a window
//! depends only on the edges at its height.

mod areas;
mod layer;
mod scan;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

pub use areas::PolygonEdgeIndex;
pub use layer::clipped;
pub(crate) use layer::remaining_cache;
pub(crate) use scan::{Labelled, PolygonScan, join};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, plane};

/// A position (x, y).
type Xy = [f64; 2];

/// An edge of a ring, lower end first.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PolygonEdge {
    low: Xy,
    high: Xy,
    feature: u32,
}

/// Builder of clip polygons: feature by feature, ring by ring.
#[derive(Debug, Default)]
pub struct ClipRings {
    edges: Vec<PolygonEdge>,
    features: u32,
}

impl ClipRings {
    /// Memory of an edge in bytes, without that of threads using the index.
    pub const EDGE_BYTES: u64 = size_of::<PolygonEdge>() as u64;

    /// Begins another feature.
    ///
    /// # Errors
    /// More than 2^32 features.
    pub fn begin_feature(&mut self) -> Result<()> {
        self.features = self
            .features
            .checked_add(1)
            .ok_or_else(|| Error::limit("number of polygons", "above 2^32", u32::MAX))?;
        Ok(())
    }

    /// Adds a ring to the current feature, with or without the closing position.
    ///
    /// # Errors
    /// A coordinate that is not finite or outside the range of exact predicates; more than 2^32 edges in
    /// total.
    pub fn push(&mut self, ring: &[Xy]) -> Result<()> {
        if let Some(at) = ring.iter().find(|at| !at.iter().all(|c| is_exact(*c))) {
            return Err(Error::bad_input(format!("position {at:?} is not finite or out of range"))
                .remedy(format!(
                    "use coordinates of 0 or of magnitude {:e} to {:e}",
                    plane::LEAST,
                    plane::MOST
                )));
        }
        if u32::try_from(self.edges.len() + ring.len()).is_err() {
            return Err(Error::limit("number of edges of polygons", "above 2^32", u32::MAX)
                .remedy("simplify them with ‹terrane simplify›"));
        }
        let feature = self.features;
        let nexts = ring.iter().skip(1).chain(ring.first());
        // A degenerate edge is a border of one position.
        self.edges.extend(ring.iter().zip(nexts).map(|(a, b)| match is_lower(a, b) {
            true => PolygonEdge { low: *a, high: *b, feature },
            false => PolygonEdge { low: *b, high: *a, feature },
        }));
        Ok(())
    }
}

fn is_exact(coordinate: f64) -> bool {
    coordinate == 0.0 || (plane::LEAST..=plane::MOST).contains(&coordinate.abs())
}

fn is_lower(a: &Xy, b: &Xy) -> bool {
    (a[1], a[0]) <= (b[1], b[0])
}

/// Clip polygons. Takes [`held`](Self::memory_use) bytes, independent of the grid.
#[derive(Debug)]
pub struct Clip {
    path: PathBuf,
    crs: Crs,
    areas: PolygonEdgeIndex,
}

impl Clip {
    /// The polygons of the file `path`, with the CRS `crs`. O(n log n) for n edges.
    pub fn new(rings: ClipRings, path: &Path, crs: Crs) -> Self {
        Self { path: path.to_path_buf(), crs, areas: PolygonEdgeIndex::new(rings) }
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Memory in bytes while `threads` threads read a clipped grid.
    pub fn memory_use(&self, threads: usize) -> u64 {
        self.areas.memory_use(threads)
    }
}
