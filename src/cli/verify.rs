//! `terrane verify`: a written mesh is proved against its grid or cloud.

use std::path::{Path, PathBuf};

use crate::cli::{
    Outcome, args, check, cloud, cloud_tin, cloud_verify, line, line_verify, many, names, parse,
    say, text, tin,
};
use crate::cloud::is_cloud;
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::sift::Sifted;
use crate::jobs::surface::is_mesh;
use crate::jobs::verify::{self, VerifyJob, VerifyReport};
use crate::raster;

/// Prove a mesh against its grid or point cloud, or simplified lines against their original: error
/// bound, coverage, topology; of lines also features, properties, heights and points. Exits with 1
/// when a promise is broken, and with 3 when none is known to be, but one could not be judged (such
/// as the error of a mesh that states no bound). Vertices that are no samples of the grid, or points of the cloud, are a
/// failure of meshes written by terrane only: the bound of other meshes may hold all the same
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Mesh file, or simplified lines
    pub(super) mesh: PathBuf,
    /// Grid file it was made from, or a synthetic terrain by name; several files, a folder, a list or
    /// a pattern in quotes are one mosaic. Or point clouds, with the options of points that it was
    /// made with. Or the file that lines were made from
    #[arg(required = true, value_name = "ORIGINAL", value_parser = names::any())]
    pub(super) source: Vec<String>,
    /// Largest vertical distance allowed [default: the one the mesh file states]
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    pub(super) max_error: Option<f64>,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    pub(super) grid: args::Grid,
    #[command(flatten)]
    pub(super) points: cloud::Points,
    #[command(flatten)]
    pub(super) lines: line::Promises,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(super) report: Option<PathBuf>,
    /// Replace a report that exists
    #[arg(long)]
    pub(super) overwrite: bool,
    #[command(flatten)]
    pub(super) machine: args::SpillingMachine,
    #[command(flatten)]
    pub(super) show: args::Show,
}

pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let mesh = name_of(args.mesh.clone())?;
    check::input(&mesh)?;
    if !is_mesh(&mesh).unwrap_or(false) && line_verify::are_lines(&args.mesh) {
        return line_verify::run(args, cancel);
    }
    if let Some(option) = args.lines.given() {
        return Err(Error::usage(format!("{option} is for simplified lines"))
            .in_file(&args.mesh)
            .remedy(format!("leave {option} out")));
    }
    if is_cloud(&mesh) {
        return Err(wrong_way_round("cloud", &mesh, &args.source[0]));
    }
    if cloud_tin::are_clouds(&args.source, &args.many)? {
        return cloud_verify::run(args, cancel);
    }
    args.points.refuse(&args.source[0])?;
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.source, many::Kind::Grids(&options), &resources)?;
    let args = &Args { source: names, ..args.clone() };
    args.source.iter().try_for_each(|raster| check_kinds(&args.mesh, raster))?;
    args.grid.check_all(&args.source)?;
    let read = [raster::files(&args.source)?, vec![mesh]].concat();
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
    let told = many::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.report {
        tin::write_report(path, args.overwrite, &told)?;
    }
    if !args.show.tell(&told, || summary(&report))? {
        tell(&report.failures, &report.not_judged);
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

fn wrong_way_round(what: &str, first: &str, second: &str) -> Error {
    Error::usage(format!("mesh and {what} are the wrong way round"))
        .remedy(format!("write `terrane verify {second} {first}`"))
}

/// Names the broken promises on stderr, and those not judged, for those who asked for no result.
pub(super) fn tell(failures: &[String], not_judged: &[String]) {
    failures.iter().for_each(|failure| say::failure(failure));
    not_judged.iter().for_each(|what| say::not_judged(what));
}

/// Whether the mesh kept its promises.
pub(super) fn outcome(report: &VerifyReport) -> Outcome {
    Outcome::of(report.passed, report.judged)
}

/// A proof for people: the verdict, what failed, and the figures.
pub(super) fn summary(r: &VerifyReport) -> String {
    let verdict = verdict(r.passed, &r.not_judged);
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
        ("vertices", vertices(r.off_sample_vertices.count, r.made_by_terrane, ["samples", "grid"])),
        ("edges", edges(r.interior_edges, r.open_edges, r.non_delaunay_edges.count)),
        ("angles", angles(r.smallest_angle)),
        ("time", time),
    ];
    format!("{verdict}\n{failures}{}", text::table(&rows))
}

/// What came of a proof.
pub(super) fn verdict(passed: bool, not_judged: &[String]) -> String {
    match (passed, not_judged) {
        (true, []) => "verified: every promise is kept".to_owned(),
        (true, not) => format!("nothing wrong is found, but not judged: {}", not.join("; ")),
        (false, _) => "NOT verified".to_owned(),
    }
}

/// The smallest angle of a mesh.
pub(super) fn angles(smallest: Option<f64>) -> String {
    smallest.map_or("none".to_owned(), |a| format!("{} degrees at the least", text::number(a)))
}

/// A height, or a dash where none was measured.
pub(super) fn height(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), text::number)
}

fn errors(r: &VerifyReport) -> String {
    let most = r.max_error.map_or("-".to_owned(), text::bound);
    let allowed = match r.tolerance {
        Some(tolerance) => format!("{most} at the most, {} allowed", text::number(tolerance)),
        None => format!("{most} at the most; not judged, because no bound is known (--max-error)"),
    };
    format!("{allowed}; RMSE {}, mean {}", height(r.rmse), height(r.mean_error))
}

fn samples(r: &VerifyReport) -> String {
    let mut line =
        format!("{} covered of {}", text::count(r.covered_samples), text::count(r.surface_samples));
    if r.isolated_samples > 0 {
        line += &format!("; {} valid ones have no surface", text::count(r.isolated_samples));
    }
    line
}

/// What is told of vertices that are not `source`: a failure only where terrane made them.
pub(super) fn vertices(off: u64, made_by_terrane: bool, [source, of]: [&str; 2]) -> String {
    match (text::count(off), made_by_terrane) {
        _ if off == 0 => format!("all are {source} of the {of}"),
        (off, true) => format!("{off} off the {source}"),
        (off, false) => {
            format!("{off} off the {source}; no failure, because terrane did not write this mesh")
        }
    }
}

/// What is told of edges.
pub(super) fn edges(inner: u64, open: u64, non_delaunay: u64) -> String {
    let [inner, outer, delaunay] = [inner, open, non_delaunay].map(text::count);
    format!("{inner} inside, {delaunay} of them not Delaunay; {outer} on the outline")
}
