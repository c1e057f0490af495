//! Grids: files of every format read and written, stores, many files as one, synthetic terrains.

#[path = "../common/cli_support.rs"]
mod cli_support;
#[path = "../common/data.rs"]
mod data;
#[path = "../common/raster_support/mod.rs"]
mod raster_support;

mod formats;
mod geotiff;
mod golden;
mod hgt_asc;
mod masks;
mod matrix;
mod mosaic;
mod nodata;
mod sidecars;
mod store;
mod terrain;
mod voids;
mod write;
