//! `terrane tin`: a grid becomes a mesh with a proven error bound.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic::{AtomicFile, refuse_existing};
use crate::cli::{
    Outcome, args, check, cloud, cloud_tin, many, names, parse, pipes, say, text, verify,
};
use crate::error::{Error, Result};
use crate::jobs::Cancel;
use crate::jobs::placing::Placing;
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::tin::{self, Goal, TinJob, TinReport};
use crate::jobs::verify::{VerifyJob, VerifyReport};
use crate::mesh;
use crate::raster::{self, undeclared_nodata};

/// Simplify a grid or a point cloud into a triangle mesh with a proven vertical error bound
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid file, or a synthetic terrain by name such as synth:rough,size=4097,seed=7; several files,
    /// a folder, a list or a pattern in quotes are one mosaic. Or point clouds: .las and .laz files,
    /// one or many. The last name is that of the mesh file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) goal: GoalArgs,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    pub(super) grid: args::Grid,
    #[command(flatten)]
    pub(super) points: cloud::Points,
    /// Mesh format [default: by the output's ending]
    #[arg(short, long, value_name = "NAME", help_heading = "Output")]
    pub(super) format: Option<String>,
    /// Option of the format: SOLID_BASE=HEIGHT closes an STL with walls and a flat bottom
    #[arg(long, value_name = "KEY=VAL", value_parser = parse_creation, help_heading = "Output")]
    pub(super) co: Vec<Creation>,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    pub(super) overwrite: bool,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) report: Option<PathBuf>,
    /// Check the written mesh against the grid afterwards
    #[arg(long, help_heading = "Output")]
    pub(super) verify: bool,
    #[command(flatten)]
    pub(super) print: PrintArgs,
    #[command(flatten)]
    pub(super) split: Split,
    #[command(flatten)]
    pub(super) method: Method,
    /// Keep what is done in this folder, so that the same command goes on after it was killed; it can
    /// be removed when the mesh is there
    #[arg(long, value_name = "FOLDER", help_heading = "Resources", conflicts_with_all = ["max_vertices", "max_triangles"])]
    pub(super) workdir: Option<PathBuf>,
    #[command(flatten)]
    pub(super) disk: args::Disk,
    #[command(flatten)]
    pub(super) machine: args::SpillingMachine,
    #[command(flatten)]
    pub(super) show: args::Show,
}

/// One file or many.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Split {
    /// Write a folder with a mesh for every N x N tiles and an index (GeoJSON), instead of one file
    #[arg(long = "split", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536), help_heading = "Output")]
    pub(super) tiles: Option<u32>,
}

impl Split {
    /// Fails when `output` cannot become what is asked for.
    pub(super) fn check_output(&self, output: &Path, overwrite: bool) -> Result<()> {
        match self.tiles {
            Some(_) => refuse_existing(output, overwrite),
            None => check::new_file(output, overwrite),
        }
    }
}

/// How the mesh lies in its file.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Viewers and printers (STL and GLB)")]
pub(super) struct PrintArgs {
    /// Leave longitudes and latitudes as they are [default: metres east, north and up of the middle]
    #[arg(long)]
    keep_degrees: bool,
    /// Longest side of the print, such as 100mm or 12cm; STL is in millimetres then
    #[arg(long, value_name = "LENGTH", value_parser = parse::print_length, conflicts_with_all = ["scale", "keep_degrees"])]
    size: Option<f64>,
    /// Scale of the print, such as 1:50000 or 0.001; STL is in millimetres then
    #[arg(long, value_name = "SCALE", value_parser = parse::scale, conflicts_with = "keep_degrees")]
    scale: Option<f64>,
    /// Make heights so many times higher
    #[arg(long, value_name = "FACTOR", value_parser = parse::positive)]
    exaggerate: Option<f64>,
    /// For STL: walls and a flat bottom, so far below the lowest height, such as 3mm of the print
    #[arg(long, value_name = "LENGTH", value_parser = parse::print_length)]
    base: Option<f64>,
}

impl PrintArgs {
    pub(super) fn placing(&self) -> Result<Placing> {
        let Self { keep_degrees, size, scale, exaggerate, base } = *self;
        if base.is_some() && size.is_none() && scale.is_none() {
            return Err(Error::usage("--base is a length of the print, which has no scale")
                .remedy("add --size or --scale, or give a height with --co SOLID_BASE=HEIGHT"));
        }
        Ok(Placing { keep_degrees, size, scale, exaggerate, base })
    }
}

/// How the mesh is made.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
pub(super) struct Method {
    /// Insert one global maximum at a time (the reference; slower, more vertices)
    #[arg(long)]
    pub(super) strict: bool,
    /// Keep vertices that turned out to be redundant (faster, more vertices)
    #[arg(long)]
    pub(super) no_drop: bool,
    /// Cells along the side of a tile, 16 to 8192 [default: 512]
    #[arg(long, value_name = "CELLS", value_parser = tile_cells())]
    pub(super) tile: Option<u32>,
}

impl Method {
    /// Cells along the side of a tile.
    pub(super) fn tile(&self) -> u32 {
        self.tile.unwrap_or(USUAL_TILE)
    }
}

/// Cells along the side of a tile, unless told otherwise.
const USUAL_TILE: u32 = 512;

fn tile_cells() -> clap::builder::RangedI64ValueParser<u32> {
    let (least, most) = tin::TILE_CELLS.into_inner();
    clap::value_parser!(u32).range(i64::from(least)..=i64::from(most))
}

/// What the mesh has to reach: exactly one of these.
#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct GoalArgs {
    /// Largest vertical distance of any valid sample from the mesh, in the vertical unit of the data
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    max_error: Option<f64>,
    /// The smallest error that this many vertices allow
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(3..))]
    max_vertices: Option<u64>,
    /// The smallest error that this many triangles allow
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_triangles: Option<u64>,
}

impl GoalArgs {
    /// The largest error, for those who cannot keep to a number of vertices or triangles.
    pub(super) fn max_error(&self) -> Result<f64> {
        self.max_error.ok_or_else(|| {
            Error::usage("--max-vertices and --max-triangles are for grids")
                .remedy("give a cloud --max-error")
        })
    }

    fn goal(&self) -> Result<Goal> {
        let error = self.max_error.map(Goal::MaxError);
        let vertices = self.max_vertices.map(Goal::MaxVertices);
        let triangles = self.max_triangles.map(Goal::MaxTriangles);
        let goal = error.or(vertices).or(triangles);
        goal.ok_or_else(|| Error::usage("no goal given").remedy("add --max-error"))
    }
}

/// An option of an output format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Creation {
    SolidBase(f64),
}

fn parse_creation(given: &str) -> std::result::Result<Creation, String> {
    match given.split_once('=') {
        Some((key, value)) if key.eq_ignore_ascii_case("SOLID_BASE") => {
            parse::finite(value).map(Creation::SolidBase)
        }
        _ => Err("the only option known is SOLID_BASE=HEIGHT".to_owned()),
    }
}

/// The report of both steps, as one JSON object.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    tin: &'a TinReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    verify: Option<&'a VerifyReport>,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    skipped: &'a [Skipped],
}

pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    if cloud_tin::are_clouds(&args.input, &args.many)? {
        return cloud_tin::run(args, cancel);
    }
    args.points.refuse(&args.input[0])?;
    if args.disk.no_disk_check && args.workdir.is_none() {
        return Err(Error::usage("--no-disk-check is for runs by plan")
            .remedy("leave it out, or pass --workdir"));
    }
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let grids = many::Kind::Grids(&options);
    let mut args = args.clone();
    let mut stdin = pipes::Stdin::expect(&mut args.input, pipes::Holds::Grid, &resources)?;
    if args.workdir.is_some() {
        stdin.refuse("--workdir")?;
    }
    args.input = args.many.find(&args.input, grids)?;
    let job = job(&args)?;
    stdin.gather(&mut args.input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(args.input.clone(), grids, &resources)?;
    make(&args, &TinJob { input: stdin.inputs(names), ..job }, &skipped, cancel)
}

fn make(args: &Args, job: &TinJob, skipped: &[Skipped], cancel: &Cancel) -> Result<Outcome> {
    let progress = args.show.progress();
    let made = match &args.workdir {
        None => tin::run(job, progress.as_ref(), cancel)?,
        Some(folder) => {
            tin::run_in(folder, job, skipped, args.disk.check(), progress.as_ref(), cancel)?
        }
    };
    let checked = match args.verify {
        true => Some(crate::jobs::verify::run(&proof(job, &made), progress.as_ref(), cancel)?),
        false => None,
    };
    let report = Report { tin: &made, verify: checked.as_ref(), skipped };
    if let Some(path) = &args.report {
        write_report(path, args.overwrite, &report)?;
    }
    if args.show.json {
        say::json(&report)?;
    } else if !args.show.quiet {
        say::result(&summary(&made))?;
        checked.as_ref().map_or(Ok(()), |c| say::result(&verify::summary(c)))?;
    } else {
        checked.iter().for_each(|r| verify::tell(&r.failures, &r.not_judged));
    }
    Ok(checked.as_ref().map_or(Outcome::Kept, verify::outcome))
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<TinJob> {
    args.grid.check_all(&args.input)?;
    let usual = args.split.tiles.map(|_| "PLY");
    let format = mesh::by_path(&args.output, args.format.as_deref().or(usual))?;
    let files = raster::files(&args.input)?;
    check::not_among(&files, &[&args.output])?;
    // An output that exists may be the mesh of an earlier run there.
    let goes_on = args.workdir.as_ref().is_some_and(|folder| folder.exists());
    args.split.check_output(&args.output, args.overwrite || goes_on)?;
    let results: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    check::report(args.report.as_deref(), &files, &results, args.overwrite)?;
    let solid_base = args.co.iter().map(|Creation::SolidBase(height)| *height).next_back();
    if solid_base.is_some() && format.name != "STL" {
        return Err(Error::usage(format!("{} has no option SOLID_BASE", format.name))
            .remedy("write STL, or leave --co out"));
    }
    let placing = args.print.placing()?;
    if let Some(option) = placing.given().filter(|_| args.workdir.is_some()) {
        return Err(Error::usage(format!("{option} cannot be kept in a --workdir"))
            .remedy(format!("leave one of --workdir and {option} out")));
    }
    if solid_base.is_some() && placing.base.is_some() {
        return Err(Error::usage("--base and SOLID_BASE are two bottoms of one solid")
            .remedy("leave one of them out"));
    }
    if (solid_base.is_some() || placing.base.is_some()) && args.verify {
        return Err(Error::usage("a solid has walls and a bottom, which are no terrain to verify")
            .remedy("leave out --verify, or verify the mesh without --base and --co SOLID_BASE"));
    }
    Ok(TinJob {
        input: args.input.clone().into(),
        band: args.grid.band(),
        nodata: args.grid.nodata,
        output: args.output.clone(),
        format: Some(format.name.to_owned()),
        overwrite: args.overwrite,
        split: args.split.tiles,
        solid_base,
        placing,
        goal: args.goal.goal()?,
        strict: args.method.strict,
        drop: !args.method.no_drop,
        tile: args.method.tile(),
        measure: args.show.json || args.report.is_some(),
        resources: args.machine.resources(),
    })
}

/// The job of proving what a tin job wrote.
pub(super) fn proof(job: &TinJob, made: &TinReport) -> VerifyJob {
    VerifyJob {
        mesh: job.output.clone(),
        raster: job.input.clone(),
        band: job.band,
        nodata: job.nodata,
        tolerance: Some(made.tolerance),
        resources: job.resources.clone(),
    }
}

/// Writes a report as a JSON file, whole or not at all.
pub(super) fn write_report(path: &Path, overwrite: bool, report: &impl Serialize) -> Result<()> {
    use std::io::Write;
    let mut file = AtomicFile::create(path, overwrite)?;
    file.write_all(say::pretty(report)?.as_bytes()).map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}

/// A made mesh for people.
pub(super) fn summary(r: &TinReport) -> String {
    let mut rows = vec![
        (
            "grid",
            format!(
                "{} x {}, {}",
                text::count(r.width.into()),
                text::count(r.height.into()),
                r.crs
            ),
        ),
        ("samples", samples(r)),
        (
            "vertices",
            format!("{}, {} of the valid samples", text::count(r.vertices), text::percent(r.kept)),
        ),
        ("triangles", text::count(r.triangles)),
        ("max error", errors(r)),
        ("file", format!("{}, {}", text::bytes(r.output_bytes), r.format)),
        ("time", time(r)),
    ];
    rows.extend(r.placed.as_ref().map(|placed| ("placed", text::placed(placed))));
    if let (Some(value), Some(count)) = (r.suspected_nodata, r.suspected_samples) {
        rows.push(("warning", undeclared_nodata(count, value)));
    }
    if let Some(peak) = r.peak_memory {
        let budget = text::bytes(r.memory_budget);
        rows.push(("memory", format!("{} at the peak, {budget} allowed", text::bytes(peak))));
    }
    rows.extend(r.notes.iter().map(|note| ("note", note.clone())));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn samples(r: &TinReport) -> String {
    let void = r.samples.saturating_sub(r.valid_samples);
    let mut line = text::count(r.samples);
    if void > 0 {
        line += &format!(", {} void", text::count(void));
    }
    if r.isolated_samples > 0 {
        let lone = text::count(r.isolated_samples);
        line += &format!(", {lone} valid without a valid cell beside them (no surface there)");
    }
    line
}

fn errors(r: &TinReport) -> String {
    let unit = &r.vertical_unit;
    let allowed = format!("{} {unit} allowed", text::number(r.tolerance));
    let found = r.max_error.map(|e| format!("{} {unit}, ", text::bound(e)));
    let rmse = r.rmse.map(|e| format!(", RMSE {} {unit}", text::number(e)));
    found.unwrap_or_default() + &allowed + &rmse.unwrap_or_default()
}

fn time(r: &TinReport) -> String {
    let rate = text::rate(r.samples_per_second, "samples");
    let threads =
        if r.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", r.threads) };
    let total = text::seconds(r.wall_seconds);
    format!("{total}, {rate}, {threads} (in threads: {})", stages(&r.stages))
}

/// Stages with their times.
pub(super) fn stages(stages: &[tin::StageReport]) -> String {
    let stage = |s: &tin::StageReport| format!("{} {}", s.name, text::seconds(s.thread_seconds));
    stages.iter().map(stage).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::placing::Placed;

    #[test]
    fn a_summary_tells_counts_errors_and_time() {
        let report = TinReport {
            input: "a.tif".into(),
            output: "a.ply".into(),
            format: "PLY".into(),
            width: 1201,
            height: 643,
            vertical_unit: "metre".into(),
            tolerance: 5.0,
            max_error: Some(4.998046875),
            samples: 772_243,
            valid_samples: 772_000,
            isolated_samples: 2,
            vertices: 12_345,
            kept: 0.016,
            threads: 2,
            samples_per_second: 12.3e6,
            placed: Some(Placed::default()),
            suspected_nodata: Some(-1.0),
            suspected_samples: Some(7),
            peak_memory: Some(1 << 20),
            notes: vec!["first".into(), "second".into()],
            ..TinReport::default()
        };
        let text = summary(&report);
        for part in [
            "1,201 x 643",
            "243 void",
            "12,345, 1.60 %",
            "4.99805 metre, 5 metre allowed",
            "12.3 M samples/s, 2 threads",
            "2 valid without",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        let lines: Vec<_> = text.lines().collect();
        let is_new = |i: usize| !lines[..i].contains(&lines[i]);
        assert!((0..lines.len()).all(is_new), "a line is there twice:\n{text}");
    }

    #[test]
    fn creation_options_are_known_by_name() {
        assert_eq!(parse_creation("solid_base=-12.5"), Ok(Creation::SolidBase(-12.5)));
        assert!(parse_creation("SOLID_BASE=x").is_err() && parse_creation("LEVEL=9").is_err());
    }
}
