//! A mesh of a cloud as an operation: at once, or by plan.

use std::path::Path;
use std::time::Instant;

use super::job::{CloudTinJob, CloudTinReport};
use super::make::run;
use super::options::CloudTinOptions;
use super::plan::run_in;
use crate::points::StagedPlace;
use terrane_base::error::Result;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::CloudInput;
use terrane_files::atomic::refuse_existing;
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
        let start = Instant::now();
        let RunRequest { output, skipped, is_measured, progress, cancel, .. } = request;
        let workdir = self.resuming.workdir.as_deref();
        // Work in a folder may have written the output already.
        if workdir.is_none() {
            refuse_existing(output, self.file.replacing.overwrite)?;
        }
        let place = match workdir {
            None => StagedPlace::Beside(output),
            Some(folder) => StagedPlace::of_plan(folder)?,
        };
        let (mut report, notes) = self.with_job(request, output, place, |job| {
            let job = CloudTinJob { measure: is_measured, ..job };
            match workdir {
                None => run(&job, progress, cancel),
                Some(folder) => {
                    run_in(folder, &job, skipped, self.resuming.disk(), progress, cancel)
                }
            }
        })?;
        report.run.wall_seconds = start.elapsed().as_secs_f64();
        Ok(CloudTinReport { notes: [notes, report.notes].concat(), ..report })
    }
}
