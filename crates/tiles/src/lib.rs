//! Tiles of the globe's terrain at every level of detail, of a grid of any size.
//!
//! **Once over the grid**: its range, means for voids, a plane for each block of samples, and the samples along the
//! borders of large tiles ([`terrane_globe::OverviewPlan`]).
//!
//! **Near levels**: a *region* is a tile with at most 1,024 samples along a side. Its samples are read once, and
//! all its tiles down to the deepest level are made of them. Regions are independent.
//!
//! **Far levels**: tiles that hold several regions are made of the overview, and measured by blocks; where a block
//! does not tell, its samples are read.
//!
//! Whatever is made depends on the grid and the options alone: at once, or by a plan whose tasks look, make regions,
//! and make what is above them. Files are put into a folder that appears whole.

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
