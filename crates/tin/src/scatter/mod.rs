//! Kernel for point clouds: a mesh on a subset of the points, within the tolerance of all of them.

mod greedy;
mod line_paths;
mod mesh;
mod point_location;
mod search;

pub use greedy::InsertUntilWithin;
pub use line_paths::{ClippedSegment, ClippedSegments, MissingConstraints};
pub use mesh::{GHOST, PointLocation, ScatterMesh, ScatterTriangle};
pub use search::exceeds;
