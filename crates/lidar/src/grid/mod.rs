//! Point clouds to grids: one pass over the points for any extent, several bands at once, and bytes that do not
//! depend on the order of files, threads or memory.

mod band_input;
mod blocks;
mod budget;
mod codecs;
mod extent;
mod geometry;
mod heights;
mod job;
mod level;
mod make;
mod neighbours;
mod options;
pub mod plan;
mod queue;
mod reading;
mod region_points;
mod report;
mod source;
pub(crate) mod surface_model;

pub use codecs::{AsText, StatisticList};
pub use geometry::{Compat, Placement};
pub use job::GridJob;
pub use make::{grid, run};
pub(crate) use neighbours::{CloudSurfaces, WORKER, more_is_needed, tiling};
pub use options::{GridOptions, GridSetters};
pub(crate) use region_points::{CellSurroundings, near_steps};
pub use report::{GridBandReport, GridReport, GridStage};
pub(crate) use surface_model::GROUND;
pub use surface_model::{GroundFrom, SurfaceModel};
pub use terrane_gridding::Canopy;
