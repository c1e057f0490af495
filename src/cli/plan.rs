//! `terrane plan`: work on a large input is written down as tasks for many machines or many nights.

use std::path::PathBuf;

use clap::Subcommand;

use crate::cli::{Outcome, args, check, parse, say, status, tin};
use crate::error::Result;
use crate::output;
use crate::pipeline::tin::{Goal, PlanJob, TinJob, plan_work};
use crate::pipeline::{Cancel, Resources};

/// Write down the work on a large input as tasks, for `terrane run` here or on many machines
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, Subcommand)]
enum What {
    Tin(Box<TinArgs>),
}

/// Plan a triangle mesh with a proven vertical error bound; the same mesh as that of `terrane tin`
#[derive(Clone, Debug, clap::Args)]
struct TinArgs {
    /// Grid file, or a synthetic terrain by name such as synth:rough,size=80001; several files, a
    /// folder, a list or a pattern in quotes are one mosaic
    #[arg(required = true)]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    /// Largest vertical distance of any valid sample from the mesh, in the vertical unit of the data
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    max_error: f64,
    #[command(flatten)]
    grid: args::Grid,
    /// Mesh format
    #[arg(short, long, value_name = "NAME", default_value = "PLY", help_heading = "Output")]
    format: String,
    #[command(flatten)]
    method: tin::Method,
    /// Rows of tiles in a task, 2 or more [default: as many as have about 134 million samples]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..), help_heading = "Method")]
    strip_rows: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let What::Tin(args) = &args.what;
    let job = job(args)?;
    let report = plan_work(&job, args.show.progress().as_ref(), cancel)?;
    if args.show.json {
        say::json(&report)?;
    } else if !args.show.quiet {
        say::result(&status::summary(&report))?;
    }
    Ok(Outcome::Kept)
}

fn job(args: &TinArgs) -> Result<PlanJob> {
    check::inputs(&args.input)?;
    args.grid.check_all(&args.input)?;
    let format = output::by_path(&args.folder, Some(&args.format))?;
    let tin = TinJob {
        input: args.input.clone().into(),
        band: args.grid.band(),
        nodata: args.grid.nodata,
        output: args.folder.join("mesh"),
        format: Some(format.name.to_owned()),
        overwrite: false,
        split: None,
        solid_base: None,
        goal: Goal::MaxError(args.max_error),
        strict: args.method.strict,
        drop: !args.method.no_drop,
        tile: args.method.tile(),
        measure: true,
        resources: Resources::default(),
    };
    Ok(PlanJob { tin, folder: args.folder.clone(), strip_rows: args.strip_rows })
}
