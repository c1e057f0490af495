//! Reports from the trackers of other programs: each becomes an input, and a right answer. A test's name
//! begins with the row of the table of reports that it stands for: A rasters, B LiDAR, C lines, D outputs.

#[path = "../common/cli_support.rs"]
mod cli_support;
#[allow(unreachable_pub)]
#[path = "../common/cloud_support.rs"]
mod cloud_support;
#[allow(unreachable_pub)]
#[path = "../common/raster_support/mod.rs"]
mod raster_support;

mod cells;
mod ground;
mod lidar;
mod lines;
mod prints;
mod rasters;
mod tiles;
