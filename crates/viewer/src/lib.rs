//! What there is to see of grids, meshes, clouds and lines: pictures, pages, facts.

pub mod cloud_picture;
pub mod cloud_stats;
pub mod heights;
pub mod html;
pub mod info;
pub mod page;
pub mod render;
pub mod serve;
pub mod view;
