//! `terrane tin` on point clouds.

use std::path::{Path, PathBuf};

use crate::cli::shared::args::Grid;
use crate::cli::shared::many::Kind;
use crate::cli::shared::{Outcome, check, points, report, text};
use crate::cli::tin::args::Args;
use crate::cli::tin::told::{Told, errors, stages};
use crate::cli::verify;
use crate::cloud as clouds;
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::Cancel;
use crate::jobs::cloud_tin::{self, CloudTinJob, CloudTinReport, plan};
use crate::jobs::sift::Sifted;
use crate::jobs::verify::{CloudVerifyJob, verify_cloud};
use crate::mesh;

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    refuse_grid_options(args)?;
    args.disk.check_workdir(args.workdir.as_deref())?;
    let resources = args.machine.resources();
    let options = args.points.open_options(&args.grid, &resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, Kind::Clouds(&options), &resources)?;
    let args = &Args { input: names, ..args.clone() };
    let job = job(args)?;
    let job = CloudTinJob { options: args.many.reading(job.options.clone()), ..job };
    let progress = args.show.progress();
    let made = match &args.workdir {
        None => cloud_tin::run(&job, progress.as_ref(), cancel)?,
        Some(folder) => {
            plan::run_in(folder, &job, &skipped, args.disk.check(), progress.as_ref(), cancel)?
        }
    };
    let checked = match args.verify {
        true => Some(verify_cloud(&proof(&job), progress.as_ref(), cancel)?),
        false => None,
    };
    let told =
        Told { made: &made, checked: checked.as_ref(), skipped: &skipped, unmet: made.unmet() };
    told.tell(args, || summary(&made), verify::cloud::summary)
}

/// The job of proving what a job wrote.
fn proof(job: &CloudTinJob) -> CloudVerifyJob {
    CloudVerifyJob {
        mesh: job.output.clone(),
        inputs: job.inputs.clone(),
        options: job.options.clone(),
        tolerance: Some(job.tolerance),
        keep_points: job.keep_points.clone(),
        breaklines: job.breaklines.clone(),
        resources: job.resources.clone(),
    }
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<CloudTinJob> {
    let files = clouds::files(&args.input)?;
    let format = mesh::by_path(&args.output, args.format.as_deref())?;
    let beside: Vec<String> = args.method.files().collect();
    let read = [files, args.grid.clip.clone().into_iter().collect(), beside].concat();
    check::not_among(&read, &[&args.output])?;
    // An output that exists may be the mesh of an earlier run there.
    let goes_on = args.workdir.as_ref().is_some_and(|folder| folder.exists());
    check::new_file(&args.output, args.overwrite || goes_on)?;
    let results: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    check::report(args.report.as_deref(), &read, &results, args.overwrite)?;
    let placing = args.print.placing()?;
    if let Some(option) = placing.given().filter(|_| args.workdir.is_some()) {
        return Err(Error::usage(format!("{option} cannot be kept in a --workdir"))
            .remedy(format!("leave one of --workdir and {option} out")));
    }
    let resources = args.machine.resources();
    Ok(CloudTinJob {
        inputs: args.input.clone(),
        options: args.points.open_options(&args.grid, &resources)?,
        output: args.output.clone(),
        format: Some(format.name.to_owned()),
        overwrite: args.overwrite,
        placing,
        tolerance: args.goal.max_error()?,
        keep_points: args.method.keep_points.clone(),
        breaklines: args.method.breaklines.clone(),
        measure: args.show.json || args.report.is_some(),
        resources,
    })
}

/// Fails when an option was given that is about grids.
fn refuse_grid_options(args: &Args) -> Result<()> {
    let others = [
        ("--split", args.split.tiles.is_some()),
        ("--method", args.textbook.method.is_some()),
        ("--bands", args.bands.is_given()),
        ("--co", !args.co.is_empty()),
        ("--to-crs", args.system.is_given()),
        ("--base", args.print.placing()?.base.is_some()),
    ];
    refuse_options(&args.input[0], args.method.options_of_grids().chain(others), &args.grid)
}

/// Fails when one of these options was given, or one of those about grids, because `input` is a cloud.
pub(crate) fn refuse_options(
    input: &str,
    mut options: impl Iterator<Item = (&'static str, bool)>,
    grid: &Grid,
) -> Result<()> {
    let given = options.find(|(_, given)| *given).map(|(option, _)| option);
    let Some(option) = given.or(grid.given_of_grids()) else { return Ok(()) };
    Err(Error::usage(format!("{option} is for grids, and this is a point cloud"))
        .in_file(&path_of(input))
        .remedy(format!("leave {option} out")))
}

/// A made mesh for people.
pub(crate) fn summary(r: &CloudTinReport) -> String {
    let share = format!("{}, {} of the points", text::count(r.vertices), text::percent(r.kept));
    let mut rows = vec![
        ("points", points(r)),
        ("vertices", share),
        ("triangles", text::count(r.triangles)),
        ("max error", errors(r.max_error, r.tolerance, r.rmse, &r.vertical_unit)),
        ("file", format!("{}, {}", text::bytes(r.output_bytes), r.format)),
    ];
    rows.extend(r.keep_points.as_ref().map(|kept| ("kept", text::kept(kept, "cloud"))));
    let lines = r.breaklines.as_ref();
    rows.extend(lines.map(|lines| ("breaklines", text::breaklines(lines, "cloud"))));
    rows.extend(r.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
    let rate = text::rate(r.points_per_second, "points");
    rows.extend(report::took(&r.run, Some(rate), &stages(&r.stages)));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn points(r: &CloudTinReport) -> String {
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} above another at the same position", text::count(n)),
    };
    format!("{}, {}{stacked}", points::census(&r.points), r.crs)
}
