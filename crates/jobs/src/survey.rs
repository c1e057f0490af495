//! Writes a synthetic cloud: parts made and chunks compressed by all threads, appended in the order of
//! flight, the same bytes whatever the threads.

use std::path::PathBuf;
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::figures::Figures;
use super::input::workers;
use super::memory::PROGRAM;
use super::{Cancel, Progress, Resources};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud::synth;
use terrane_cloud::write::{
    self, CHUNK, Chunk, CloudWriter, Layout, PointFormat, Record, WriteOptions,
};
use terrane_synth::cloud::Survey;

/// A survey to be written.
#[derive(Clone, Debug)]
pub struct SurveyJob {
    /// The cloud.
    pub survey: Survey,
    /// LAS or LAZ file to write.
    pub output: PathBuf,
    /// Format of its points.
    pub format: PointFormat,
    /// Replace an existing output.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct SurveyReport {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    pub points: u64,
    pub crs: String,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: Figures,
    pub points_per_second: f64,
}

/// Most parts in flight for each thread.
const PARTS_BY_THREAD: u64 = 4;
/// Memory for a part in flight: its points, twice, and as bytes.
const BYTES_BY_PART: u64 = 24 << 20;

/// Writes the cloud. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// An output that exists, cannot be created, or is neither .las nor .laz; too little memory.
pub fn run(job: &SurveyJob, progress: &dyn Progress, cancel: &Cancel) -> Result<SurveyReport> {
    let start = Instant::now();
    let mut writer = CloudWriter::create(&job.output, &options(job)?)?;
    let round = round(&job.resources)?;
    let pool = workers(&job.resources)?;
    progress.begin("synth", job.survey.expected());
    pool.install(|| Rounds::new(job, round, writer.layout()).run(&mut writer, progress, cancel))?;
    progress.end();
    let points = writer.points();
    let output_bytes = writer.finish()?;
    let run = Figures::since(start, &job.resources);
    Ok(SurveyReport {
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

fn options(job: &SurveyJob) -> Result<WriteOptions> {
    let compress = write::compressed_by_name(&job.output)?;
    let compress = compress.ok_or_else(|| {
        Error::usage("a cloud is written as .las or .laz")
            .in_file(&job.output)
            .remedy("choose a name with one of these endings")
    })?;
    let (frame, crs) = (synth::frame(&job.survey), synth::crs());
    Ok(WriteOptions { format: job.format, compress, frame, crs, overwrite: job.overwrite })
}

/// Parts of a round: enough to keep all threads busy, as far as memory goes.
fn round(resources: &Resources) -> Result<usize> {
    let parts = resources.memory.saturating_sub(PROGRAM) / BYTES_BY_PART;
    if parts == 0 {
        let message = format!("the memory budget of {} bytes is too small", resources.memory);
        return Err(Error::new(ErrorKind::Resource, message)
            .remedy(format!("pass --memory {}M or more", (PROGRAM + BYTES_BY_PART) >> 20)));
    }
    Ok(parts.min(resources.threads as u64 * PARTS_BY_THREAD) as usize)
}

/// The work in rounds: while the chunks of one are written, the points of the next are made.
struct Rounds<'a> {
    survey: &'a Survey,
    layout: Layout,
    parts: usize,
    round: usize,
    /// Points that do not fill a chunk yet.
    pending: Vec<Record>,
}

impl<'a> Rounds<'a> {
    fn new(job: &'a SurveyJob, round: usize, layout: Layout) -> Self {
        let survey = &job.survey;
        Self { survey, layout, parts: survey.parts(), round, pending: Vec::new() }
    }

    fn run(
        mut self,
        out: &mut CloudWriter,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut chunks = Vec::new();
        for from in (0..self.parts).step_by(self.round) {
            cancel.check()?;
            let (written, ()) = rayon::join(|| append(out, &chunks, progress), || self.make(from));
            written?;
            let full = self.pending.len() / CHUNK * CHUNK;
            chunks = self.chunks(full)?;
            self.pending.drain(..full);
        }
        append(out, &chunks, progress)?;
        append(out, &self.chunks(self.pending.len())?, progress)
    }

    /// Makes the points of a round.
    fn make(&mut self, from: usize) {
        let to = (from + self.round).min(self.parts);
        let parts: Vec<Vec<Record>> =
            (from..to).into_par_iter().map(|part| records(self.survey, part)).collect();
        for part in parts {
            self.pending.extend(part);
        }
    }

    /// The first of the points that wait, as chunks.
    fn chunks(&self, points: usize) -> Result<Vec<Chunk>> {
        self.pending[..points].par_chunks(CHUNK).map(|records| self.layout.chunk(records)).collect()
    }
}

fn records(survey: &Survey, part: usize) -> Vec<Record> {
    let mut echoes = Vec::new();
    survey.fill(part, &mut echoes);
    echoes.iter().map(Record::from).collect()
}

fn append(out: &mut CloudWriter, chunks: &[Chunk], progress: &dyn Progress) -> Result<()> {
    for chunk in chunks {
        out.append(chunk)?;
        progress.advance(chunk.points() as u64);
    }
    Ok(())
}
