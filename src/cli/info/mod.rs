//! `terrane info`: what a file is, for every format of grids, meshes, clouds and features.

mod cloud;
mod details;
mod features;
mod grid;
mod mesh;
mod picture;
mod quality;

use std::path::Path;

use serde::Serialize;

use crate::cli::shared::many::Kind;
use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, lists, many, names, points, report, say, text};
use crate::cloud::{Filter, is_cloud};
use crate::error::{Error, ErrorKind, Result};
use crate::jobs::input::{self, Surface};
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::tin::cost;
use crate::jobs::{Cancel, Progress, Resources};
use crate::raster::Inputs;
use crate::vector;

/// Tell what grids, meshes, point clouds and files of lines are, what is odd about them, and what a TIN
/// of a grid would take
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    /// Grid, mesh, cloud and feature files, or synthetic terrains by name; a folder, a list or a pattern in
    /// quotes is one mosaic or one cloud
    #[arg(required = true, value_name = "FILE", value_parser = names::any())]
    files: Vec<String>,
    /// Take all files together for one mosaic or one cloud
    #[arg(long)]
    mosaic: bool,
    /// Read all samples: share of valid ones, lowest, highest and mean height; of a cloud all points:
    /// counts by class and return, bounds found, a histogram of heights (features are read to the end in any
    /// case, and points where some are chosen, as by --class)
    #[arg(long)]
    stats: bool,
    /// The object of TopoJSON files to tell about [default: their first]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    #[command(flatten)]
    quality: quality::Asked,
    #[command(flatten)]
    picture: picture::Asked,
    #[command(flatten)]
    pub(crate) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    cloud: points::Points,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Tells about each file; a bad one does not keep the others from being told about.
impl Verb for Args {
    const NAME: &'static str = "info";

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes()]
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let progress = args.show.progress();
    let (mut is_any_told, mut failures) = (false, Vec::new());
    let at_once = if args.mosaic { args.files.len() } else { 1 };
    args.picture.check(&args.files, at_once)?;
    for files in args.files.chunks(at_once.max(1)) {
        let described = sift(files, args).and_then(|Sifted { names, skipped }| {
            Ok((describe(&names, args, progress.as_ref(), cancel)?, skipped))
        });
        match described {
            Ok((facts, skipped)) => {
                is_any_told = true;
                match args.show.json {
                    true => {
                        say::json_line(&report::WithSkipped { report: &facts, skipped: &skipped })?
                    }
                    false => say::result(&facts.text(&told(files)))?,
                }
            }
            Err(error) => {
                cancel.check()?;
                failures.push((told(files), error));
            }
        }
    }
    let may_skip = |(_, error): &(String, Error)| error.is_about_a_file();
    if args.many.skip_bad && is_any_told && failures.iter().all(may_skip) {
        return skip(&failures, args);
    }
    let last = failures.pop();
    failures.into_iter().for_each(|(_, error)| say::error(&args.many.advise(error)));
    last.map_or(Ok(Outcome::Kept), |(_, error)| Err(error))
}

/// Tells of files by themselves that are left out.
fn skip(failures: &[(String, Error)], args: &Args) -> Result<Outcome> {
    let skipped = failures.iter().map(|(name, error)| Skipped::new(name, error));
    let skipped: Vec<Skipped> = skipped.collect();
    skipped.iter().for_each(many::tell);
    if args.show.json && !skipped.is_empty() {
        say::json_line(&serde_json::json!({ "skipped": skipped }))?;
    }
    Ok(Outcome::Kept)
}

/// The files that are taken of what is to be told about together.
fn sift(files: &[String], args: &Args) -> Result<Sifted> {
    let resources = args.machine.resources();
    if files.iter().any(|file| many::are_features(file)) {
        let options = vector::OpenOptions { layer: args.layer.clone() };
        return args.many.take(files, Kind::Features(&options), &resources);
    }
    let are_clouds = files.iter().map(|file| args.many.is_cloud(file));
    if are_clouds.collect::<Result<Vec<_>>>()?.contains(&true) {
        let options = args.cloud.open_options(&args.grid, &resources)?;
        return args.many.take(files, Kind::Clouds(&options), &resources);
    }
    args.many.take(files, Kind::Grids(&args.grid.open_options(&resources)), &resources)
}

/// What is known of a file.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Facts {
    Grid(Box<grid::Facts>),
    Mesh(Box<mesh::Facts>),
    Cloud(Box<cloud::Facts>),
    Features(Box<features::Facts>),
}

impl Args {
    /// Fails when an object was named, because these are no features.
    fn refuse_layer(&self, files: &[String]) -> Result<()> {
        let Some(_) = self.layer else { return Ok(()) };
        Err(Error::usage("--layer is for files of features, and this is none")
            .in_file(Path::new(&told(files)))
            .remedy("leave --layer out"))
    }
}

fn told(files: &[String]) -> String {
    Inputs::from(files.to_vec()).to_string()
}

fn describe(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    if files.iter().any(|file| is_cloud(file)) {
        args.quality.refuse(files, "a point cloud")?;
        args.refuse_layer(files)?;
        return describe_cloud(files, args, progress, cancel);
    }
    if files.iter().any(|file| many::are_features(file)) {
        args.quality.refuse(files, "a file of features")?;
        args.picture.refuse(files, "a file of features")?;
        return describe_features(files, args, progress, cancel);
    }
    args.refuse_layer(files)?;
    args.picture.refuse(files, "none")?;
    let as_grid = match describe_surface(files, args, progress, cancel) {
        Err(error) if error.kind() == ErrorKind::BadInput => error,
        other => return other,
    };
    // A table of positions may be features.
    match describe_features(files, args, progress, cancel) {
        Ok(Facts::Features(facts)) if facts.is_more_than_positions() => {
            let note = format!("taken for features, because as a grid: {as_grid}");
            Ok(Facts::Features(Box::new(facts.noted(note))))
        }
        _ => Err(as_grid),
    }
}

fn describe_features(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    let [file] = files else {
        return Err(
            Error::usage("features are told about file by file").remedy("leave --mosaic out")
        );
    };
    args.grid.refuse(file, "a file of features")?;
    args.cloud.refuse(file)?;
    let facts = features::describe(file, args.layer.as_ref(), (progress, cancel))?;
    Ok(Facts::Features(Box::new(facts)))
}

fn describe_surface(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    files.iter().try_for_each(|file| args.cloud.refuse(file))?;
    args.quality.check(&args.grid, files)?;
    if !args.quality.quality {
        files.iter().try_for_each(|file| args.machine.check(file))?;
    }
    if args.stats {
        files.iter().try_for_each(|file| args::only_grids("--stats", file))?;
    }
    let file = &told(files);
    let resources: Resources = args.machine.resources();
    match input::open(files, &args.grid.clipped(&resources)?)? {
        Surface::Grid(grid) => {
            args.quality.refuse(files, "a grid")?;
            let measure = || input::grid_stats(grid.as_ref(), &resources, progress, cancel);
            let stats = args.stats.then(measure).transpose()?;
            let plan = cost(grid.as_ref(), &resources);
            Ok(Facts::Grid(Box::new(grid::Facts::new(file, grid.info(), stats, plan))))
        }
        Surface::Mesh(mesh) => {
            let bounds = input::mesh_bounds(mesh.as_ref(), progress, cancel)?;
            let mesh = (file.as_str(), mesh.as_ref(), bounds);
            let quality = args.quality.measure(mesh, &args.grid, &resources, (progress, cancel))?;
            Ok(Facts::Mesh(Box::new(mesh::Facts::new(mesh, quality))))
        }
    }
}

fn describe_cloud(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    files.iter().try_for_each(|file| args.grid.refuse_cloud(file))?;
    let (resources, told) = (args.machine.resources(), told(files));
    let at = (files, told.as_str());
    let options = args.many.reading(args.cloud.open_options(&args.grid, &resources)?);
    // What is said of the points that were chosen only their counts tell.
    let asked = (args.stats || options.filter != Filter::default(), &args.picture);
    let facts = cloud::describe(at, options, asked, &resources, (progress, cancel))?;
    Ok(Facts::Cloud(Box::new(facts)))
}

impl Facts {
    fn text(&self, file: &str) -> String {
        let rows = match self {
            Facts::Grid(grid) => grid.rows(),
            Facts::Mesh(mesh) => mesh.rows(),
            Facts::Cloud(cloud) => cloud.rows(),
            Facts::Features(features) => features.rows(),
        };
        format!("{file}\n{}", text::table(&rows))
    }
}
