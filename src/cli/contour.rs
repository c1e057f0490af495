//! `terrane contour`: contour lines of a grid.

use std::path::PathBuf;

use clap::builder::{RangedI64ValueParser, TypedValueParser};

use crate::cli::shared::many::Many;
use crate::cli::shared::system::{self, System};
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, pipes, report, text};
use crate::error::{Error, Result};
use crate::jobs::Cancel;
use crate::jobs::contour::{self, ContourJob, ContourReport, Heights, TILE_CELLS, USUAL_TILE};
use crate::jobs::line::Length;
use crate::jobs::sift::Sifted;
use crate::raster;

/// Make contour lines of a grid
///
/// The surface is linear along the lines between neighbouring samples; higher ground is on the right of
/// each line. Lines end at voids and at the border, do not branch, and do not touch each other. With
/// --tolerance they are simplified, and neither cross nor touch afterwards. The file is the same for
/// any number of threads and any memory.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "contour")]
pub(super) struct Args {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic. The last name is that of the file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    input: Vec<String>,
    #[arg(skip)]
    output: PathBuf,
    /// File to write, where it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FILE", help_heading = "Output")]
    named: Option<PathBuf>,
    #[command(flatten)]
    levels: Where,
    /// Height from which the multiples are counted [default: 0]
    #[arg(long, visible_alias = "offset", value_name = "HEIGHT", allow_hyphen_values = true,
          value_parser = parse::finite, conflicts_with = "levels", help_heading = "Levels")]
    base: Option<f64>,
    /// Mark lines at every N-th level from the base in a property "index" (true or false)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..),
          conflicts_with = "levels", help_heading = "Levels")]
    index: Option<u32>,
    #[command(flatten)]
    simple: Simple,
    #[command(flatten)]
    out: Output,
    #[command(flatten)]
    system: System,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Where lines are drawn.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Levels")]
#[group(required = true, multiple = false)]
struct Where {
    /// Lines at all multiples of this height, in the vertical unit of the data
    #[arg(short, long, value_name = "HEIGHT", value_parser = parse::positive)]
    interval: Option<f64>,
    /// Lines at these heights, such as 10,50,100, instead
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, value_delimiter = ',',
          value_parser = parse::finite)]
    levels: Vec<f64>,
}

/// Fewer vertices.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Simplification")]
struct Simple {
    /// Leave out vertices that are at most so far from the line, in units of x and y or with a unit:
    /// 100m, 2km, 50ft (of longitudes and latitudes on the ellipsoid); lines still neither cross nor
    /// touch
    #[arg(long, visible_alias = "simplify", value_name = "LENGTH", allow_hyphen_values = true,
          value_parser = parse::length)]
    tolerance: Option<Length>,
    /// Cells along the side of a tile, 16 to 8192; where tiles meet, lines keep a vertex that they
    /// may have lost
    #[arg(long, value_name = "CELLS", default_value_t = USUAL_TILE, value_parser = tile_cells())]
    tile: u32,
}

/// What is written.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Output")]
struct Output {
    /// Format to write [default: by the output's ending]
    #[arg(short, long, value_name = "NAME")]
    format: Option<String>,
    /// Name of the property that holds the height of a line
    #[arg(short, long, value_name = "NAME", default_value = "elev",
          value_parser = clap::builder::NonEmptyStringValueParser::new())]
    attribute: String,
    /// Give each vertex the height of its line
    #[arg(long = "3d")]
    with_z: bool,
    /// Write the report to a file as JSON, too
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    overwrite: bool,
}

fn tile_cells() -> impl TypedValueParser<Value = u32> {
    let (least, most) = TILE_CELLS.into_inner();
    RangedI64ValueParser::<u32>::new().range(i64::from(least)..=i64::from(most))
}

impl Verb for Args {
    const NAME: &'static str = "contour";
    const USAGE: Option<&'static str> =
        Some("[OPTIONS] <--interval <HEIGHT>|--levels <LIST>> <INPUT>... <OUTPUT>");

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::features_written(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        let Self { input, output, named, .. } = self;
        let Some(named) = named.take() else { return Some((input, output)) };
        *output = named;
        None
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let mut args = args.clone();
    let mut stdin = pipes::Stdin::expect(&mut args.input, pipes::Holds::Grid, &resources)?;
    let stdout = pipes::Stdout::take(&mut args.output, args.out.format.as_deref(), &resources)?;
    let grids = many::Kind::Grids(&options);
    args.input = args.many.find(&args.input, grids)?;
    let job = job(&args)?;
    stdin.gather(&mut args.input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(args.input, grids, &resources)?;
    let job = ContourJob { input: stdin.inputs(names), ..job };
    let report = contour::run(&job, args.show.progress().as_ref(), cancel)?;
    stdout.as_ref().map_or(Ok(()), pipes::Stdout::pour)?;
    let told = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.out.report {
        report::write(path, args.out.overwrite, &told)?;
    }
    args.show.beside(stdout.is_some()).tell(&told, || summary(&report))?;
    Ok(Outcome::Kept)
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<ContourJob> {
    args.grid.check_all(&args.input)?;
    let Output { format, attribute, with_z, report, overwrite } = args.out.clone();
    let mut files = args.grid.read_with(raster::files(&args.input)?);
    files.extend(args.system.files()?);
    check::not_among(&files, &[&args.output])?;
    check::new_file(&args.output, overwrite)?;
    check::report(report.as_deref(), &files, &[&args.output], overwrite)?;
    let job = ContourJob {
        reading: args.grid.reading(None),
        format,
        overwrite,
        tolerance: args.simple.tolerance,
        attribute,
        with_z,
        index: args.index,
        tile: args.simple.tile,
        transform: args.system.transform()?,
        resources: args.machine.resources(),
        ..ContourJob::new(args.input.clone(), &args.output, heights(args)?)
    };
    job.check()?;
    Ok(job)
}

fn heights(args: &Args) -> Result<Heights> {
    match (args.levels.interval, &args.levels.levels) {
        (Some(interval), _) => Ok(Heights::Every { interval, base: args.base.unwrap_or(0.0) }),
        (None, levels) if !levels.is_empty() => Ok(Heights::List(levels.clone())),
        _ => Err(Error::usage("no levels given").remedy("add --interval or --levels")),
    }
}

fn summary(r: &ContourReport) -> String {
    let heights = match (r.lowest, r.highest) {
        (Some(low), Some(high)) => {
            let [low, high] = [low, high].map(text::number);
            format!("{} from {low} to {high}", text::count(r.levels))
        }
        _ => "none: no height is crossed".to_owned(),
    };
    let lines = format!("{}, {} of them rings", text::count(r.lines), text::count(r.rings));
    let mut rows = vec![
        ("grid", format!("{} x {} samples", r.width, r.height)),
        ("crs", r.crs.clone()),
        ("levels", heights),
        ("lines", lines),
        ("vertices", vertices(r)),
        ("output", format!("{}, {}", r.format, text::bytes(r.output_bytes))),
    ];
    if r.left_out > 0 {
        let count = text::count(r.left_out);
        rows.push(("left out", format!("{count} around samples exactly on a level and no area")));
    }
    rows.extend(system::rows(r.transformed.as_ref()));
    rows.extend(report::took(&r.run, Some(text::rate(r.samples_per_second, "samples")), ""));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn vertices(r: &ContourReport) -> String {
    let written = text::count(r.vertices);
    match r.tolerance {
        Some(tolerance) => {
            let unit = if tolerance.metres { " m" } else { "" };
            let (before, within) =
                (text::count(r.original_vertices), text::number(tolerance.value));
            format!("{written} of {before}, within {within}{unit}")
        }
        None => written,
    }
}
