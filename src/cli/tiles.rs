//! `terrane tiles`: terrain for the globe, at every level of detail.

use std::path::{Path, PathBuf};

use crate::atomic;
use crate::cli::shared::many::Many;
use crate::cli::shared::tabled::Tabled;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, ground, lists, many, names, points, report, text};
use crate::cloud;
use crate::error::Result;
use crate::jobs::Cancel;
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::tiles::{self, Kept, TileOptions, TilesJob, TilesReport};

/// Make terrain tiles of a grid or a point cloud for viewers of the globe, at every level of detail
///
/// The folder holds quantized-mesh 1.0 tiles (EPSG:4326, TMS) of every level down to the resolution of the
/// grid, and layer.json; or 3D Tiles 1.1 of the same levels, and tileset.json. No sample is further from a tile, as a client decodes it on the bent earth, than
/// clients take its level to be off by (77 km at level 0, half as much at each further one), or than its level states
/// where the steps of its positions cannot tell samples apart; each tile
/// says how far its samples are at the most. Tiles beside each other have the same border. Voids are
/// spanned. The grid may be in any system; its samples are brought to WGS 84, and none is made up. Heights are
/// taken from the ellipsoid on, or brought there with --geoid. Of a cloud a model of the ground is made first, as
/// terrane grid --dtm makes it, and the samples are those of the model.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid file; several files, a folder, a list or a pattern in quotes are one mosaic. Or point clouds. The last
    /// name is that of the folder to make
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    wanted: Wanted,
    /// Replace a folder of tiles that exists
    #[arg(long, help_heading = "Tiles")]
    overwrite: bool,
    /// Keep what is done in this folder, so that the same command goes on after it was killed; it can
    /// be removed when the tiles are there
    #[arg(long, value_name = "FOLDER", help_heading = "Resources")]
    workdir: Option<PathBuf>,
    #[command(flatten)]
    disk: args::Disk,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    ground: ground::Ground,
    #[command(flatten)]
    points: points::Points,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// What is asked of tiles.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Wanted {
    #[command(flatten)]
    pub(super) tiles: Tabled<TileOptions>,
    /// Water of a file of features, in the system of the grid, made level: polygons are lakes, as high as their
    /// lowest bank, and those that a line of the file runs within are rivers, falling along it (drawn downstream)
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(super) water: Option<String>,
}

impl Verb for Args {
    const NAME: &'static str = "tiles";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        match self.many.are_clouds(&self.input)? {
            true => of_cloud(self, call.cancel),
            false => run(self, call.cancel),
        }
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.disk.check_workdir(args.workdir.as_deref())?;
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    atomic::refuse_stdout(&args.output)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Grids(&options), &resources)?;
    args.grid.check_all(&names)?;
    args.ground.refuse(&names[0])?;
    args.points.refuse(&names[0])?;
    let results: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    check::not_inputs(&names, &results)?;
    check::not_among(args.grid.clip.as_slice(), &results)?;
    check::not_among(args.wanted.water.as_slice(), &results)?;
    check::not_among(args.wanted.tiles.0.geoid.as_slice(), &results)?;
    let job = args.wanted.tiles.0.job(TilesJob {
        reading: args.grid.reading(args.wanted.water.as_ref()),
        overwrite: args.overwrite,
        resources,
        ..TilesJob::new(names, &args.output)
    })?;
    let progress = args.show.progress();
    let report = match &args.workdir {
        None => tiles::run(&job, progress.as_ref(), cancel)?,
        Some(folder) => {
            let disk = args.disk.check();
            tiles::run_in(folder, &job, &skipped, disk, progress.as_ref(), cancel)?
        }
    };
    tell(args, &report, &skipped)
}

/// Tiles of a model of the ground.
fn of_cloud(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.grid.refuse_cloud(&args.input[0])?;
    args.disk.check_workdir(args.workdir.as_deref())?;
    atomic::refuse_stdout(&args.output)?;
    let resources = args.machine.resources();
    let options = args.points.open_options(&args.grid, &resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Clouds(&options), &resources)?;
    let results: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    let beside = args.wanted.water.iter().chain(&args.wanted.tiles.0.geoid).cloned().collect();
    let read =
        [cloud::files(&names)?, args.grid.clip.clone().into_iter().collect(), beside].concat();
    check::not_among(&read, &results)?;
    let job = args.wanted.tiles.0.job(TilesJob {
        reading: args.grid.reading(args.wanted.water.as_ref()),
        overwrite: args.overwrite,
        resources,
        ..TilesJob::new("", &args.output)
    })?;
    let model = args.ground.model(names, args.many.reading(options));
    let (folder, disk) = (args.workdir.as_deref(), args.disk.check());
    let kept = folder.map(|folder| Kept { folder, skipped: &skipped, disk });
    let report = tiles::run_cloud(&model, &job, kept, args.show.progress().as_ref(), cancel)?;
    tell(args, &report, &skipped)
}

fn tell(args: &Args, report: &TilesReport, skipped: &[Skipped]) -> Result<Outcome> {
    let told = report::WithSkipped { report, skipped };
    args.show.tell(&told, || summary(report))?;
    Ok(Outcome::Kept)
}

pub(super) fn summary(r: &TilesReport) -> String {
    let mut rows = vec![
        ("system", r.crs.clone()),
        ("samples", text::count(r.samples)),
        ("tiles", format!("{}, {}", text::count(r.tiles), text::bytes(r.output_bytes))),
    ];
    rows.extend(report::took(&r.run, None, ""));
    rows.extend(report::notes(&r.notes));
    let heading = "level     tiles  triangles       bytes   error, m  of allowed";
    let level = |l: &tiles::LevelReport| {
        format!(
            "{:>5} {:>9} {:>10} {:>11} {:>10.3} {:>11.3}",
            l.level, l.tiles, l.triangles, l.bytes, l.error, l.tolerance
        )
    };
    let sets = r.levels.chunk_by(|a, b| a.format == b.format).map(|of_set| {
        let levels: Vec<String> = of_set.iter().map(level).collect();
        format!("{}\n{heading}\n{}", of_set[0].format, levels.join("\n"))
    });
    let sets: Vec<String> = sets.collect();
    format!("{} -> {}\n{}\n{}", r.input, r.output, text::table(&rows), sets.join("\n"))
}
