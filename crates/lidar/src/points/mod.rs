//! The job of `terrane points`: a chain of stages on point clouds, into one file or one per tile or attribute value.
//!
//! ```text
//! files, by name ── records of one point format ──[filters]── stage ── stage ── … ── file
//! ```
//!
//! Points stay in the order of the files unless sorted, so the bytes depend on neither threads nor memory. Stages that
//! depend on other points read all points once before the output is written.
//!
//! A copy of a LAZ file compresses its points again, although most chunks could be copied. The chunks have to be decoded
//! anyway, to find damage and to count points, and so the bytes are a function of the points alone, whatever the
//! compressor of the input.

mod context;
mod input_records;
mod job;
mod memory_shares;
mod octree;
mod operation;
mod options;
mod pipeline;
pub mod plan;
mod prepared;
mod report;
mod split;
mod staged;
mod stages;
mod tile_subset;
mod tiled_output;
mod write;

pub use job::TranslateJob;
pub use options::{PointsOptions, PointsSetters, TileFormat};
pub use prepared::run;
pub use report::TranslateReport;
pub use split::AttributeSplit;
pub use staged::{CloudStages, CloudStagesSetters, StagedCloud, StagedPlace};
pub use stages::kinds::*;
pub use stages::{
    AnyStage, Classify, HeightClasses, HeightsAs, KEPT, OverlayValue, Reclassify, SampledBands,
    StageName, StageText, ThinningRule, stage_names,
};
pub use tiled_output::{BufferFlag, PointTiling};
