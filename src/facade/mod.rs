//! Entry points for Rust programs: opened data, jobs as builders, meshes and lines in memory. The command line
//! uses the same jobs.

mod bands;
mod cloud;
mod data;
mod features;
mod grid;
#[cfg(feature = "lidar")]
mod lidar;
mod mesh;
mod plan;
mod simplify;
mod surface;
#[cfg(feature = "tiles")]
mod tiles;
#[cfg(feature = "viewer")]
mod viewer;

pub use bands::{BandGrid, open_bands};
pub use cloud::{Cloud, open_cloud, open_cloud_as, open_points};
pub use data::Data;
pub use features::{Features, open_features};
pub use grid::{Grid, GridFiles, open, open_array, open_files};
pub use mesh::{Mesh, open_mesh};
pub use plan::open_plan;
pub use simplify::{Coordinates, Method, Simplify, simplify};
pub use surface::Surface;
