//! The kernel for clouds: a mesh whose vertices are some of the points, and no point far from it.

mod fan;
mod follow;
mod greedy;
mod mesh;
mod search;

pub use follow::{Course, Courses, Gaps};
pub use greedy::Fit;
pub use mesh::{GHOST, Mesh, Place, Triangle};
pub use search::exceeds;
