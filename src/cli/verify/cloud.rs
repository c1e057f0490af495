//! `terrane verify` on point clouds.

use crate::cli::shared::{Outcome, check, many, points, report, text};
use crate::cli::verify::args::Args;
use crate::cli::verify::told;
use crate::cloud as clouds;
use crate::error::{Error, Result};
use crate::files::name_of;
use crate::jobs::Cancel;
use crate::jobs::input::is_mesh;
use crate::jobs::sift::Sifted;
use crate::jobs::verify::{CloudVerifyJob, CloudVerifyReport, OfCloud, verify_cloud};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.points.open_options(&args.grid, &resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Clouds(&options), &resources)?;
    let args = &Args { source: names, ..args.clone() };
    let job = job(args)?;
    let job = CloudVerifyJob { options: args.many.reading(job.options.clone()), ..job };
    let report = verify_cloud(&job, args.show.progress().as_ref(), cancel)?;
    let whole = report::WithSkipped { report: &report, skipped: &skipped };
    told::finish(args, &whole, &report.verdict, || summary(&report))
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<CloudVerifyJob> {
    args.grid.refuse_cloud(&args.source[0])?;
    args.refuse_of_surfaces("this is a point cloud")?;
    if !is_mesh(&name_of(args.mesh.clone())?)? {
        return Err(Error::bad_input("is a grid, not a mesh")
            .in_file(&args.mesh)
            .remedy("name a mesh, such as one made by `terrane tin`"));
    }
    let mesh = vec![name_of(args.mesh.clone())?];
    let beside = args.keep_points.iter().chain(&args.breaklines).cloned().collect();
    let read =
        [clouds::files(&args.source)?, args.grid.clip.clone().into_iter().collect(), beside, mesh]
            .concat();
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    let resources = args.machine.resources();
    Ok(CloudVerifyJob {
        mesh: args.mesh.clone(),
        inputs: args.source.clone(),
        options: args.points.open_options(&args.grid, &resources)?,
        tolerance: args.max_error,
        keep_points: args.keep_points.clone(),
        breaklines: args.breaklines.clone(),
        resources,
    })
}

/// A proof for people.
pub(crate) fn summary(r: &CloudVerifyReport) -> String {
    let whole = if r.of.breaklines.is_some() { "cloud, or posts of breaklines" } else { "cloud" };
    let (mut rows, off) = (vec![("points", points(&r.of))], told::off_vertices(r, whole));
    rows.extend(r.of.keep_points.as_ref().map(|kept| ("kept", text::kept(kept, "cloud"))));
    rows.extend(r.of.breaklines.as_ref().map(|lines| {
        let vertices = text::count(r.of.on_breaklines);
        ("breaklines", format!("{}, {vertices} vertices on them", text::breaklines(lines, "cloud")))
    }));
    let unit = format!(" ({})", r.of.vertical_unit);
    told::summary(r, rows, off, &unit, text::rate(r.of.points_per_second, "points"))
}

fn points(r: &OfCloud) -> String {
    let [covered, judged] = [r.covered_points, r.judged_points].map(text::count);
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} above another at the same position", text::count(n)),
    };
    format!("{covered} covered of {judged}{stacked}; read: {}", points::census(&r.points))
}
