//! Copying a grid, or a computation on a grid, into a file.

use std::time::Instant;

use super::job::{ConvertJob, ConvertReport};
use super::task::{CopyPieces, CopyStatistics, CopyTask};
use terrane_base::error::{ErrorKind, Result};
use terrane_engine::memory::{self, MemoryShares, OpenGrid};
use terrane_engine::outputs::not_member;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_raster::write::{BandName, GridFormat, GridSink, GridWriteOptions};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource, WaterReport};

/// Bands computed from a grid.
pub(crate) struct DerivedBands {
    /// The bands to write, equal in size and type.
    bands: Vec<Box<dyn GridSource>>,
    /// Names of the bands, if they are colours.
    colours: Vec<BandName>,
    /// Notes for the report.
    notes: Vec<String>,
}

impl DerivedBands {
    /// A grid.
    pub(crate) fn of(grid: Box<dyn GridSource>, notes: Vec<String>) -> Self {
        Self { bands: vec![grid], colours: Vec::new(), notes }
    }

    /// Red, green, blue and perhaps opacity.
    pub(crate) fn of_colours(bands: Vec<Box<dyn GridSource>>, notes: Vec<String>) -> Self {
        let names = ["red", "green", "blue", "opacity"].into_iter().take(bands.len());
        let colours = names.map(|name| BandName {
            name: name.to_owned(),
            in_vertical_unit: false,
            counts: false,
        });
        Self { bands, colours: colours.collect(), notes }
    }
}

/// As [`run`](super::run), for bands computed from the grid; a thread that reads them needs `thread_bytes`
/// more.
pub(crate) fn run_of(
    job: &ConvertJob,
    thread_bytes: u64,
    progress: &dyn Progress,
    cancel: &Cancel,
    front: impl FnOnce(Box<dyn GridSource>) -> Result<DerivedBands>,
) -> Result<ConvertReport> {
    let reserved = ReservedMemory::default();
    run_beside(job, thread_bytes, reserved, progress, cancel, |inner, _| front(inner))
}

/// Bytes of the budget for other data of the whole job.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReservedMemory {
    /// The usual number.
    pub(crate) wanted: u64,
    /// The number if that leaves too little for the grid.
    pub(crate) least: u64,
}

/// As [`run_of`], with other data of the whole job: `front` gets the number of bytes that are reserved for them.
pub(crate) fn run_beside(
    job: &ConvertJob,
    thread_bytes: u64,
    reserved: ReservedMemory,
    progress: &dyn Progress,
    cancel: &Cancel,
    front: impl FnOnce(Box<dyn GridSource>, u64) -> Result<DerivedBands>,
) -> Result<ConvertReport> {
    let open = |options: &GridOpenOptions| raster::open_all(job.input.names(), options);
    run_opened(job, &open, thread_bytes, reserved, (progress, cancel), front)
}

/// As [`run_beside`], for a grid that is opened by `open`.
pub(crate) fn run_opened(
    job: &ConvertJob,
    opener: OpenGrid<'_>,
    thread_bytes: u64,
    reserved: ReservedMemory,
    watch: (&dyn Progress, &Cancel),
    front: impl FnOnce(Box<dyn GridSource>, u64) -> Result<DerivedBands>,
) -> Result<ConvertReport> {
    let (progress, cancel) = watch;
    let format = job.options.format(&job.output)?;
    format.check(&job.options.written.co)?;
    terrane_files::atomic::refuse_existing(&job.output, job.options.file.replacing.overwrite)?;
    let worker = worker_bytes(job, format, thread_bytes);
    let resources = &job.options.resources;
    let options = job.options.grid.options(resources, GridOpenOptions::default().cache_bytes)?;
    let ReservedMemory { wanted, least } = reserved;
    let open = |reserved| open(opener, &options, resources, worker, reserved);
    let ((source, shares), reserved) = match open(wanted) {
        Err(error) if error.kind() == ErrorKind::Resource && wanted > least => {
            (open(least)?, least)
        }
        opened => (opened?, wanted),
    };
    not_member(source.as_ref(), &job.output)?;
    let cautions = raster::cautions(source.info());
    let DerivedBands { bands, colours, notes } = front(source, reserved)?;
    let mut notes = [cautions, notes].concat();
    let bands: Vec<&dyn GridSource> = bands.iter().map(AsRef::as_ref).collect();
    let memory = resources.memory;
    let budget = ConvertMemory { shares, memory, reserved, worker, thread_bytes };
    let report = copy_of(&bands, colours, job, &budget, progress, cancel)?;
    let water = options.water.and_then(|water| water.report());
    notes.extend(report.notes.iter().cloned().chain(water.iter().flat_map(WaterReport::notes)));
    Ok(ConvertReport { notes, water, ..report })
}

/// As [`run`](super::run), from an open grid (`job.input` is only used in the report).
pub fn copy(
    source: &dyn GridSource,
    job: &ConvertJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let worker = worker_bytes(job, job.options.format(&job.output)?, 0);
    let Resources { memory, threads, .. } = job.options.resources;
    let shares = memory::divide(memory, threads, worker)
        .or_else(|error| least_shares(memory, worker).ok_or(error))?;
    let budget = ConvertMemory { shares, memory, reserved: 0, worker, thread_bytes: 0 };
    copy_of(&[source], Vec::new(), job, &budget, progress, cancel)
}

/// Copies a band, or several that are colours, with these names.
fn copy_of(
    bands: &[&dyn GridSource],
    colours: Vec<BandName>,
    job: &ConvertJob,
    budget: &ConvertMemory,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let start = Instant::now();
    let format = job.options.format(&job.output)?;
    let Some(source) = bands.first().copied() else { return Ok(ConvertReport::default()) };
    let (window, info) = (source.info().bounds(), source.info());
    let (are_colours, read) = (!colours.is_empty(), job.read_beside(source)?);
    let options = GridWriteOptions { read, bands: colours, are_colours, ..job.write_options() };
    let mut sink = format.create(&job.output, info, &options)?;
    let threads = budget.threads_for(sink.as_ref(), format)?;
    let samples = u64::from(info.width) * u64::from(info.height);
    progress.begin("convert", samples);
    let pieces = CopyPieces::new(window, source, sink.as_ref(), budget.shares.cache);
    let task = CopyTask { sources: bands, window, sink: sink.as_ref(), pieces };
    let summary = task.run(threads, progress, cancel)?;
    progress.end();
    copy_levels(sink.as_mut(), threads, progress, cancel)?;
    cancel.check()?;
    let (written, mut notes) = (sink.info().clone(), sink.notes());
    notes.extend(moved_nodata(job.options.samples.out_nodata, info, &written));
    let output_bytes = sink.finish()?;
    let run = RunStatistics::since(start, &job.options.resources).with_threads(threads);
    Ok(ConvertReport {
        format: format.name.to_owned(),
        samples,
        notes,
        output_bytes,
        samples_per_second: run.rate(samples),
        run,
        ..report(job, &written, &summary)
    })
}

/// A note if the sample type does not hold the nodata value exactly.
fn moved_nodata(requested: Option<f64>, read: &GridInfo, written: &GridInfo) -> Option<String> {
    let keeps_units = (read.scale, read.offset) == (written.scale, written.offset);
    let nodata = requested.or(read.nodata.filter(|_| keeps_units))?;
    let stored = written.nodata?;
    let is_moved = (nodata - stored).abs() > HAIR * nodata.abs();
    let name = written.sample_type.name();
    is_moved.then(|| format!("nodata is {stored}, the {name} nearest to {nodata}"))
}

/// Writes overviews in order.
pub fn copy_levels(
    sink: &mut dyn GridSink,
    threads: usize,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<()> {
    while let Some(levels) = sink.next_level()? {
        let sources: Vec<&dyn GridSource> = levels.iter().map(AsRef::as_ref).collect();
        let Some(first) = sources.first() else { continue };
        let window = first.info().bounds();
        progress.begin("overview", window.len() as u64);
        let pieces = CopyPieces::new(window, *first, sink, 0);
        let task = CopyTask { sources: &sources, window, sink, pieces };
        task.run(threads, progress, cancel)?;
        progress.end();
    }
    Ok(())
}

fn report(job: &ConvertJob, info: &GridInfo, summary: &CopyStatistics) -> ConvertReport {
    let [lowest, highest] =
        [summary.lowest, summary.highest].map(|height| (summary.valid > 0).then_some(height));
    ConvertReport {
        input: job.input.to_string(),
        output: job.output.display().to_string(),
        width: info.width,
        height: info.height,
        crs: info.crs.label(),
        sample_type: info.sample_type.name().to_owned(),
        nodata: info.nodata,
        valid_samples: summary.valid,
        lowest,
        highest,
        ..ConvertReport::default()
    }
}

/// Relative tolerance of nodata values, which are printed with about six digits.
const HAIR: f64 = 1e-6;

/// Opens the input beside `reserved` bytes; in little memory for one thread.
fn open(
    open: OpenGrid<'_>,
    options: &GridOpenOptions,
    resources: &Resources,
    worker: u64,
    reserved: u64,
) -> Result<memory::Opened> {
    memory::open_with(open, reserved, options, resources, worker).or_else(|error| {
        let left = resources.memory.saturating_sub(reserved);
        let Some(shares) = least_shares(left, worker) else { return Err(error) };
        let cache_bytes = usize::try_from(shares.cache).unwrap_or(usize::MAX);
        let options = GridOpenOptions { cache_bytes, threads: 1, ..options.clone() };
        // What the first error asks for is enough for blocks that do not fit, too.
        open(&options).map(|source| (source, shares)).or(Err(error))
    })
}

/// Bytes that a copy takes beside a block and the cache. It takes less than other jobs: nothing waits for the writer.
const COPY_BYTES: u64 = 8 << 20;
/// Least cache.
const MIN_CACHE: u64 = 2 << 20;

/// Shares for one thread in less memory than [`memory::divide`] accepts; `None` if a block does not fit.
fn least_shares(memory: u64, worker: u64) -> Option<MemoryShares> {
    let rest = memory.checked_sub(worker.saturating_add(COPY_BYTES))?;
    let cache = rest.saturating_sub(memory::PROGRAM - COPY_BYTES).max(MIN_CACHE.min(rest));
    Some(MemoryShares { threads: 1, cache, mesh: 0 })
}

/// How the job's memory is divided.
struct ConvertMemory {
    shares: MemoryShares,
    memory: u64,
    /// Bytes of the budget for other data of the whole job.
    reserved: u64,
    /// Bytes of a thread that were assumed when the memory was divided.
    worker: u64,
    /// Bytes of a thread beside its output block.
    thread_bytes: u64,
}

/// Default number of samples of a block: a tile of 512 x 512.
const USUAL_SAMPLES: u64 = 512 * 512;

/// Bytes of a thread: an output block, and `thread_bytes` more.
fn worker_bytes(job: &ConvertJob, format: &GridFormat, thread_bytes: u64) -> u64 {
    let side = job.options.written.co.iter().find(|(key, _)| key.eq_ignore_ascii_case("BLOCKSIZE"));
    let side = side.and_then(|(_, value)| value.parse::<u64>().ok());
    let samples = side.map_or(USUAL_SAMPLES, |side| side.saturating_mul(side));
    samples.saturating_mul(format.bytes_per_sample).saturating_add(thread_bytes)
}

impl ConvertMemory {
    /// Number of threads that fit with the actual blocks of a sink. Blocks as wide as the grid may be larger
    /// than was thought when the source was opened.
    fn threads_for(&self, sink: &dyn GridSink, format: &GridFormat) -> Result<usize> {
        let ((width, height), info) = (sink.block(), sink.info());
        let block = u64::from(width.min(info.width)) * u64::from(height.min(info.height));
        let block =
            block.saturating_mul(format.bytes_per_sample).saturating_add(self.thread_bytes).max(1);
        let MemoryShares { threads, cache, mesh } = self.shares;
        let room = self.worker * threads as u64 + mesh;
        match room / block {
            0 => {
                let least = memory::least_with(self.worker, block).max(cache);
                Err(memory::too_little(self.memory, least.saturating_add(self.reserved)))
            }
            fitting => Ok(threads.min(usize::try_from(fitting).unwrap_or(usize::MAX))),
        }
    }
}
