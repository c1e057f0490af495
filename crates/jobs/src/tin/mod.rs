//! The main job: a grid in, a seamless mesh with a proven error bound out.

mod angles;
mod bands;
mod budget;
mod build;
mod container;
mod cost;
mod estimate;
mod frame;
mod height_origin;
mod held;
mod held_file;
mod job;
mod joints;
mod layout;
mod make;
mod number;
mod options;
mod refinement;
mod report;
mod run;
mod schedule;
mod scope;
mod seek;
mod store;
mod tally;
mod textbook;
mod units;
mod window;
mod workdir;
mod worker;
mod writer;
mod zone;

pub use bands::run_bands;
pub use build::{BuildJob, Built, build, build_files};
pub use cost::{Cost, cost};
pub use height_origin::height_origin_of;
pub use held::{Tin, TinParts};
pub use job::{Goal, TinJob};
pub use layout::{TILE_CELLS, USUAL_TILE};
pub use make::{restate, run};
pub use options::{Target, TinOptions};
pub use refinement::{Constraints, Refinement};
pub use report::{FlawReport, StageReport, TinReport};
pub use run::{Outcome, Settings, run_on};
pub use tally::Flaws;
pub use textbook::{Textbook, run_by};
pub(crate) use units::{horizontal_unit, vertical_unit};
pub use workdir::{
    Form, MeshRun, MeshStatus, PlanJob, RunJob, RunReport, StatusReport, plan_work, run_in,
    run_plan, status_of,
};
