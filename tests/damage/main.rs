//! Damaged files of grids, clouds and meshes. These tests are apart from those of sound files, as they
//! ask how much memory the whole process took.

#[path = "../common/cloud_support.rs"]
mod cloud_support;
#[path = "../common/data.rs"]
mod data;
#[path = "../common/held.rs"]
mod held;
#[path = "../common/raster_support/mod.rs"]
mod raster_support;

mod cloud;
mod mesh;
mod mutation;
mod raster;
