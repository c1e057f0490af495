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

mod above;
mod assign;
mod carried;
mod discs;
mod job;
mod moved;
mod noise;
mod octree;
mod operation;
mod options;
mod overlap;
pub mod plan;
mod portion;
mod prepared;
mod report;
mod shares;
mod sorted;
mod split;
mod squares;
mod thin;
mod wide;
mod work;
mod write;

pub use above::{Classify, HeightAboveGround, HeightClasses, HeightsAs, Reclassify};
pub use assign::Assign;
pub use job::TranslateJob;
pub use options::{PointsOptions, PointsSetters, TileFormat};
pub use overlap::Overlap;
pub use prepared::run;
pub use report::TranslateReport;
pub use sorted::Sort;
pub use split::AttributeSplit;
pub use squares::{BufferMark, SquareSplit};
pub use thin::{CellThinning, KEPT, ThinningRule};
