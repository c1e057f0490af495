//! `terrane plan`: work on a large input is written down as tasks for many machines or many nights.

pub(crate) mod run;
pub(crate) mod status;

use std::path::PathBuf;

use clap::Subcommand;

use terrane_options::check_given;

use crate::cli::operation::{Source, take};
use crate::cli::shared::many::Many;
use crate::cli::shared::tabled::Tabled;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{self, Outcome, args, many, names, parse, system};
use crate::cli::tin;
use crate::error::{Error, Result};
use crate::jobs::cloud_tin::CloudTinJob;
use crate::jobs::cloud_tin::plan::plan_cloud_tin;
use crate::jobs::grid::GridOptions;
use crate::jobs::operation::{Divisible, Operation, Request};
use crate::jobs::plan::PlanJob;
use crate::jobs::sift::Sifted;
use crate::jobs::tiles::TilesOptions;
use crate::jobs::tin::{Goal, TinJob, plan_work};
use crate::jobs::translate::PointsOptions;
use crate::jobs::{Cancel, Resources};
use crate::mesh;
use crate::raster::Inputs;

/// Write down the work on a large input as tasks, do them, here or on many machines, and tell how far they are
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, Subcommand)]
enum What {
    Tin(Box<TinArgs>),
    /// Plan a grid of the points of clouds, of statistics or a model of the terrain; the same grid as that of `terrane
    /// grid`
    Grid(Box<Planned<GridOptions>>),
    /// Plan terrain tiles of a grid for viewers of the globe; the same tiles as those of `terrane tiles`
    Tiles(Box<Planned<TilesOptions>>),
    /// Plan squares of the points of clouds; the same files as those of `terrane points --tile`
    Points(Box<Planned<PointsOptions>>),
    Run(Box<run::Args>),
    Status(Box<status::Args>),
    Finish(Box<run::FinishArgs>),
}

/// Plan a triangle mesh with a proven vertical error bound, of a grid or of the points of clouds; the same mesh as that
/// of `terrane tin`
#[derive(Clone, Debug, clap::Args)]
struct TinArgs {
    /// Grid file, or a synthetic terrain by name such as synth:rough,size=80001; several files, a
    /// folder, a list or a pattern in quotes are one mosaic. Or point clouds, one or many
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    /// Largest vertical distance of any valid sample from the mesh, in the vertical unit of the data
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    max_error: f64,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    /// Mesh format
    #[arg(short, long, value_name = "NAME", default_value = "PLY", help_heading = "Output")]
    format: String,
    #[command(flatten)]
    system: system::System,
    #[command(flatten)]
    points: shared::points::Points,
    #[command(flatten)]
    method: tin::Method,
    /// Of a grid: rows of tiles in a task, 2 or more [default: as many as have about 134 million samples]; of a cloud:
    /// most points of a task, but for the 131,072 that are worked on together [default: about 17 million]
    #[arg(long, aliases = ["strip-rows", "cut"], value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Method")]
    task_size: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

/// Plan what an operation makes.
#[derive(Clone, Debug, clap::Args)]
struct Planned<O: Divisible<Input: Source>> {
    #[arg(help = O::Input::NAMES_PLANNED, required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    options: Tabled<O, true>,
    #[arg(help = O::TASK_SIZE, long, alias = task_size_alias(O::NAME), value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Method")]
    task_size: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

/// What the size of tasks was called.
fn task_size_alias(operation: &str) -> &'static str {
    if operation == GridOptions::NAME { "tile" } else { "cut" }
}

impl<O: Divisible<Input: Source>> Planned<O> {
    fn run(&self, cancel: &Cancel, summary: fn(&O::Status) -> String) -> Result<Outcome> {
        let mut options = self.options.0.clone();
        let given = self.options.1.as_slice();
        check_given(&options, given)?;
        let sifted = take((&mut options, given), self.input.clone(), &self.many)?;
        let (inputs, skipped) = (Inputs::from(sifted.names), sifted.skipped.as_slice());
        let (output, progress) = (self.folder.as_path(), self.show.progress());
        let request =
            Request { inputs: &inputs, output, skipped, progress: progress.as_ref(), cancel };
        let report = options.plan(request, self.task_size)?;
        self.show.tell(&report, || summary(&report))?;
        Ok(Outcome::Kept)
    }
}

impl Verb for Args {
    const NAME: &'static str = "plan";

    fn many(&self) -> Option<&Many> {
        match &self.what {
            What::Tin(args) => Some(&args.many),
            What::Grid(args) => Some(&args.many),
            What::Tiles(args) => Some(&args.many),
            What::Points(args) => Some(&args.many),
            What::Run(_) | What::Status(_) | What::Finish(_) => None,
        }
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    match &args.what {
        What::Tin(args) => plan_tin(args, cancel),
        What::Grid(args) => args.run(cancel, status::grid_summary),
        What::Tiles(args) => args.run(cancel, status::tiles_summary),
        What::Points(args) => args.run(cancel, status::points_summary),
        What::Run(args) => run::run(args, cancel),
        What::Status(args) => status::run(args),
        What::Finish(args) => run::finish(args, cancel),
    }
}

fn plan_tin(args: &TinArgs, cancel: &Cancel) -> Result<Outcome> {
    if args.many.are_clouds(&args.input)? {
        return plan_of_cloud(args, cancel);
    }
    args.points.refuse(&args.input[0])?;
    if args.task_size.is_some_and(|rows| rows < 2) {
        return Err(Error::usage("--task-size is 1: tasks have two rows of tiles at least")
            .remedy("pass 2 or more, or leave it out"));
    }
    let resources = Resources::default();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Grids(&options), &resources)?;
    let args = &TinArgs { input: names, ..args.clone() };
    let job = PlanJob { skipped, ..job(args)? };
    let report = plan_work(&job, args.show.progress().as_ref(), cancel)?;
    args.show.tell(&report, || status::summary(&report))?;
    Ok(Outcome::Kept)
}

fn plan_of_cloud(args: &TinArgs, cancel: &Cancel) -> Result<Outcome> {
    let of_grids = [("--to-crs", args.system.is_given())];
    let of_grids = of_grids.into_iter().chain(args.method.options_of_grids());
    tin::refuse_options(&args.input[0], of_grids, &args.grid)?;
    let resources = Resources::default();
    let options = args.points.open_options(&args.grid, &resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Clouds(&options), &resources)?;
    let format = mesh::by_path(&args.folder, Some(&args.format))?;
    let output = args.folder.join("mesh").with_extension(format.extensions[0]);
    let job = CloudTinJob {
        options: args.many.reading(options),
        format: Some(format.name.to_owned()),
        keep_points: args.method.keep_points.clone(),
        breaklines: args.method.breaklines.clone(),
        ..CloudTinJob::new(names, output, args.max_error, resources)
    };
    let plan = PlanJob { job, folder: args.folder.clone(), cut: args.task_size, skipped };
    let report = plan_cloud_tin(&plan, args.show.progress().as_ref(), cancel)?;
    args.show.tell(&report, || status::cloud_summary(&report))?;
    Ok(Outcome::Kept)
}

fn job(args: &TinArgs) -> Result<PlanJob<TinJob>> {
    args.grid.check_all(&args.input)?;
    args.method.check_triangulation()?;
    let format = mesh::by_path(&args.folder, Some(&args.format))?;
    let tin = TinJob {
        reading: args.grid.reading(args.method.water.as_ref()),
        format: Some(format.name.to_owned()),
        refinement: args.method.refinement(),
        tile: args.method.tile(),
        transform: args.system.transform()?,
        ..TinJob::new(args.input.clone(), args.folder.join("mesh"), Goal::MaxError(args.max_error))
    };
    let folder = args.folder.clone();
    Ok(PlanJob { job: tin, folder, cut: args.task_size, skipped: Vec::new() })
}
