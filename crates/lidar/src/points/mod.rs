//! The job of `terrane points`: filters, classifies, thins, reprojects, sorts and merges point clouds, into one file or
//! one per tile or attribute value.
//!
//! ```text
//! files, by name ── records of one point format ──[filters]──[--dedupe]──[noise]──[heights and classes] ─┐
//!                                                                                                        │
//! ┌──[--to-crs]──[--thin-distance]──[--thin]──[--drop-overlap]──[--attribute] ◀──────────────────────────┘
//! └─▶ [--sort] ── file
//! ```
//!
//! Points stay in the order of the files unless sorted, so the bytes depend on neither threads nor memory. Steps that
//! depend on other points read all points once before the output is written.
//!
//! A copy of a LAZ file compresses its points again, although most chunks could be copied. The chunks have to be decoded
//! anyway, to find damage and to count points, and so the bytes are a function of the points alone, whatever the
//! compressor of the input.

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
