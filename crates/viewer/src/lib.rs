//! Pictures, web pages and reports of grids, meshes, clouds and lines.

pub mod cloud_picture;
pub mod cloud_stats;
pub mod heights;
pub mod html;
pub mod info;
pub mod page;
pub mod qa;
pub mod render;
pub mod serve;
pub mod view;
