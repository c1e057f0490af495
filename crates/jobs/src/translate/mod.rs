//! Clouds into files of points: filtered, thinned and merged; one file, or one for each square.
//!
//! ```text
//! files, sorted ── parts ── records of one format ──[marks ── best of each group]── in order ── chunks ── file
//! ```
//!
//! Whatever is asked for, points stay in the order of files and of points in them, so the bytes depend on neither
//! threads nor memory. What needs to know of other points looks at all first (`choice`).

mod carried;
mod octree;
mod thin;

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::figures::Figures;
use crate::input::workers;
use crate::memory::PROGRAM;
use crate::plan::At;
use crate::records::choice::{Choice, Chosen};
use crate::records::{Flow, Packer, Records};
use crate::{Cancel, Progress, Resources};
use carried::CarriedRecords;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud::write::{CHUNK, CloudWriter, Packing, WriteOptions, packing_by_name};
use terrane_cloud::{Carrier, Census, OpenOptions, PointFormat, PointSource};
use terrane_files::folder_for;
pub use thin::{KEPT, Keep, Thin};

/// Clouds to be written as one.
#[derive(Clone, Debug)]
pub struct TranslateJob {
    /// File names, folders, patterns, lists.
    pub input: Vec<String>,
    /// How they are read, and which points.
    pub cloud: OpenOptions,
    /// LAS or LAZ file to write.
    pub output: PathBuf,
    /// Format of its points; the first that holds all fields of all files when `None`.
    pub format: Option<PointFormat>,
    /// Keep one point of those of one place and time.
    pub dedupe: bool,
    /// Keep one point of each cell.
    pub thin: Option<Thin>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

impl TranslateJob {
    /// The job with everything else at its default.
    pub fn new(input: Vec<String>, output: impl Into<PathBuf>) -> Self {
        Self {
            input,
            cloud: OpenOptions::default(),
            output: output.into(),
            format: None,
            dedupe: false,
            thin: None,
            overwrite: false,
            resources: Resources::default(),
        }
    }
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct TranslateReport {
    pub input: String,
    pub output: String,
    pub point_format: u8,
    /// What became of the points that were read.
    pub census: Census,
    /// Points left out by --dedupe and --thin.
    pub left_out: u64,
    /// Points written.
    pub points: u64,
    pub crs: String,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: Figures,
    pub points_per_second: f64,
    pub notes: Vec<String>,
}

/// Memory of a thread for reading, beside the records it hands on.
const READING: u64 = 4 << 20;
/// Chunks that a thread holds while it packs one: its records, the same compressed, and the compressor's.
const PACKING: u64 = 4;
/// Most bytes of the records of a round, for each thread.
const ROUND: u64 = 16 << 20;

/// How the memory is divided.
struct Shares {
    threads: usize,
    flow: Flow,
    /// Bytes for what is looked at before.
    marks: u64,
}

impl Shares {
    fn new(resources: &Resources, record: usize) -> Result<Self> {
        let chunk = (CHUNK * record) as u64;
        let worker = READING + PACKING * chunk;
        let least = PROGRAM + worker + 4 * chunk;
        let Some(rest) = resources.memory.checked_sub(least) else {
            let message = format!("the memory budget of {} bytes is too small", resources.memory);
            return Err(Error::new(ErrorKind::Resource, message)
                .remedy(format!("pass --memory {}M or more", least.div_ceil(1 << 20))));
        };
        let threads = resources.threads.clamp(1, 1 + (rest / (2 * worker)) as usize);
        let rest = rest - worker * (threads as u64 - 1);
        let round = (2 * chunk + rest / 4).min(ROUND * threads as u64);
        Ok(Self { threads, flow: Flow { record, round }, marks: rest / 2 })
    }

    /// For the columns of an octree: bytes of one that is held, and of all that wait.
    fn columns(&self) -> [u64; 2] {
        [self.marks / 32, self.marks / 4]
    }
}

/// Writes the points. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// An output that exists, cannot be created, or is neither .las nor .laz; files that do not go into one; what the
/// format cannot hold of a point; too little memory.
pub fn run(
    job: &TranslateJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TranslateReport> {
    let (start, at) = (Instant::now(), At { progress, cancel });
    let packing = packing(&job.output)?;
    let cloud = terrane_cloud::open(&job.input, &job.cloud)?;
    let carrier = Carrier::new(&cloud, job.format, packing)?;
    let (frame, crs) = (cloud.info().frame, cloud.info().crs.clone());
    let shares = Shares::new(&job.resources, carrier.size())?;
    let options = WriteOptions { packing, overwrite: job.overwrite, ..carrier.file(frame, crs) };
    let place = (packing == Packing::Nodes).then(|| octree::Place::new(cloud.info()));
    let options = WriteOptions { cube: place.as_ref().map(octree::Place::cube), ..options };
    let mut writer = CloudWriter::create(&job.output, &options)?;
    let resources = Resources { threads: shares.threads, ..job.resources.clone() };
    let source = CarriedRecords::new(&cloud, &carrier);
    let write = |records: &dyn Records| match &place {
        None => write(records, shares.flow, at, &mut writer),
        Some(place) => {
            let (layout, folder) = (writer.layout(), job.folder());
            octree::Octree { place, layout, folder, memory: shares.columns(), at }.write(
                records,
                shares.flow,
                &mut writer,
            )
        }
    };
    workers(&resources)?.install(|| job.chosen(&source, &carrier, &shares, at, write))?;
    let points = writer.points();
    let output_bytes = writer.finish()?;
    let run = Figures { threads: shares.threads, ..Figures::since(start, &job.resources) };
    let census = source.census();
    Ok(TranslateReport {
        input: job.input.join(", "),
        output: job.output.display().to_string(),
        point_format: carrier.format().number(),
        left_out: census.kept - points,
        census,
        points,
        crs: cloud.info().crs.label(),
        output_bytes,
        points_per_second: run.rate(census.read),
        run,
        notes: cloud.notes().iter().chain(carrier.notes()).cloned().collect(),
    })
}

impl TranslateJob {
    /// Where what has to wait goes.
    fn folder(&self) -> &Path {
        folder_for(&self.output, self.resources.temp_dir.as_deref())
    }

    /// Writes what is chosen of all records.
    fn chosen(
        &self,
        source: &dyn Records,
        carrier: &Carrier<'_>,
        shares: &Shares,
        at: At<'_>,
        write: impl FnOnce(&dyn Records) -> Result<()>,
    ) -> Result<()> {
        let folder = self.folder();
        let choose = |records, choice: &dyn Choice, stage: &str| {
            at.progress.begin(stage, total(records));
            let chosen = Chosen::new(records, choice, (shares.flow, shares.marks, folder), at)?;
            at.progress.end();
            Ok::<_, Error>(chosen)
        };
        let twice = thin::Twice::new(carrier.format());
        let single = self
            .dedupe
            .then(|| choose(source, &twice, "points that are there twice"))
            .transpose()?;
        let records: &dyn Records = single.as_ref().map_or(source, |chosen| chosen);
        let cells = self.thin.map(|thin| thin::Cells::new(thin, &carrier.frame())).transpose()?;
        let thinned = cells.as_ref().map(|cells| choose(records, cells, "cells")).transpose()?;
        let records: &dyn Records = thinned.as_ref().map_or(records, |chosen| chosen);
        write(records)
    }
}

fn total(records: &dyn Records) -> u64 {
    (0..records.units()).map(|unit| records.points(unit)).sum()
}

fn write(records: &dyn Records, flow: Flow, at: At<'_>, writer: &mut CloudWriter) -> Result<()> {
    at.progress.begin("points", total(records));
    let mut packer = Packer::new(writer, rayon::current_num_threads());
    flow.run(records, at, &mut |bytes| packer.take(bytes))?;
    packer.finish()?;
    at.progress.end();
    Ok(())
}

fn packing(path: &Path) -> Result<Packing> {
    packing_by_name(path).ok_or_else(|| {
        Error::usage("points are written as .las, .laz or .copc.laz")
            .in_file(path)
            .remedy("choose a name with one of these endings")
    })
}
