//! `terrane plan`: division of a large job into tasks for many machines or several runs.

pub(crate) mod run;
pub(crate) mod status;

use std::path::PathBuf;

use clap::Subcommand;

use terrane_options::check_planned;

use crate::cli::operation::{OperationInput, RunArguments, take};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::union::InputUnion;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, names};
use crate::cli::tin;
use terrane_base::error::{Error, Result};
use terrane_engine::Cancel;
use terrane_engine::operation::{Divisible, Operation, RunRequest, plan_of};
use terrane_engine::plan::StatusReport;
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::points::PointsOptions;
use terrane_raster::Inputs;
use terrane_terrain::tin::TinOptions;
use terrane_tiles::TilesOptions;

/// Divide the work on a large input into tasks, run them on one or many machines, and show their status
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct PlanArgs {
    #[command(subcommand)]
    what: PlanCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum PlanCommand {
    Tin(Box<TinArgs>),
    /// Plan a grid of a point cloud, of statistics or a terrain model: the same grid as by `terrane grid`
    Grid(Box<PlanCommandOptions<GridOptions>>),
    /// Plan terrain tiles of a grid for globe viewers: the same tiles as by `terrane tiles`
    Tiles(Box<PlanCommandOptions<TilesOptions>>),
    /// Plan square tiles of a point cloud: the same files as by `terrane points --tile`
    Points(Box<PlanCommandOptions<PointsOptions>>),
    Run(Box<run::PlanRunArgs>),
    Status(Box<status::PlanStatusArgs>),
    Finish(Box<run::FinishArgs>),
}

/// Plan a triangle mesh of a grid or point cloud with a proven vertical error bound: the same mesh as by `terrane tin`
#[derive(Clone, Debug, clap::Args)]
struct TinArgs {
    /// Grid file, or name of a synthetic terrain such as synth:rough,size=80001; several files, a folder, a list or a
    /// quoted pattern are one mosaic. Or one or more point clouds
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and its task results: new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: batch::InputSelection,
    #[command(flatten)]
    options: InputUnion<tin::TinSources, true>,
    /// Grids: rows of tiles in a task, 2 or more [default: about 134 million samples]. Point clouds: maximum number of
    /// points in a task, at least 131,072 [default: about 17 million]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Method")]
    task_size: Option<u32>,
    /// Former name of the task size for grids
    #[arg(long, hide = true, conflicts_with = "task_size", value_parser = clap::value_parser!(u32).range(1..))]
    strip_rows: Option<u32>,
    /// The same for clouds
    #[arg(long, hide = true, conflicts_with_all = ["task_size", "strip_rows"], value_parser = clap::value_parser!(u32).range(1..))]
    cut: Option<u32>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

impl TinArgs {
    fn run(&self, cancel: &Cancel) -> Result<VerbOutcome> {
        let Self { input, folder, many, options, show, .. } = self;
        let frame = RunArguments {
            input,
            output: folder,
            given: options.given(),
            report: None,
            many,
            show,
        };
        match many.are_clouds(input)? {
            true => {
                let options: CloudTinOptions = options.of(&input[0])?;
                refuse_size("--strip-rows", self.strip_rows, "grids")?;
                plan(options, &frame, self.task_size.or(self.cut), cancel, status::cloud_summary)
            }
            false => {
                let options: TinOptions = options.of(&input[0])?;
                refuse_size("--cut", self.cut, "point clouds")?;
                plan(options, &frame, self.task_size.or(self.strip_rows), cancel, status::summary)
            }
        }
    }
}

/// Fails for the task size of another kind of input.
fn refuse_size(option: &str, given: Option<u32>, of: &str) -> Result<()> {
    match given {
        None => Ok(()),
        Some(_) => Err(Error::usage(format!("{option} is for {of}")).remedy("pass --task-size")),
    }
}

/// Plan what an operation makes.
#[derive(Clone, Debug, clap::Args)]
struct PlanCommandOptions<O: Divisible<Input: OperationInput>> {
    #[arg(help = O::Input::NAMES_PLANNED, required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and its task results: new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: batch::InputSelection,
    #[command(flatten)]
    options: OperationOptionArgs<O, true>,
    #[arg(help = O::TASK_SIZE, long, alias = task_size_alias(O::NAME), value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Method")]
    task_size: Option<u32>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Former name of the task size.
fn task_size_alias(operation: &str) -> &'static str {
    if operation == GridOptions::NAME { "tile" } else { "cut" }
}

impl<O: Divisible<Input: OperationInput>> PlanCommandOptions<O> {
    fn run(
        &self,
        cancel: &Cancel,
        summary: fn(&StatusReport<O::Status>) -> String,
    ) -> Result<VerbOutcome> {
        let Self {
            input,
            folder,
            many,
            options: OperationOptionArgs(options, given),
            task_size,
            show,
        } = self;
        let frame = RunArguments { input, output: folder, given, report: None, many, show };
        plan(options.clone(), &frame, *task_size, cancel, summary)
    }
}

/// Writes a plan to a folder, and prints its status.
fn plan<O: Divisible<Input: OperationInput>>(
    mut options: O,
    frame: &RunArguments<'_>,
    task_size: Option<u32>,
    cancel: &Cancel,
    summary: fn(&StatusReport<O::Status>) -> String,
) -> Result<VerbOutcome> {
    let RunArguments { input, output, given, many, show, .. } = *frame;
    check_planned(&options, given)?;
    let readable = take::<O, O::Input>(&mut options, given, input.to_vec(), many)?;
    let (inputs, skipped) = (&Inputs::from(readable.names), readable.skipped.as_slice());
    let (progress, is_measured) = (show.progress(), false);
    let progress = progress.as_ref();
    let request = RunRequest { inputs, output, skipped, is_measured, progress, cancel };
    let report = plan_of(&options, request, task_size)?;
    show.print(&report, || summary(&report))?;
    Ok(VerbOutcome::Kept)
}

impl Verb for PlanArgs {
    const NAME: &'static str = "plan";

    fn input_selection(&self) -> Option<&InputSelection> {
        match &self.what {
            PlanCommand::Tin(args) => Some(&args.many),
            PlanCommand::Grid(args) => Some(&args.many),
            PlanCommand::Tiles(args) => Some(&args.many),
            PlanCommand::Points(args) => Some(&args.many),
            PlanCommand::Run(_) | PlanCommand::Status(_) | PlanCommand::Finish(_) => None,
        }
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, call.cancel)
    }
}

fn run(args: &PlanArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    match &args.what {
        PlanCommand::Tin(args) => args.run(cancel),
        PlanCommand::Grid(args) => args.run(cancel, status::grid_summary),
        PlanCommand::Tiles(args) => args.run(cancel, status::tiles_summary),
        PlanCommand::Points(args) => args.run(cancel, status::points_summary),
        PlanCommand::Run(args) => run::run(args, cancel),
        PlanCommand::Status(args) => status::run(args),
        PlanCommand::Finish(args) => run::finish(args, cancel),
    }
}
