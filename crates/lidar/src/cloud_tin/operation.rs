//! A mesh of a cloud as an operation: at once, or by plan.

use std::path::Path;

use super::job::{CloudTinJob, CloudTinReport};
use super::make::run;
use super::options::CloudTinOptions;
use super::plan::run_in;
use terrane_base::error::Result;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::CloudInput;
use terrane_raster::Inputs;

impl Operation for CloudTinOptions {
    const NAME: &'static str = "cloud-tin";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Mesh;
    type Report = CloudTinReport;

    fn check(&self, output: &Path) -> Result<()> {
        let job = self.unread(&Inputs::from(Vec::new()), output)?;
        job.format().and(job.check())
    }

    fn run(&self, request: RunRequest<'_>) -> Result<CloudTinReport> {
        let RunRequest { inputs, output, skipped, is_measured, progress, cancel } = request;
        let job = CloudTinJob { measure: is_measured, ..self.job(inputs, output)? };
        match &self.resuming.workdir {
            None => run(&job, progress, cancel),
            Some(folder) => run_in(folder, &job, skipped, self.resuming.disk(), progress, cancel),
        }
    }
}
