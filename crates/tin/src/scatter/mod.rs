//! The kernel for clouds: a mesh whose vertices are some of the points, and no point far from it.

mod fan;
mod follow;
mod greedy;
mod mesh;
mod search;

pub use follow::{ClippedSegment, ClippedSegments, MissingConstraints};
pub use greedy::InsertUntilWithin;
pub use mesh::{GHOST, PointLocation, ScatterMesh, ScatterTriangle};
pub use search::exceeds;
