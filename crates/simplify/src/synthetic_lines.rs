//! Writes synthetic lines, feature by feature.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use terrane_base::error::Result;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_synth::lines::SyntheticLines;
use terrane_vector::{self as vector, VectorOpenOptions, VectorWriteOptions};

/// Synthetic lines to write.
#[derive(Clone, Debug)]
pub struct SyntheticLinesJob {
    /// The lines.
    pub lines: SyntheticLines,
    /// Output file; its ending selects the format.
    pub output: PathBuf,
    /// Replaces an existing output.
    pub overwrite: bool,
    /// Resources of the job.
    pub resources: Resources,
}

/// Report of written lines.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct SyntheticLinesReport {
    pub input: String,
    pub output: String,
    pub features: u64,
    pub vertices: u64,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    /// Values that the format cannot hold.
    pub notes: Vec<String>,
}

/// Writes the lines. The output appears only on success.
///
/// # Errors
/// An existing output, an output that cannot be created, or an ending without a format.
pub fn run(
    job: &SyntheticLinesJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<SyntheticLinesReport> {
    let start = Instant::now();
    let input = format!("synth:{}", job.lines);
    let mut source = vector::open(input.as_ref(), &VectorOpenOptions::default())?;
    let format = vector::by_path(&job.output, None)?;
    let options = VectorWriteOptions {
        overwrite: job.overwrite,
        temp_dir: job.resources.temp_dir.clone(),
        ..VectorWriteOptions::default()
    };
    let mut sink = vector::create(&job.output, format, source.layer(), &options)?;
    progress.begin("synth", u64::from(job.lines.features));
    let mut vertices = 0;
    while let Some(feature) = source.next()? {
        cancel.check()?;
        vertices += feature.geometry.vertices() as u64;
        sink.write(&feature)?;
        progress.advance(1);
    }
    let written = sink.finish(&[])?;
    progress.end();
    Ok(SyntheticLinesReport {
        input,
        output: job.output.display().to_string(),
        features: written.features,
        vertices,
        output_bytes: written.bytes,
        run: RunStatistics::since(start, &job.resources).with_threads(1),
        notes: written.notes,
    })
}
