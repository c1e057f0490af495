//! Point clouds: grids, meshes, ground and noise, files of points.

pub mod cloud_tin;
pub mod delaunay;
pub mod grid;
pub mod point_index;
pub mod points;
pub mod records;
pub mod synthetic_cloud;
#[cfg(test)]
mod test_cloud;
