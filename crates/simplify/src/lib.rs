//! Line simplification: features stream through one by one, or are processed together if topology matters.

mod coverage;
mod feature;
mod files;
mod goal;
mod hierarchy_file;
mod job;
mod length;
mod options;
mod report;
mod stream;
pub mod synthetic_lines;
mod target_search;
mod thresholds;
mod tool;
mod trees;

use std::path::{Path, PathBuf};
use std::time::Instant;

pub use coverage::positions;
pub use files::outputs;
pub use goal::measured as goal_of;
pub use goal::{LineGoal, MetGoal};
pub use job::{LineJob, TILE_VERTICES, Topology};
pub use length::{Length, LengthText};
pub use options::{LineOptions, LineSetters, Metric};
pub use report::{HierarchyReport, LineReport};
pub use thresholds::thresholds;
pub use tool::DistanceKind;

use files::LineFiles;
use terrane_base::error::Result;
use terrane_base::registry::named;
use terrane_engine::outputs::not_among;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress};
use terrane_files::name_of;
use terrane_line::{METHODS, SimplifyMethod};

/// The method `name`.
///
/// # Errors
/// Usage: an unknown name; the error lists the known ones.
pub fn method(name: &str) -> Result<&'static SimplifyMethod> {
    named(METHODS, name)
}

/// Runs the job. Outputs do not depend on threads or memory, and appear only when they are complete.
///
/// # Errors
/// Errors of inputs, outputs and memory; a goal that cannot be reached or is not supported by the method.
pub fn run(job: &LineJob, progress: &dyn Progress, cancel: &Cancel) -> Result<LineReport> {
    let started = Instant::now();
    job.check()?;
    check_files(job)?;
    let files = LineFiles::of(job)?;
    let mut report = match (&job.topology, job.goal) {
        (None, LineGoal::Tolerance(_) | LineGoal::Area(_)) => {
            stream::run(job, &files, progress, cancel)?
        }
        _ => coverage::run(job, &files, progress, cancel)?,
    };
    files.note_operation(&mut report);
    report.inputs = job.input.iter().map(|path| path.display().to_string()).collect();
    report.method = job.method.name.to_owned();
    report.run = RunStatistics::since(started, &job.resources);
    Ok(report)
}

/// Fails if an output is also an input, or if two outputs are the same file.
fn check_files(job: &LineJob) -> Result<()> {
    let mut written = outputs(job)?;
    written.extend(job.hierarchy.clone());
    let sides = job.topology.as_ref().and_then(|topology| topology.sides.clone());
    let read = job.input.iter().cloned().chain(sides);
    let transform_files =
        job.transform.iter().flat_map(|transform| transform.files().map(Path::to_path_buf));
    let read = read.chain(transform_files).map(name_of).collect::<Result<Vec<_>>>()?;
    not_among(&read, &written.iter().map(PathBuf::as_path).collect::<Vec<_>>())
}
