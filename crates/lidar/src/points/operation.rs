//! Writing points as an operation: at once, or by plan.

use std::path::Path;
use std::time::Instant;

use super::options::PointsOptions;
use super::plan::run_in;
use super::prepared::run;
use super::report::TranslateReport;
use terrane_base::error::Result;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::CloudInput;
use terrane_engine::outputs::refuse_file_name;
use terrane_engine::run_statistics::RunStatistics;

impl Operation for PointsOptions {
    const NAME: &'static str = "points";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Points;
    type Report = TranslateReport;

    fn is_folder(&self) -> bool {
        self.tile.is_some() || self.split.is_some()
    }

    fn check(&self, output: &Path) -> Result<()> {
        match self.is_folder() {
            true => refuse_file_name(output),
            false => self.unread(&[], output, Vec::new()).packing().map(drop),
        }
    }

    fn run(&self, request: RunRequest<'_>) -> Result<TranslateReport> {
        let RunRequest { inputs, output, skipped, progress, cancel, .. } = request;
        let job = self.job(inputs.names(), output)?;
        let Some(folder) = &self.resuming.workdir else { return run(&job, progress, cancel) };
        let start = Instant::now();
        let written = run_in(folder, &job, skipped, self.resuming.disk(), progress, cancel)?;
        let run = RunStatistics::since(start, &self.resources);
        Ok(TranslateReport { run, ..TranslateReport::from(written) })
    }
}
