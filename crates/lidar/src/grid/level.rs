//! A terrain model with flattened water: written to a temporary file without water, then copied with it.

use std::time::Instant;

use super::job::GridJob;
use super::report::{GridReport, GridStage};
use terrane_base::error::{Error, Result};
use terrane_engine::memory::cache_beside;
use terrane_engine::options::GridInput;
use terrane_engine::{Cancel, Progress};
use terrane_files::{folder_for, name_of};
use terrane_raster::{self as raster, GridOpenOptions, GridSource, WaterReport};
use terrane_terrain::convert::{copy_levels, task};

/// Format of the temporary file, which holds all metadata of a grid.
const FORMAT: &str = "store";

/// Runs a checked job with the water of the file `water`; `make` runs one without.
pub(super) fn run(
    job: &GridJob,
    water: &str,
    make: impl FnOnce(&GridJob) -> Result<GridReport>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridReport> {
    let start = Instant::now();
    let reading = GridInput::with_water(Some(water.to_owned()));
    let cache_bytes = cache_beside(job.resources.memory);
    let options = reading.options(&job.resources, cache_bytes)?;
    let folder = folder_for(&job.output, job.resources.temp_dir.as_deref());
    let temporary = tempfile::Builder::new()
        .prefix(".terrane-")
        .tempdir_in(folder)
        .map_err(|e| Error::write(folder, e))?;
    let bare = temporary.path().join("ground.tif");
    let ground = GridJob {
        output: bare.clone(),
        format: Some(FORMAT.to_owned()),
        creation: Vec::new(),
        water: None,
        ..job.clone()
    };
    let made = make(&ground)?;
    let copy_start = Instant::now();
    let source = raster::open_all(&[name_of(bare)?], &options)?;
    let (output_bytes, notes) = copy(&*source, job, &options, progress, cancel)?;
    let water = options.water.and_then(|water| water.report());
    let rising = water.iter().flat_map(WaterReport::notes).collect();
    let mut report = GridReport {
        output: job.output.display().to_string(),
        format: job.format()?.name.to_owned(),
        output_bytes,
        water,
        notes: [made.notes, notes, rising].concat(),
        stages: [made.stages, vec![GridStage::since("water", copy_start)]].concat(),
        ..made
    };
    report.run.wall_seconds = start.elapsed().as_secs_f64();
    Ok(report)
}

/// Copies the temporary grid to the output; returns its bytes, and notes on metadata that the format does not
/// hold.
fn copy(
    source: &dyn GridSource,
    job: &GridJob,
    options: &GridOpenOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(u64, Vec<String>)> {
    let info = source.info();
    let mut sink = job.format()?.create(&job.output, info, &job.write_options())?;
    progress.begin("water", info.bounds().len() as u64);
    let pieces =
        task::CopyPieces::new(info.bounds(), source, sink.as_ref(), options.cache_bytes as u64);
    let task =
        task::CopyTask { sources: &[source], window: info.bounds(), sink: sink.as_ref(), pieces };
    task.run(job.resources.threads, progress, cancel)?;
    progress.end();
    copy_levels(sink.as_mut(), job.resources.threads, progress, cancel)?;
    cancel.check()?;
    let notes = sink.notes();
    Ok((sink.finish()?, notes))
}
