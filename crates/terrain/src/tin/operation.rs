//! A mesh of a grid as an operation: at once, by plan, for several bands, or by a textbook method.

use std::path::Path;

use super::bands::run_bands;
use super::baseline::run_by;
use super::job::TinJob;
use super::make::run;
use super::options::TinOptions;
use super::report::TinReport;
use super::workdir::run_in;
use terrane_base::error::Result;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_raster::Inputs;

impl Operation for TinOptions {
    const NAME: &'static str = "tin";
    type Input = GridInput;
    const WRITES: Writes = Writes::Mesh;
    type Report = TinReport;

    fn is_folder(&self) -> bool {
        self.split.is_some()
    }

    fn check(&self, output: &Path) -> Result<()> {
        self.textbook()?;
        self.shared()?;
        self.job(&Inputs::from(Vec::new()), output).map(drop)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<TinReport> {
        let RunRequest { inputs, output, skipped, is_measured, progress, cancel } = request;
        let job = TinJob { measure: is_measured, ..self.job(inputs, output)? };
        if let Some(folder) = &self.resuming.workdir {
            return run_in(folder, &job, skipped, self.resuming.disk(), progress, cancel);
        }
        match (self.shared()?, self.textbook()?) {
            (Some(bands), _) => run_bands(&job, &bands, progress, cancel),
            (None, Some(by)) => run_by(&job, &by, progress, cancel),
            (None, None) => run(&job, progress, cancel),
        }
    }
}
