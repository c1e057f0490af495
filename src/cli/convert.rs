//! `terrane convert`: any grid becomes a store that is read fast.

use std::path::{Path, PathBuf};

use crate::cli::{Outcome, args, check, parse, say, text};
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::Cancel;
use crate::pipeline::convert::{self, ConvertJob};
use crate::pipeline::surface::is_synthetic;

/// Endings of a store.
const ENDINGS: &[&str] = &["tif", "tiff"];

/// Copy a grid into an uncompressed tiled BigTIFF that is mapped into memory and read fast
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic
    #[arg(required = true)]
    input: Vec<String>,
    /// GeoTIFF to write
    output: PathBuf,
    /// Replace a file that exists
    #[arg(long)]
    overwrite: bool,
    /// Part to copy, in the coordinates of the data
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true,
          value_parser = parse::bbox)]
    bbox: Option<[f64; 4]>,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    machine: args::Machine,
    #[command(flatten)]
    show: args::Show,
}

pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    check::inputs(&args.input)?;
    args.grid.check_all(&args.input)?;
    let job = ConvertJob {
        band: args.grid.band(),
        nodata: args.grid.nodata,
        bbox: args.bbox,
        overwrite: args.overwrite,
        resources: args.machine.resources(),
        ..ConvertJob::new(args.input.clone(), &args.output)
    };
    copy(&job, &args.show, cancel)
}

/// Runs a checked copy and tells about it.
pub(super) fn copy(job: &ConvertJob, show: &args::Show, cancel: &Cancel) -> Result<Outcome> {
    check(job.input.names(), &job.output, job.overwrite)?;
    let made = convert::run(job, show.progress().as_ref(), cancel);
    let report = made.map_err(|e| name_size(e, &job.input.to_string()))?;
    if show.json {
        say::json(&report)?;
    } else if !show.quiet {
        let rows = text::rows(&serde_json::to_value(&report).unwrap_or_default());
        let title = format!("{} -> {}", job.input, job.output.display());
        let told = rows.into_iter().filter(|(name, _)| name != "input" && name != "output");
        say::result(&format!("{title}\n{}", text::table(&told.collect::<Vec<_>>())))?;
    }
    Ok(Outcome::Kept)
}

/// The size of a terrain was asked for here: beyond a limit, it is no fault of a file.
fn name_size(error: Error, input: &str) -> Error {
    if error.kind() != ErrorKind::Limit || !is_synthetic(input) {
        return error;
    }
    Error::usage(format!("a store cannot hold a terrain of this size: {error}"))
        .remedy("choose a smaller size")
}

fn check(inputs: &[String], output: &Path, overwrite: bool) -> Result<()> {
    check::inputs(inputs)?;
    check::ending(output, ENDINGS, "a grid store")?;
    check::not_inputs(inputs, &[output])?;
    check::new_file(output, overwrite)
}
