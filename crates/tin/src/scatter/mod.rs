//! The kernel for clouds: a mesh whose vertices are some of the points, and no point far from it.

mod greedy;
mod line_paths;
mod mesh;
mod point_location;
mod search;

pub use greedy::InsertUntilWithin;
pub use line_paths::{ClippedSegment, ClippedSegments, MissingConstraints};
pub use mesh::{GHOST, PointLocation, ScatterMesh, ScatterTriangle};
pub use search::exceeds;
