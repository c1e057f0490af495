//! A finished tile: its vertices, triangles and measured error.

use crate::globe::{EllipsoidNormal, Vector};
use crate::tiling::GlobeTileId;

/// A vertex of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileVertex {
    /// Steps from the west and from the south, 0 to [`STEPS`](crate::tiling::STEPS).
    pub at: [i32; 2],
    /// Steps of the level from the ellipsoid.
    pub height: i32,
}

/// Measured errors of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TileErrorMeasure {
    /// Number of samples.
    pub samples: u64,
    /// Largest vertical distance in metres.
    pub largest: f64,
}

impl TileErrorMeasure {
    /// Merges the errors of other samples.
    pub fn join(&mut self, other: Self) {
        self.samples += other.samples;
        self.largest = self.largest.max(other.largest);
    }
}

/// A tile.
#[derive(Clone, Debug, PartialEq)]
pub struct TerrainTile {
    /// Number.
    pub id: GlobeTileId,
    /// Height step in metres.
    pub step: f64,
    /// Step of earth-centred coordinates in metres; see
    /// [`TileLevel::lattice`](crate::level::TileLevel::lattice).
    pub lattice: Option<f64>,
    /// Border vertices first.
    pub vertices: Vec<TileVertex>,
    /// Counter-clockwise seen from above, as indices of vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Measured errors.
    pub measure: TileErrorMeasure,
}

impl TerrainTile {
    /// Decoded position of a vertex.
    pub fn point(&self, vertex: TileVertex) -> Vector {
        point(self.id, self.step, self.lattice, vertex)
    }
}

/// Position of a vertex from height steps and earth-centred steps in metres.
pub(crate) fn point(
    id: GlobeTileId,
    step: f64,
    lattice: Option<f64>,
    vertex: TileVertex,
) -> Vector {
    let point = EllipsoidNormal::at(id.place(vertex.at)).point(f64::from(vertex.height) * step);
    lattice.map_or(point, |lattice| point.rounded(lattice))
}
