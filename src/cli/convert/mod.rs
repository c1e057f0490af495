//! `terrane convert`: any grid becomes a clean file of any format that can be written, on its own lattice or another.

mod warp;

use std::path::PathBuf;

use crate::atomic;
use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, pipes, report};
use crate::error::{Error, ErrorKind, Result};
use crate::files::is_made;
use crate::jobs::Cancel;
use crate::jobs::convert::{self, ConvertJob};
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::warp::{self as warps, WarpJob};
use crate::raster::{SampleType, write};

/// Copy a grid, or a part of it, into a file of another format
///
/// A .tif is a store (an uncompressed tiled BigTIFF that is mapped into memory and read fast) unless
/// -f COG or -f GTiff asks for another. Samples are written exactly or not at all: a height that the
/// type does not hold is an error that names its place, unless --round allows the nearest value. Samples
/// stay where they are unless --resampling says how they are to be found elsewhere: in another
/// reference system, at another distance, or where those of another grid are.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic. The last name is that of the file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    written: args::Written,
    /// Type of the written samples, such as int16 or float32 [default: the input's]
    #[arg(long = "type", value_name = "NAME", value_parser = parse::sample_type,
          help_heading = "Output")]
    sample_type: Option<SampleType>,
    /// Written value for voids [default: the one they are read by]
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true,
          value_parser = parse::finite_or_nan, help_heading = "Output")]
    out_nodata: Option<f64>,
    /// Write the nearest value where the type does not hold a height exactly
    #[arg(long, help_heading = "Output")]
    round: bool,
    /// Water of a file of features, in the system of the grid, made level: polygons are lakes, as high as their
    /// lowest bank, and those that a line of the file runs within are rivers, falling along it (drawn downstream)
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    water: Option<String>,
    #[command(flatten)]
    warp: warp::Warp,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

impl Verb for Args {
    const NAME: &'static str = "convert";
    const USAGE: Option<&'static str> = Some("[OPTIONS] <INPUT>... <OUTPUT>");

    fn lists() -> Vec<String> {
        vec![
            lists::grids(),
            lists::grids_written(),
            lists::creation_options(),
            lists::EXIT_CODES.to_owned(),
        ]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let grids = many::Kind::Grids(&options);
    let mut input = args.input.clone();
    let mut stdin = pipes::Stdin::expect(&mut input, pipes::Holds::Grid, &resources)?;
    input = args.many.find(&input, grids)?;
    args.grid.check_all(&input)?;
    let job = ConvertJob {
        format: args.written.format.clone(),
        creation: args.written.co.clone(),
        reading: args.grid.reading(args.water.as_ref()),
        sample_type: args.sample_type,
        out_nodata: args.out_nodata,
        round: args.round,
        overwrite: args.written.overwrite,
        resources: resources.clone(),
        ..ConvertJob::new(input.clone(), &args.output)
    };
    check(&job)?;
    let warp = args.warp.job(&job)?;
    stdin.gather(&mut input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(input, grids, &resources)?;
    let job = ConvertJob { input: stdin.inputs(names), ..job };
    match warp {
        Some(warp) => move_samples(&WarpJob { copy: job, ..warp }, &skipped, &args.show, cancel),
        None => copy(&job, &skipped, &args.show, cancel),
    }
}

/// Runs a checked copy on another lattice and tells about it.
fn move_samples(
    job: &WarpJob,
    skipped: &[Skipped],
    show: &args::Show,
    cancel: &Cancel,
) -> Result<Outcome> {
    let report = warps::run(job, show.progress().as_ref(), cancel)?;
    let told = report::WithSkipped { report: &report, skipped };
    show.tell(&told, || report::plain(&report))?;
    Ok(Outcome::Kept)
}

/// Runs a checked copy and tells about it.
pub(super) fn copy(
    job: &ConvertJob,
    skipped: &[Skipped],
    show: &args::Show,
    cancel: &Cancel,
) -> Result<Outcome> {
    let made = convert::run(job, show.progress().as_ref(), cancel);
    let report = made.map_err(|e| name_size(e, &job.input.to_string()))?;
    let told = report::WithSkipped { report: &report, skipped };
    show.tell(&told, || report::plain(&report))?;
    Ok(Outcome::Kept)
}

/// The size of a terrain was asked for here: beyond a limit, it is no fault of a file.
fn name_size(error: Error, input: &str) -> Error {
    if error.kind() != ErrorKind::Limit || !is_made(input) {
        return error;
    }
    Error::usage(format!("a store cannot hold a terrain of this size: {error}"))
        .remedy("choose a smaller size")
}

/// What can be known to be wrong before the input is opened.
pub(super) fn check(job: &ConvertJob) -> Result<()> {
    atomic::refuse_stdout(&job.output)?;
    let format = write::by_path(&job.output, job.format.as_deref())?;
    format.check(&job.creation)?;
    check::not_inputs(job.input.names(), &[&job.output])?;
    check::not_among(job.reading.clip.as_slice(), &[&job.output])?;
    check::not_among(job.reading.water.as_slice(), &[&job.output])?;
    check::new_file(&job.output, job.overwrite)
}
