//! `terrane verify` on meshes of grids.

use std::path::Path;

use crate::cli::shared::{Outcome, check, many, report, text};
use crate::cli::verify::args::{Args, wrong_way_round};
use crate::cli::verify::told;
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::input::is_mesh;
use crate::jobs::sift::Sifted;
use crate::jobs::verify::{self, VerifyJob, VerifyReport};
use crate::raster;

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Grids(&options), &resources)?;
    let args = &Args { source: names, ..args.clone() };
    args.source.iter().try_for_each(|raster| check_kinds(&args.mesh, raster))?;
    args.grid.check_all(&args.source)?;
    let read = [raster::files(&args.source)?, vec![name_of(args.mesh.clone())?]].concat();
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    let job = VerifyJob {
        mesh: args.mesh.clone(),
        raster: args.source.clone().into(),
        band: args.grid.band(),
        nodata: args.grid.nodata,
        tolerance: args.max_error,
        resources,
    };
    let report = verify::run(&job, args.show.progress().as_ref(), cancel)?;
    let whole = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.report {
        report::write(path, args.overwrite, &whole)?;
    }
    if !args.show.tell(&whole, || summary(&report))? {
        told::tell(&report.failures, &report.not_judged);
    }
    Ok(outcome(&report))
}

/// Fails unless there is a mesh and a grid, in this order.
fn check_kinds(mesh: &Path, raster: &str) -> Result<()> {
    let name = name_of(mesh.to_path_buf())?;
    match (is_mesh(&name)?, is_mesh(raster)?) {
        (true, false) => Ok(()),
        (false, true) => Err(wrong_way_round("grid", &name, raster)),
        (false, false) => Err(Error::bad_input("is a grid, not a mesh")
            .in_file(mesh)
            .remedy("name a mesh, such as one made by `terrane tin`")),
        (true, true) => Err(Error::bad_input("is a mesh, not a grid")
            .in_file(&path_of(raster))
            .remedy("name the grid that the mesh was made from")),
    }
}

/// Whether the mesh kept its promises.
pub(crate) fn outcome(report: &VerifyReport) -> Outcome {
    Outcome::of(report.passed, report.judged)
}

/// A proof for people: the verdict, what failed, and the figures.
pub(crate) fn summary(r: &VerifyReport) -> String {
    let verdict = told::verdict(r.passed, &r.not_judged);
    let failures: String = r.failures.iter().map(|f| format!("  - {f}\n")).collect();
    let sizes =
        format!("{} vertices, {} triangles", text::count(r.vertices), text::count(r.triangles));
    let time = format!(
        "{}, {}",
        text::seconds(r.wall_seconds),
        text::rate(r.samples_per_second, "samples")
    );
    let rows = [
        ("error", errors(r)),
        ("samples", samples(r)),
        ("mesh", sizes),
        (
            "vertices",
            told::vertices(r.off_sample_vertices.count, r.made_by_terrane, ["samples", "grid"]),
        ),
        ("edges", told::edges(r.interior_edges, r.open_edges, r.non_delaunay_edges.count)),
        ("angles", told::angles(r.smallest_angle)),
        ("time", time),
    ];
    format!("{verdict}\n{failures}{}", text::table(&rows))
}

fn errors(r: &VerifyReport) -> String {
    let most = r.max_error.map_or("-".to_owned(), text::bound);
    let allowed = match r.tolerance {
        Some(tolerance) => format!("{most} at the most, {} allowed", text::number(tolerance)),
        None => format!("{most} at the most; not judged, because no bound is known (--max-error)"),
    };
    format!("{allowed}; RMSE {}, mean {}", text::height(r.rmse), text::height(r.mean_error))
}

fn samples(r: &VerifyReport) -> String {
    let mut line =
        format!("{} covered of {}", text::count(r.covered_samples), text::count(r.surface_samples));
    if r.isolated_samples > 0 {
        line += &format!("; {} valid ones have no surface", text::count(r.isolated_samples));
    }
    line
}
