//! Line simplification: pure functions on slices of vertices.
//!
//! Every method bounds, or reports, the distance from each vertex of the input to the *segment* that
//! replaces it, in a [`Metric`]; [`metric`] has the formula. A method takes the vertices of one line and
//! a tolerance and gives the ascending indices of the vertices it keeps, the first and the last among
//! them. Coordinates must be finite and a line has fewer than 2^32 vertices; duplicates are vertices
//! like others, lines of two vertices or fewer are kept as they are, and a tolerance of 0 drops what
//! lies on its segment. Nothing recurses.

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
pub mod squares;
pub mod topology;
pub mod visvalingam;
pub mod wedge;

pub use hierarchy::Hierarchy;
pub use metric::{Geographic, Located, Metric, Plane, Space, Vertical};
pub use registry::{METHODS, Method};

/// A position in the plane.
pub type Xy = [f64; 2];

/// Memory that methods keep between calls, so that many short lines cost no allocation.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Ends of ranges still to be looked at.
    ends: Vec<usize>,
    /// Vertices at which three segments may end.
    candidates: [Vec<u32>; 3],
    /// What the shortest path knows of each vertex.
    nodes: Vec<imai_iri::Node>,
    /// Vertices of one layer of the search, and of the next.
    layer: Vec<u32>,
    next_layer: Vec<u32>,
}

/// Appends all indices of a line that is too short to lose any: `true` if it was.
fn keep_short(count: usize, kept: &mut Vec<u32>) -> bool {
    if count <= 2 {
        kept.extend(0..count as u32);
    }
    count <= 2
}

/// The first vertex between `from` and `to` that is beyond the tolerance from the segment that joins
/// them.
fn first_beyond<V: Copy, M: Metric<V>>(
    metric: &M,
    points: &[V],
    from: usize,
    to: usize,
    tolerance2: f64,
) -> Option<usize> {
    let segment = metric.segment(&points[from], &points[to]);
    let limit = M::within(&segment, tolerance2);
    let mut at = from + 1;
    while let Some(found) = regions::first_above::<V, M>(&segment, points, at, to, limit) {
        if M::squared(&segment, M::reach(&segment, &points[found])) > tolerance2 {
            return Some(found);
        }
        at = found + 1;
    }
    None
}

#[cfg(test)]
mod tests;
