//! Translates point clouds: filtered, thinned and merged; into one file, or one for each tile or value.
//!
//! ```text
//! files, sorted ── parts ── records of one format ──[single]──[noise]──[what the ground tells]──[attributes set] ─┐
//!                                      file ──[sorted]──[moved]──[discs]──[thinned]──[one flight line each] ◀─────┘
//! ```
//!
//! Points stay in the order of the files unless sorted, so the bytes depend on neither threads nor memory.
//! Steps that depend on other points read all points first (`choice`, `discs`).
//!
//! A copy of a LAZ file compresses its points anew, though most chunks could be copied: they are decoded all the same
//! to find damage and to count points, and the bytes are a function of the points alone.

mod assign;
mod context;
mod discs;
mod flight_lines;
mod ground_input;
mod height_above_ground;
mod input_records;
mod job;
mod memory_shares;
mod noise;
mod octree;
mod operation;
mod options;
pub mod plan;
mod prepared;
mod report;
mod reprojection;
mod sorted;
mod split;
mod thinning;
mod tile_subset;
mod tiled_output;
mod write;

pub use assign::Assign;
pub use flight_lines::Overlap;
pub use height_above_ground::{Classify, HeightClasses, HeightQuery, HeightsAs, Reclassify};
pub use job::TranslateJob;
pub use options::{PointsOptions, PointsSetters, TileFormat};
pub use prepared::run;
pub use report::TranslateReport;
pub use sorted::Sort;
pub use split::AttributeSplit;
pub use thinning::{CellThinning, KEPT, ThinningRule};
pub use tiled_output::{BufferFlag, PointTiling};
