//! The base of every job: memory, threads and progress, options and operations, plans, auxiliary files.

// The derive of options names this crate.
extern crate self as terrane_engine;

pub mod bands;
pub mod breaklines;
pub mod cloud_constraints;
pub mod constraints;
pub mod disk;
pub mod feature_files;
pub mod geoid;
pub mod globe;
mod grids_in_memory;
pub mod ground_units;
pub mod input;
pub mod json;
pub mod local_frame;
pub mod made_input;
pub mod memory;
pub mod operation;
pub mod options;
pub mod outputs;
pub mod plan;
mod progress;
pub mod proof;
pub mod reading;
mod resources;
pub mod run_statistics;
pub mod skip_bad;
mod trace;
pub mod transform;
pub mod water;
pub mod workers;

pub use progress::{FileAt, Progress, Silent};
pub use resources::{Resources, ResourcesSetters, peak_memory};
pub use terrane_base::Cancel;
pub use trace::WorkSpan;

/// Incremented when the output bytes of a job or the form of plans change; plans of another revision are not resumed.
/// Enforced by `tests/golden.rs`.
pub const REVISION: u32 = 22;
