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

mod artifact;
mod available;
mod base_tiles;
mod cloud;
mod division;
mod folder;
mod format;
mod georeference;
mod grid_levels;
mod input;
mod job;
mod make;
mod mask;
mod options;
mod outside;
mod overviews;
mod probe;
mod report;
mod scan;
mod tasks;
mod tiles_3d;

pub use cloud::{CloudModel, ModelWorkFolder, run_cloud};
pub use format::TilesFormat;
pub use georeference::{AS_GIVEN, ON_ELLIPSOID, WITH_GEOID};
pub use job::{PlanJob, TilesJob};
pub use make::{plan_tiles, run, run_in};
pub use options::{
    CloudTilesOptions, CloudTilesSetters, ModelOptions, ModelSetters, TileOptions, TileSetters,
    TilesOptions, TilesSetters,
};
pub use outside::TilesBeyond;
pub use report::{StatusReport, TileLevelReport, TilesReport, TilesRun, TilesStatus};
pub use terrane_lidar::points::CloudStages;
