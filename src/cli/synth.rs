//! `terrane synth`: synthetic terrains, point clouds and lines, written to a file.

use std::path::PathBuf;

use serde::Serialize;
use terrane_options::OptionCodec;

use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, check, lists, report};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud as cloud;
use terrane_cloud::write::PointFormat;
use terrane_engine::options::PointFormatNumber;
use terrane_engine::{Cancel, Resources};
use terrane_files::atomic;
use terrane_lidar::synthetic_cloud::{self, SyntheticCloudJob};
use terrane_simplify::synthetic_lines::{self, SyntheticLinesJob};
use terrane_synth::lines::SyntheticLines;
use terrane_terrain::convert::{self, ConvertJob};
use terrane_vector as vector;

/// Write a synthetic terrain (uncompressed tiled BigTIFF), point cloud (LAS or LAZ) or line file
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SynthArgs {
    /// Name and parameters of a terrain, such as rough,size=4097,seed=7, of a point cloud, such as
    /// cloud,size=1000,density=8,seed=7, or of lines, such as koch,vertices=1000000
    #[arg(value_name = "NAME")]
    name: String,
    /// Output GeoTIFF; .las or .laz for a point cloud; any feature file for lines
    output: PathBuf,
    /// Point format of a point cloud: 0 to 3 (LAS 1.2) or 6 to 8 (LAS 1.4) [default: 6]
    #[arg(long, value_name = "N", value_parser = <PointFormatNumber as OptionCodec<PointFormat>>::parse)]
    point_format: Option<PointFormat>,
    /// Overwrite an existing file
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    resources: OperationOptionArgs<Resources>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

impl Verb for SynthArgs {
    const NAME: &'static str = "synth";

    fn lists() -> Vec<String> {
        vec![
            lists::characters(),
            lists::parameters(),
            lists::cloud_parameters(),
            lists::shapes(),
            lists::line_parameters(),
        ]
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, call.cancel)
    }
}

fn run(args: &SynthArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let name = format!("synth:{}", args.name.strip_prefix("synth:").unwrap_or(&args.name));
    if args.resources.1.contains(&"temp_dir") {
        return Err(
            Error::usage("‹temp_dir› has no effect in `synth`").remedy("leave ‹temp_dir› out")
        );
    }
    if cloud::synth::is_synthetic(&name) {
        return fly(&name, args, cancel);
    }
    if args.point_format.is_some() {
        return Err(Error::usage("--point-format requires a point cloud")
            .remedy("leave --point-format out"));
    }
    match vector::synthetic(name.as_ref()) {
        Some(lines) => draw(lines?, args, cancel),
        None => raise(name, args, cancel),
    }
}

/// Writes a terrain.
fn raise(name: String, args: &SynthArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    atomic::refuse_stdout(&args.output)?;
    check::new_file(&args.output, args.overwrite)?;
    let job = ConvertJob::new(name, &args.output).with(|options| {
        options.file.format = Some("store".to_owned());
        options.file.replacing.overwrite = args.overwrite;
        options.resources = args.resources.0.clone();
    });
    let made = convert::run(&job, args.show.progress().as_ref(), cancel);
    print(&made.map_err(size)?, args)
}

/// A size beyond a limit is a usage error, not a bad input.
pub(super) fn size(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Limit => Error::usage(format!("the terrain is too large: {error}"))
            .remedy("choose a smaller size"),
        _ => error,
    }
}

/// Writes a point cloud.
fn fly(name: &str, args: &SynthArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let job = SyntheticCloudJob {
        survey: cloud::synth::survey(name)?,
        output: args.output.clone(),
        format: args.point_format.unwrap_or_default(),
        overwrite: args.overwrite,
        resources: args.resources.0.clone(),
    };
    check::new_file(&job.output, job.overwrite)?;
    let report = synthetic_cloud::run(&job, args.show.progress().as_ref(), cancel)?;
    print(&report, args)
}

/// Writes lines.
fn draw(lines: SyntheticLines, args: &SynthArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let job = SyntheticLinesJob {
        lines,
        output: args.output.clone(),
        overwrite: args.overwrite,
        resources: args.resources.0.clone(),
    };
    check::new_file(&job.output, job.overwrite)?;
    let report = synthetic_lines::run(&job, args.show.progress().as_ref(), cancel)?;
    print(&report, args)
}

fn print(report: &impl Serialize, args: &SynthArgs) -> Result<VerbOutcome> {
    args.show.print(report, || report::plain(report))?;
    Ok(VerbOutcome::Kept)
}
