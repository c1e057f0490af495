//! `terrane plan`: work on a large input is written down as tasks for many machines or many nights.

pub(crate) mod run;
pub(crate) mod status;

use std::path::PathBuf;

use clap::Subcommand;

use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{self, Outcome, args, many, names, parse, system};
use crate::cli::{grid, points, tiles, tin};
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::cloud_tin::CloudTinJob;
use crate::jobs::cloud_tin::plan::plan_cloud_tin;
use crate::jobs::grid::plan::plan_grid;
use crate::jobs::plan::PlanJob;
use crate::jobs::sift::Sifted;
use crate::jobs::tiles::{TilesJob, plan_tiles};
use crate::jobs::tin::{Goal, TinJob, plan_work};
use crate::jobs::translate::plan::plan_points;
use crate::jobs::{Cancel, Resources};
use crate::mesh;
use crate::raster::write;

/// Write down the work on a large input as tasks, for `terrane run` here or on many machines
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, Subcommand)]
enum What {
    Tin(Box<TinArgs>),
    Grid(Box<GridArgs>),
    Tiles(Box<TilesArgs>),
    Points(Box<PointsArgs>),
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
    /// Of a grid: rows of tiles in a task, 2 or more [default: as many as have about 134 million samples]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..), help_heading = "Method")]
    strip_rows: Option<u32>,
    /// Of a cloud: most points of a task, but for the 131,072 that are worked on together [default: about 17 million]
    #[arg(long, value_name = "POINTS", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Method")]
    cut: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

/// Plan a grid of the points of clouds, of statistics or a model of the terrain; the same grid as that of `terrane
/// grid`
#[derive(Clone, Debug, clap::Args)]
struct GridArgs {
    /// LAS, LAZ, COPC or text files, or a synthetic cloud by name; several files, a folder, a list or
    /// a pattern in quotes are one cloud
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    model: grid::Model,
    #[command(flatten)]
    wanted: grid::Wanted,
    /// Cells along a tile, a multiple of 256; each tile is a task and reads what lies near it
    /// [default: as many as have about 67 million points]
    #[arg(long, value_name = "N", help_heading = "Method")]
    tile: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

/// Plan terrain tiles of a grid for viewers of the globe; the same tiles as those of `terrane tiles`
#[derive(Clone, Debug, clap::Args)]
struct TilesArgs {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in quotes are one
    /// mosaic
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    wanted: tiles::Wanted,
    /// Tiles in a task: regions of about a million samples, each made with all tiles in it, or larger ones [default:
    /// 128]
    #[arg(long, value_name = "N", help_heading = "Method")]
    cut: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

/// Plan squares of the points of clouds; the same files as those of `terrane points --tile`
#[derive(Clone, Debug, clap::Args)]
struct PointsArgs {
    /// LAS, LAZ, COPC or text files, or a synthetic cloud by name; several files, a folder, a list or
    /// a pattern in quotes are one cloud
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Folder for the plan and the results of its tasks; new, empty, or with the same plan
    #[arg(short = 'o', long = "output", value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    wanted: points::Wanted,
    /// Squares along the side of a task, which reads what lies near them [default: as many as have about 67 million
    /// points]
    #[arg(long, value_name = "N", help_heading = "Method")]
    cut: Option<u32>,
    #[command(flatten)]
    show: args::Show,
}

impl Verb for Args {
    const NAME: &'static str = "plan";

    fn many(&self) -> Option<&Many> {
        Some(match &self.what {
            What::Tin(args) => &args.many,
            What::Grid(args) => &args.many,
            What::Tiles(args) => &args.many,
            What::Points(args) => &args.many,
        })
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    match &args.what {
        What::Tin(args) => plan_tin(args, cancel),
        What::Grid(args) => plan_of_grid(args, cancel),
        What::Tiles(args) => plan_of_tiles(args),
        What::Points(args) => plan_of_points(args, cancel),
    }
}

fn plan_of_tiles(args: &TilesArgs) -> Result<Outcome> {
    if args.many.are_clouds(&args.input)? {
        return Err(Error::usage(
            "tiles of a cloud are those of a model of its ground, which is planned first",
        )
        .in_file(&path_of(&args.input[0]))
        .remedy("pass terrane plan grid with --dtm, run it, and plan the tiles of that grid"));
    }
    let resources = Resources::default();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Grids(&options), &resources)?;
    args.grid.check_all(&names)?;
    let job = args.wanted.tiles.0.job(TilesJob {
        reading: args.grid.reading(args.wanted.water.as_ref()),
        resources,
        ..TilesJob::new(names, args.folder.join("tiles"))
    })?;
    let plan = PlanJob { job, folder: args.folder.clone(), cut: args.cut, skipped };
    let report = plan_tiles(&plan)?;
    args.show.tell(&report, || status::tiles_summary(&report))?;
    Ok(Outcome::Kept)
}

fn plan_of_points(args: &PointsArgs, cancel: &Cancel) -> Result<Outcome> {
    let resources = Resources::default();
    let options = args.wanted.open_options(&resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Clouds(&options), &resources)?;
    let options = args.many.reading(options);
    let job = args.wanted.job(names, options, &args.folder.join("points"), resources)?;
    let plan = PlanJob { job, folder: args.folder.clone(), cut: args.cut, skipped };
    let report = plan_points(&plan, args.show.progress().as_ref(), cancel)?;
    args.show.tell(&report, || status::points_summary(&report))?;
    Ok(Outcome::Kept)
}

fn plan_of_grid(args: &GridArgs, cancel: &Cancel) -> Result<Outcome> {
    let format = write::by_name(args.wanted.file.format.as_deref().unwrap_or("GTiff"))?;
    args.wanted.check(format)?;
    let resources = Resources::default();
    let options = args.wanted.open_options(&resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Clouds(&options), &resources)?;
    let mut job = args.model.job(args.wanted.job(&names, resources)?)?;
    job.cloud = args.many.reading(job.cloud);
    job.output = args.folder.join("grid").with_extension(format.extensions[0]);
    let plan = PlanJob { job, folder: args.folder.clone(), cut: args.tile, skipped };
    let report = plan_grid(&plan, args.show.progress().as_ref(), cancel)?;
    args.show.tell(&report, || status::grid_summary(&report))?;
    Ok(Outcome::Kept)
}

fn plan_tin(args: &TinArgs, cancel: &Cancel) -> Result<Outcome> {
    if args.many.are_clouds(&args.input)? {
        return plan_of_cloud(args, cancel);
    }
    args.points.refuse(&args.input[0])?;
    if args.cut.is_some() {
        return Err(Error::usage("--cut is for point clouds, and this is none")
            .in_file(&path_of(&args.input[0]))
            .remedy("say how large tasks are by --strip-rows"));
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
    let of_grids =
        [("--strip-rows", args.strip_rows.is_some()), ("--to-crs", args.system.is_given())];
    let of_grids = of_grids.into_iter().chain(args.method.options_of_grids());
    tin::refuse_options(&args.input[0], of_grids, &args.grid)?;
    let resources = Resources::default();
    let options = args.points.open_options(&resources)?;
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
    let plan = PlanJob { job, folder: args.folder.clone(), cut: args.cut, skipped };
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
    Ok(PlanJob { job: tin, folder, cut: args.strip_rows, skipped: Vec::new() })
}
