//! Point clouds: grids, meshes, ground and noise, files of points.

pub mod cloud_tin;
pub mod delaunay;
#[cfg(test)]
mod few;
pub mod grid;
pub mod points;
pub mod records;
pub mod survey;
pub mod translate;
