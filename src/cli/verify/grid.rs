//! `terrane verify` on meshes of grids.

use std::path::Path;

use crate::bound::Bound;
use crate::cli::shared::{Outcome, check, many, report, text};
use crate::cli::verify::args::{Args, wrong_way_round};
use crate::cli::verify::told;
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::input::is_mesh;
use crate::jobs::sift::Sifted;
use crate::jobs::verify::{self, BandProof, OfGrid, VerifyJob, VerifyReport};
use crate::raster::{self, OpenOptions};

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    args.bands.refuse_beside(&[
        ("--bound surface", args.bound == Some(Bound::Surface)),
        ("--keep-points", args.keep_points.is_some()),
        ("--breaklines", args.breaklines.is_some()),
        ("--water", args.water.is_some()),
    ])?;
    let bands = args.bands.asked(&args.grid)?;
    let options = OpenOptions { colours: bands.is_some(), ..args.grid.open_options(&resources) };
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Grids(&options), &resources)?;
    let args = &Args { source: names, ..args.clone() };
    args.source.iter().try_for_each(|raster| check_kinds(&args.mesh, raster))?;
    args.grid.check_all(&args.source)?;
    let mut read = args.grid.read_with(raster::files(&args.source)?);
    read.extend(args.keep_points.iter().chain(&args.breaklines).chain(&args.water).cloned());
    read.push(name_of(args.mesh.clone())?);
    check::report(args.report.as_deref(), &read, &[], args.overwrite)?;
    let job = VerifyJob {
        mesh: args.mesh.clone(),
        raster: args.source.clone().into(),
        reading: args.grid.reading(args.water.as_ref()),
        tolerance: args.max_error,
        bound: args.bound,
        min_angle: args.min_angle,
        keep_points: args.keep_points.clone(),
        breaklines: args.breaklines.clone(),
        bands,
        resources,
    };
    let report = verify::run(&job, args.show.progress().as_ref(), cancel)?;
    let whole = report::WithSkipped { report: &report, skipped: &skipped };
    told::finish(args, &whole, &report.verdict, || summary(&report))
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

/// A proof for people.
pub(crate) fn summary(r: &VerifyReport) -> String {
    let mut rows: Vec<_> = r.of.bands.iter().map(|proof| ("band", band(proof))).collect();
    rows.extend(r.of.bands.is_empty().then(|| ("surface", surface(r))));
    rows.push(("samples", samples(&r.of)));
    rows.extend(r.of.keep_points.as_ref().map(|kept| ("kept", text::kept(kept, "grid"))));
    rows.extend(r.of.breaklines.as_ref().map(|lines| {
        let vertices = text::count(r.of.on_breaklines);
        ("breaklines", format!("{}, {vertices} vertices on them", text::breaklines(lines, "grid")))
    }));
    let off = told::off_vertices(r, "grid");
    told::summary(r, rows, off, "", text::rate(r.of.samples_per_second, "samples"))
}

/// The error in a band.
fn band(r: &BandProof) -> String {
    let most = r.max_error.map_or("-".to_owned(), text::bound);
    let over = text::count(r.over);
    let allowed = r
        .tolerance
        .map_or(String::new(), |e| format!(", {} allowed, {over} samples over", text::number(e)));
    let rmse = r.rmse.map_or(String::new(), |e| format!("; RMSE {}", text::number(e)));
    format!("{} (weight {}): {most} at the most{allowed}{rmse}", r.band, text::number(r.weight))
}

/// The error on the lines between samples.
fn surface(r: &VerifyReport) -> String {
    let [over, breaks] = [r.of.over_between_samples.count, r.of.breaks].map(text::count);
    let judged = match (r.of.bound, r.tolerance) {
        (Bound::Samples, _) => "; no promise of this mesh",
        (Bound::Surface, None) => "; not judged",
        (Bound::Surface, Some(_)) => "",
    };
    let most = r.of.surface_error.map_or("-".to_owned(), text::bound);
    let over = r.tolerance.map_or(String::new(), |_| format!(", {over} of them over"));
    format!("error {most} at the most, {breaks} places between samples{over}{judged}")
}

fn samples(r: &OfGrid) -> String {
    let mut line =
        format!("{} covered of {}", text::count(r.covered_samples), text::count(r.surface_samples));
    if r.isolated_samples > 0 {
        line += &format!("; {} valid ones have no surface", text::count(r.isolated_samples));
    }
    line
}
