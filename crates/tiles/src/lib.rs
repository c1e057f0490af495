//! Terrain tiles of a grid of any size at all levels of detail.
//!
//! **First pass over the grid**: range of heights, means for voids, a plane for each block of samples, and the
//! samples along the borders of large tiles ([`terrane_globe::OverviewPlan`]).
//!
//! **Near levels**: a *region* is a tile with at most 1,024 samples along a side. Its samples are read once for
//! all its tiles down to the deepest level. Regions are independent.
//!
//! **Far levels**: tiles that contain several regions are made from the overview, and measured by blocks;
//! samples of a block are read where its bound is not sufficient.
//!
//! The result depends only on the grid and the options, in one run or by a plan with tasks for the survey, the
//! regions, and the levels above. The output folder appears when it is complete.

mod beyond;
mod cloud;
mod division;
mod far;
mod folder;
mod format;
mod glance;
mod ground;
mod job;
mod make;
mod mask;
mod near;
mod object;
mod opened;
mod options;
mod place;
mod probe;
mod report;
mod spans;
mod three;
mod work;

pub use beyond::TilesBeyond;
pub use cloud::{GroundModel, MadeGroundModel, ModelWorkFolder, run_cloud};
pub use format::TilesFormat;
pub use job::{PlanJob, TilesJob};
pub use make::{plan_tiles, run, run_in};
pub use options::{
    CloudTilesOptions, CloudTilesSetters, ModelOptions, ModelSetters, TileOptions, TileSetters,
    TilesOptions, TilesSetters,
};
pub use place::{AS_GIVEN, ON_ELLIPSOID, WITH_GEOID};
pub use report::{StatusReport, TileLevelReport, TilesReport, TilesRun, TilesStatus};
