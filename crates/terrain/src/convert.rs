//! Copies any grid, or a part of it, into a file of any format that can be written: in parallel, in bounded
//! memory, with bytes that do not depend on threads.
//!
//! Threads take blocks of the output in row-major order; each reads the samples, encodes and compresses them,
//! and waits for its turn to append. So a sink gets blocks in the same order for any number of threads, and at
//! most one block per thread is in flight. A store needs no order: its blocks go straight to their places. A
//! COG has directories and overviews before the image, so the encoded blocks of each level are stored in an
//! unnamed file beside the output (or in the folder for temporary files). Overviews are downsampled block by
//! block while the previous level is written, and the file is assembled at the end.

pub(crate) mod copy;
pub(crate) mod job;
pub mod task;

use std::path::Path;

use crate::warp;
use copy::{DerivedBands, run_of};
use terrane_base::error::Result;
use terrane_base::registry;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_engine::{Cancel, Progress};
use terrane_window::resample::RESAMPLINGS;

pub use copy::{copy, copy_levels};
pub use job::{
    ConvertJob, ConvertOptions, ConvertReport, ConvertSetters, DerivedGridOptions,
    DerivedGridSetters, ResamplingName,
};

impl Operation for ConvertOptions {
    const NAME: &'static str = "convert";
    type Input = GridInput;
    const WRITES: Writes = Writes::Grid;
    type Report = ConvertReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.format(output)?.check(&self.written.co)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<ConvertReport> {
        let job = ConvertJob::new(request.inputs.clone(), request.output);
        run(&ConvertJob { options: self.clone(), ..job }, request.progress, request.cancel)
    }
}

/// Runs the job. Nothing appears under the output's name unless it succeeds.
pub fn run(job: &ConvertJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ConvertReport> {
    match &job.options.resampling {
        Some(name) => warp::run(job, registry::named(RESAMPLINGS, name)?, progress, cancel),
        None => run_of(job, 0, progress, cancel, |source| Ok(DerivedBands::of(source, Vec::new()))),
    }
}
