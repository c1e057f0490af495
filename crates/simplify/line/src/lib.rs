//! Line simplification: pure functions on slices of vertices.
//!
//! Every method bounds, or reports, the distance from each input vertex to the *segment* that replaces it, in a
//! [`DistanceMetric`]; [`metric`] has the formula. A method takes the vertices of one line and a tolerance and
//! returns the ascending indices of the kept vertices, including the first and the last. Coordinates must be
//! finite, and a line has fewer than 2^32 vertices; duplicates are ordinary vertices, lines of two vertices or
//! fewer are unchanged, and a tolerance of 0 drops vertices on their segment. Nothing recurses.

pub mod arcs;
pub mod cone;
pub mod hierarchy;
pub mod imai_iri;
pub mod metric;
mod path_hull;
pub mod rdp;
mod regions;
pub mod registry;
pub mod ring;
mod scratch;
pub mod tiles;
pub mod topology;
pub mod visvalingam;
pub mod wedge;

pub use hierarchy::Hierarchy;
pub use metric::{
    DistanceMetric, GeographicMetric, LocatedVertex, PlaneMetric, SpaceMetric, VerticalMetric,
};
pub use registry::{METHODS, SimplifyMethod};
pub use scratch::SimplifyScratch;
pub use terrane_base::geom::plane::Xy;

#[cfg(test)]
mod tests;
