//! A finished tile: its vertices, triangles and measured error.

use crate::globe::{EllipsoidNormal, Vector};
use crate::tiling::GlobeTileId;

/// A vertex of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileVertex {
    /// Steps from the west and from the south, of [`STEPS`](crate::tiling::STEPS).
    pub at: [i32; 2],
    /// Steps of the level from the ellipsoid.
    pub height: i32,
}

/// What was measured of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TileErrorMeasure {
    /// Samples.
    pub samples: u64,
    /// Metres of the largest vertical distance.
    pub largest: f64,
}

impl TileErrorMeasure {
    /// Adds what was measured of other samples.
    pub fn join(&mut self, other: Self) {
        self.samples += other.samples;
        self.largest = self.largest.max(other.largest);
    }
}

/// A tile that is made.
#[derive(Clone, Debug, PartialEq)]
pub struct TerrainTile {
    /// Which.
    pub id: GlobeTileId,
    /// Metres of a step of heights.
    pub step: f64,
    /// Metres of a step of earth-centred coordinates, as of [`TileLevel::lattice`](crate::level::TileLevel::lattice).
    pub lattice: Option<f64>,
    /// Those on the borders first.
    pub vertices: Vec<TileVertex>,
    /// Counter-clockwise seen from above, as indices of vertices.
    pub triangles: Vec<[u32; 3]>,
    /// What was measured.
    pub measure: TileErrorMeasure,
}

impl TerrainTile {
    /// Where a vertex is, as a client decodes it.
    pub fn point(&self, vertex: TileVertex) -> Vector {
        point(self.id, (self.step, self.lattice), vertex)
    }
}

/// Where a vertex is, of steps of heights and of earth-centred coordinates in metres.
pub(crate) fn point(
    id: GlobeTileId,
    (step, lattice): (f64, Option<f64>),
    vertex: TileVertex,
) -> Vector {
    let point = EllipsoidNormal::at(id.place(vertex.at)).point(f64::from(vertex.height) * step);
    lattice.map_or(point, |lattice| point.rounded(lattice))
}
