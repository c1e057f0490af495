//! `terrane tin` on point clouds.

use serde::Serialize;

use crate::cli::shared::many::Kind;
use crate::cli::shared::{Outcome, check, points, report, say, text};
use crate::cli::tin::args::Args;
use crate::cli::verify;
use crate::cloud as clouds;
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::Cancel;
use crate::jobs::cloud_tin::{self, CloudTinJob, CloudTinReport};
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::verify::{CloudVerifyJob, CloudVerifyReport, verify_cloud};
use crate::mesh;

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    refuse_grid_options(args)?;
    let resources = args.machine.resources();
    let options = args.points.open_options(&resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, Kind::Clouds(&options), &resources)?;
    let args = &Args { input: names, ..args.clone() };
    let job = job(args)?;
    let progress = args.show.progress();
    let made = cloud_tin::run(&job, progress.as_ref(), cancel)?;
    let checked = match args.verify {
        true => Some(verify_cloud(&proof(&job), progress.as_ref(), cancel)?),
        false => None,
    };
    let report = Report { tin: &made, verify: checked.as_ref(), skipped: &skipped };
    if let Some(path) = &args.report {
        report::write(path, args.overwrite, &report)?;
    }
    if args.show.json {
        say::json(&report)?;
    } else if !args.show.quiet {
        say::result(&summary(&made))?;
        checked.as_ref().map_or(Ok(()), |c| say::result(&verify::cloud::summary(c)))?;
    } else {
        checked.iter().for_each(|r| verify::tell(&r.failures, &r.not_judged));
    }
    Ok(checked.as_ref().map_or(Outcome::Kept, verify::cloud::outcome))
}

/// The report of both steps, as one JSON object.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    tin: &'a CloudTinReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    verify: Option<&'a CloudVerifyReport>,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    skipped: &'a [Skipped],
}

/// The job of proving what a job wrote.
fn proof(job: &CloudTinJob) -> CloudVerifyJob {
    CloudVerifyJob {
        mesh: job.output.clone(),
        inputs: job.inputs.clone(),
        options: job.options.clone(),
        tolerance: Some(job.tolerance),
        resources: job.resources.clone(),
    }
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<CloudTinJob> {
    let files = clouds::files(&args.input)?;
    let format = mesh::by_path(&args.output, args.format.as_deref())?;
    check::not_among(&files, &[&args.output])?;
    check::new_file(&args.output, args.overwrite)?;
    let read = [files, args.points.files()?].concat();
    check::report(args.report.as_deref(), &read, &[&args.output], args.overwrite)?;
    let resources = args.machine.resources();
    Ok(CloudTinJob {
        inputs: args.input.clone(),
        options: args.points.open_options(&resources)?,
        output: args.output.clone(),
        format: Some(format.name.to_owned()),
        overwrite: args.overwrite,
        placing: args.print.placing()?,
        tolerance: args.goal.max_error()?,
        measure: args.show.json || args.report.is_some(),
        resources,
    })
}

/// Fails when an option was given that is about grids.
fn refuse_grid_options(args: &Args) -> Result<()> {
    let options = [
        ("--split", args.split.tiles.is_some()),
        ("--workdir", args.workdir.is_some()),
        ("--no-disk-check", args.disk.no_disk_check),
        ("--strict", args.method.strict),
        ("--no-drop", args.method.no_drop),
        ("--tile", args.method.tile.is_some()),
        ("--co", !args.co.is_empty()),
        ("--base", args.print.placing()?.base.is_some()),
    ];
    let given = options.into_iter().find(|(_, given)| *given).map(|(option, _)| option);
    let Some(option) = given.or(args.grid.given()) else { return Ok(()) };
    Err(Error::usage(format!("{option} is for grids, and this is a point cloud"))
        .in_file(&path_of(&args.input[0]))
        .remedy(format!("leave {option} out")))
}

/// A made mesh for people.
fn summary(r: &CloudTinReport) -> String {
    let share = format!("{}, {} of the points", text::count(r.vertices), text::percent(r.kept));
    let mut rows = vec![
        ("points", points(r)),
        ("vertices", share),
        ("triangles", text::count(r.triangles)),
        ("max error", errors(r)),
        ("file", format!("{}, {}", text::bytes(r.output_bytes), r.format)),
        ("time", time(r)),
    ];
    if let Some(peak) = r.peak_memory {
        let budget = text::bytes(r.memory_budget);
        rows.push(("memory", format!("{} at the peak, {budget} allowed", text::bytes(peak))));
    }
    rows.extend(r.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
    rows.extend(r.notes.iter().map(|note| ("note", note.clone())));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn points(r: &CloudTinReport) -> String {
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} above another at the same position", text::count(n)),
    };
    format!("{}, {}{stacked}", points::census(&r.points), r.crs)
}

fn errors(r: &CloudTinReport) -> String {
    let unit = &r.vertical_unit;
    let found = r.max_error.map(|e| format!("{} {unit}, ", text::bound(e)));
    let rmse = r.rmse.map(|e| format!(", RMSE {} {unit}", text::number(e)));
    let allowed = format!("{} {unit} allowed", text::number(r.tolerance));
    found.unwrap_or_default() + &allowed + &rmse.unwrap_or_default()
}

fn time(r: &CloudTinReport) -> String {
    let stage = |s: &crate::jobs::tin::StageReport| {
        format!("{} {}", s.name, text::seconds(s.thread_seconds))
    };
    let stages: Vec<String> = r.stages.iter().map(stage).collect();
    let threads =
        if r.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", r.threads) };
    let rate = text::rate(r.points_per_second, "points");
    format!("{}, {rate}, {threads} ({})", text::seconds(r.wall_seconds), stages.join(", "))
}
