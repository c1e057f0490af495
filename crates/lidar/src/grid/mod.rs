//! Point clouds to grids: one pass over the points for any extent, several bands at once, and bytes that do not
//! depend on the order of files, threads or memory.

mod blocks;
mod budget;
mod codecs;
mod extent;
mod feed;
mod heights;
mod job;
mod lane;
mod level;
mod make;
mod near;
mod neighbours;
mod options;
mod placement;
pub mod plan;
pub(crate) mod preset;
mod queue;
mod report;
mod source;

pub use codecs::{AsText, StatisticList};
pub use job::GridJob;
pub use make::{grid, run};
pub(crate) use near::{CellSurroundings, near_steps};
pub(crate) use neighbours::{CloudSurfaces, WORKER, more_is_needed, tiling};
pub use options::{GridOptions, GridSetters};
pub use placement::{Compat, Placement};
pub(crate) use preset::GROUND;
pub use preset::{GroundFrom, SurfaceModel};
pub use report::{GridBandReport, GridReport, GridStage};
pub use terrane_gridding::Canopy;
