//! Writes a synthetic point cloud: parts are generated and chunks compressed by all threads, and appended in
//! the order of flight; the bytes do not depend on threads.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use crate::records::{PointRecords, RecordFlow, RecordPacker, RecordUnit, Take};
use terrane_base::error::{Error, Result};
use terrane_cloud::synth;
use terrane_cloud::write::{
    self, CloudWriteOptions, CloudWriter, PointFormat, PointLayout, PointPacking, PointRecord,
};
use terrane_engine::input::workers;
use terrane_engine::memory::{PROGRAM, too_little};
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_synth::cloud::LidarSurvey;

/// A survey to be written.
#[derive(Clone, Debug)]
pub struct SyntheticCloudJob {
    /// The cloud.
    pub survey: LidarSurvey,
    /// LAS or LAZ file to write.
    pub output: PathBuf,
    /// Format of its points.
    pub format: PointFormat,
    /// Replace an existing output.
    pub overwrite: bool,
    /// Resources of the job.
    pub resources: Resources,
}

/// Report of a written survey.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct SyntheticCloudReport {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    pub points: u64,
    pub crs: String,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub points_per_second: f64,
}

/// Most parts in flight for each thread.
const PARTS_BY_THREAD: u64 = 4;
/// Memory for a part in flight: its points, twice, and as bytes.
const BYTES_BY_PART: u64 = 24 << 20;

/// Writes the point cloud. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// An output that exists, cannot be created, or is neither .las nor .laz; too little memory.
pub fn run(
    job: &SyntheticCloudJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<SyntheticCloudReport> {
    let (start, at) = (Instant::now(), RunControl { progress, cancel });
    let mut writer = CloudWriter::create(&job.output, &options(job)?)?;
    let flown = SyntheticCloudRecords { survey: &job.survey, layout: writer.layout() };
    let flow = flow(&job.resources, &flown)?;
    let mut packer = RecordPacker::new(&mut writer, job.resources.threads);
    progress.begin("synth", job.survey.expected());
    workers(&job.resources)?.install(|| {
        flow.run(&flown, at, &mut |records| packer.take(records))?;
        packer.finish()
    })?;
    progress.end();
    let points = writer.points();
    let output_bytes = writer.finish()?;
    let run = RunStatistics::since(start, &job.resources);
    Ok(SyntheticCloudReport {
        input: format!("synth:{}", job.survey),
        output: job.output.display().to_string(),
        point_format: job.format.number(),
        points,
        crs: synth::crs().label(),
        output_bytes,
        points_per_second: run.rate(points),
        run,
    })
}

fn options(job: &SyntheticCloudJob) -> Result<CloudWriteOptions> {
    let packing = write::packing_by_name(&job.output)
        .filter(|packing| matches!(packing, PointPacking::Plain | PointPacking::Chunks));
    let packing = packing.ok_or_else(|| {
        Error::usage("a synthetic point cloud is written as .las or .laz")
            .in_file(&job.output)
            .remedy("use one of these extensions (‹terrane points› converts to .copc.laz)")
    })?;
    if job.format.has_waves() {
        return Err(Error::usage(format!(
            "point format {} is not supported by synthetic point clouds, which lack waveforms",
            job.format.number()
        ))
        .remedy("pass point format 0 to 3, or 6 to 8"));
    }
    let options = CloudWriteOptions::new(job.format, synth::frame(&job.survey), synth::crs());
    Ok(CloudWriteOptions { packing, overwrite: job.overwrite, ..options })
}

/// Number of parts in a round: enough for all threads, within the memory.
fn flow(resources: &Resources, flown: &SyntheticCloudRecords<'_>) -> Result<RecordFlow> {
    let parts = resources.memory.saturating_sub(PROGRAM) / BYTES_BY_PART;
    if parts == 0 {
        return Err(too_little(resources.memory, PROGRAM + BYTES_BY_PART));
    }
    let parts = parts.min(resources.threads as u64 * PARTS_BY_THREAD);
    let record = flown.layout.size();
    Ok(RecordFlow { record, round: parts * flown.unit(0).points * record as u64 })
}

/// The parts of a survey as records.
struct SyntheticCloudRecords<'a> {
    survey: &'a LidarSurvey,
    layout: PointLayout,
}

impl PointRecords for SyntheticCloudRecords<'_> {
    fn units(&self) -> usize {
        self.survey.parts()
    }

    fn unit(&self, _: usize) -> RecordUnit<'_> {
        RecordUnit::of(self.survey.expected().div_ceil(self.survey.parts().max(1) as u64))
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let mut echoes = Vec::new();
        self.survey.fill(unit, &mut echoes);
        let records: Vec<PointRecord> = echoes.iter().map(PointRecord::from).collect();
        take(&self.layout.records(&records))
    }
}
