//! `terrane verify` on point clouds.

use crate::cli::shared::{Outcome, check, many, points, report, text};
use crate::cli::verify::args::Args;
use crate::cli::verify::told;
use crate::cloud as clouds;
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::input::is_mesh;
use crate::jobs::sift::Sifted;
use crate::jobs::verify::{CloudVerifyJob, CloudVerifyReport, verify_cloud};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.points.open_options(&resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Clouds(&options), &resources)?;
    let args = &Args { source: names, ..args.clone() };
    let job = job(args)?;
    let report = verify_cloud(&job, args.show.progress().as_ref(), cancel)?;
    let whole = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.report {
        report::write(path, args.overwrite, &whole)?;
    }
    if !args.show.tell(&whole, || summary(&report))? {
        told::tell(&report.failures, &report.not_judged);
    }
    Ok(outcome(&report))
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<CloudVerifyJob> {
    if let Some(option) = args.grid.given() {
        return Err(Error::usage(format!("{option} is for grids, and this is a point cloud"))
            .in_file(&path_of(&args.source[0]))
            .remedy(format!("leave {option} out")));
    }
    if !is_mesh(&name_of(args.mesh.clone())?)? {
        return Err(Error::bad_input("is a grid, not a mesh")
            .in_file(&args.mesh)
            .remedy("name a mesh, such as one made by `terrane tin`"));
    }
    let mesh = vec![name_of(args.mesh.clone())?];
    let read = [clouds::files(&args.source)?, args.points.files()?, mesh].concat();
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    let resources = args.machine.resources();
    Ok(CloudVerifyJob {
        mesh: args.mesh.clone(),
        inputs: args.source.clone(),
        options: args.points.open_options(&resources)?,
        tolerance: args.max_error,
        resources,
    })
}

/// Whether the mesh kept its promises.
pub(crate) fn outcome(report: &CloudVerifyReport) -> Outcome {
    Outcome::of(report.passed, report.judged)
}

/// A proof for people: the verdict, what failed, and the figures.
pub(crate) fn summary(r: &CloudVerifyReport) -> String {
    let verdict = told::verdict(r.passed, &r.not_judged);
    let failures: String = r.failures.iter().map(|f| format!("  - {f}\n")).collect();
    let sizes =
        format!("{} vertices, {} triangles", text::count(r.vertices), text::count(r.triangles));
    let rate = text::rate(r.points_per_second, "points");
    let rows = [
        ("error", errors(r)),
        ("points", points(r)),
        ("mesh", sizes),
        (
            "vertices",
            told::vertices(r.off_point_vertices.count, r.made_by_terrane, ["points", "cloud"]),
        ),
        ("edges", told::edges(r.interior_edges, r.open_edges, r.non_delaunay_edges.count)),
        ("angles", told::angles(r.smallest_angle)),
        ("time", format!("{}, {rate}", text::seconds(r.wall_seconds))),
    ];
    format!("{verdict}\n{failures}{}", text::table(&rows))
}

fn errors(r: &CloudVerifyReport) -> String {
    let (most, unit) = (r.max_error.map_or("-".to_owned(), text::bound), &r.vertical_unit);
    let allowed = match r.tolerance {
        Some(tolerance) => format!("{most} at the most, {} allowed", text::number(tolerance)),
        None => format!("{most} at the most; not judged, because no bound is known (--max-error)"),
    };
    let [rmse, mean] = [r.rmse, r.mean_error].map(text::height);
    format!("{allowed}; RMSE {rmse}, mean {mean} ({unit})")
}

fn points(r: &CloudVerifyReport) -> String {
    let [covered, judged] = [r.covered_points, r.judged_points].map(text::count);
    let stacked = match r.stacked_points {
        0 => String::new(),
        n => format!("; {} above another at the same position", text::count(n)),
    };
    format!("{covered} covered of {judged}{stacked}; read: {}", points::census(&r.points))
}
