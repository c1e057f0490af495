//! The main job: a grid in, a seamless mesh with a proven error bound out.

mod beside;
mod container;
mod job;
mod layout;
mod number;
mod report;
mod run;
mod schedule;
mod spill;
mod store;
mod window;
mod worker;
mod writer;

pub use job::{Goal, TinJob};
pub use report::{StageReport, TinReport};
pub use run::{Outcome, Settings, run_on};
