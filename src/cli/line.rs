//! `terrane line`: lines and rings made simpler.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::atomic;
use crate::cli::shared::many::Many;
use crate::cli::shared::system::{self, System};
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, pipes, report, text};
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::jobs::Cancel;
use crate::jobs::line::{
    self, Goal, HierarchyReport, Length, LineJob, LineReport, Measure, Topology,
};
use crate::jobs::sift::Sifted;
use crate::line::topology::{Collapse, Strategy};
use crate::line::{METHODS, Method};
use crate::vector;

/// Make lines simpler: no vertex left out is farther than a tolerance from the segment in its place
///
/// Features keep their properties, ids, heights and measures. With --topology shared borders stay
/// shared, nothing crosses that did not, and no ring turns over or changes sides.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "line")]
pub(super) struct Args {
    /// Files of features: GeoJSON, Shapefile, FlatGeobuf, WKT, CSV, GPX, TopoJSON. The last
    /// name is that of the file to write; with several inputs, a folder or a pattern it is that of a
    /// folder, in which each keeps its name
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    /// Format of stdin, for an input called -: GeoJSON, GeoJSONSeq, WKT or CSV [default: by its first
    /// bytes]
    #[arg(long, value_name = "NAME")]
    input_format: Option<String>,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    goal: GoalArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    neighbours: Neighbours,
    #[command(flatten)]
    out: Output,
    #[command(flatten)]
    system: System,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// How much is left out: one of these.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "How much")]
#[group(id = "goal", required = true, multiple = false)]
struct GoalArgs {
    /// Largest distance of a vertex from the segment in its place, in units of the data, or with a
    /// unit: 100m, 2km, 50ft (of longitudes and latitudes on the ellipsoid)
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    tolerance: Option<Length>,
    /// For methods that go by area: smallest effective area, in squared units of the data
    #[arg(long, value_name = "A", value_parser = parse_area)]
    area: Option<f64>,
    /// Keep this share of the vertices, from 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    keep_ratio: Option<f64>,
    /// Keep so many vertices at most
    #[arg(long, value_name = "N")]
    keep_count: Option<u64>,
    /// Write files of so many bytes at most, such as 5M
    #[arg(long, value_name = "SIZE", value_parser = parse::size)]
    target_size: Option<u64>,
}

/// Which vertices are kept.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
struct MethodArgs {
    /// How vertices are chosen: cone, rdp, imai-iri, visvalingam, weighted-visvalingam [default: cone; rdp with --hierarchy]
    #[arg(long, value_name = "NAME", value_parser = parse_method)]
    method: Option<&'static Method>,
    /// File of all splits of rdp, with the distance at which each is made: made where it is not there, and
    /// asked instead of the method where it is, for any tolerance, share, number or size
    #[arg(long, value_name = "FILE", conflicts_with = "topology")]
    hierarchy: Option<PathBuf>,
    /// What a distance is: in x and y, or in x, y and z
    #[arg(long, value_name = "NAME", value_enum, default_value_t = MetricName::Plane)]
    metric: MetricName,
    /// What becomes of rings of which less than a triangle would be left
    #[arg(long, value_name = "HOW", value_enum, default_value_t = CollapseName::Minimal)]
    collapse: CollapseName,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MetricName {
    Plane,
    #[value(name = "3d")]
    Space,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CollapseName {
    /// The smallest ring that keeps to the tolerance
    Minimal,
    /// They go
    Drop,
    /// All of their vertices stay
    Keep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StrategyName {
    /// Simplify, then put vertices back where lines cross
    Retroactive,
    /// Test each segment before it is accepted
    Proactive,
}

/// What lies beside a line.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Neighbours")]
struct Neighbours {
    /// Keep shared borders shared, and let nothing cross, turn over or change sides that did not
    #[arg(long)]
    topology: bool,
    /// When crossings are looked for [default: retroactive]
    #[arg(long, value_name = "WHEN", value_enum, requires = "topology")]
    strategy: Option<StrategyName>,
    /// Make vertices one that are no farther apart than this, in units of the data
    #[arg(long, value_name = "DISTANCE", value_parser = parse::positive, requires = "topology")]
    snap: Option<f64>,
    /// Points that stay on the side of every line that they are on
    #[arg(long, value_name = "FILE", requires = "topology")]
    sides: Option<PathBuf>,
}

/// What is written.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Output")]
struct Output {
    /// Format to write [default: by the output's ending; with several inputs, as they are]
    #[arg(short, long, value_name = "NAME")]
    format: Option<String>,
    /// The object of TopoJSON files to read [default: their first]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Digits behind the point that positions are rounded to; with --topology vertices keep theirs where lines would touch, cross or change sides [default: as they are]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=17))]
    decimals: Option<u8>,
    /// Replace files that exist
    #[arg(long)]
    overwrite: bool,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl Verb for Args {
    const NAME: &'static str = "line";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <--tolerance <LENGTH>|--area <A>|--keep-ratio <SHARE>|--keep-count <N>|--target-size <SIZE>> <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::simplifiers(), lists::features(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
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
    let mut args = args.clone();
    let holds = pipes::Holds::Features(args.input_format.as_deref());
    let mut stdin = pipes::Stdin::expect(&mut args.input, holds, &resources)?;
    if args.input_format.is_some() && !stdin.is_read() {
        return Err(Error::usage("--input-format is for stdin, and no input is -")
            .remedy("leave --input-format out: files tell their format"));
    }
    // What is asked for says so, not how many of the files are there or good.
    let into_folder = args.input.len() > 1 || vector::is_collection(&args.input[0]);
    if into_folder {
        atomic::refuse_stdout(&args.output)?;
    }
    let stdout = pipes::Stdout::take(&mut args.output, args.out.format.as_deref(), &resources)?;
    let options = vector::OpenOptions { layer: args.out.layer.clone() };
    let features = many::Kind::Features(&options);
    args.input = args.many.find(&args.input, features)?;
    let job = LineJob { into_folder, ..job(&args)? };
    match into_folder {
        true => check::folder(&job.output)?,
        false => check::new_file(&job.output, job.overwrite)?,
    }
    job.check()?;
    stdin.gather(&mut args.input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(args.input, features, &resources)?;
    let job = LineJob { input: paths(&names), ..job };
    check_report(&job, args.out.report.as_deref(), &names)?;
    let report = line::run(&job, args.show.progress().as_ref(), cancel)?;
    stdout.as_ref().map_or(Ok(()), pipes::Stdout::pour)?;
    let told = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.out.report {
        report::write(path, args.out.overwrite, &told)?;
    }
    args.show.beside(stdout.is_some()).tell(&told, || summary(&report))?;
    Ok(Outcome::Kept)
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<LineJob> {
    let Args { input, output, goal, method, neighbours, out, system, .. } = args;
    if let Some(sides) = &neighbours.sides {
        check::input(&name_of(sides.clone())?)?;
    }
    let outputs: Vec<&Path> =
        std::iter::once(output.as_path()).chain(method.hierarchy.as_deref()).collect();
    let read: Vec<String> = input.iter().cloned().chain(system.files()?).collect();
    check::not_among(&read, &outputs)?;
    if let Some(report) = &out.report {
        check::new_file(report, out.overwrite)?;
    }
    if let Some(hierarchy) = method.hierarchy.as_deref().filter(|path| !path.exists()) {
        check::new_file(hierarchy, false)?;
    }
    Ok(LineJob {
        input: paths(input),
        layer: out.layer.clone(),
        output: output.clone(),
        into_folder: false,
        format: out.format.clone(),
        method: method.method(),
        hierarchy: method.hierarchy.clone(),
        goal: goal.goal(),
        is_space: method.metric == MetricName::Space,
        topology: neighbours.topology.then(|| neighbours.topology()),
        collapse: match method.collapse {
            CollapseName::Minimal => Collapse::Minimal,
            CollapseName::Drop => Collapse::Drop,
            CollapseName::Keep => Collapse::Keep,
        },
        decimals: out.decimals,
        transform: system.transform()?,
        overwrite: out.overwrite,
        resources: args.machine.resources(),
    })
}

/// Fails when the report would take the place of something that the job reads or makes.
fn check_report(job: &LineJob, report: Option<&Path>, names: &[String]) -> Result<()> {
    let mut results = line::outputs(job)?;
    results.extend(job.hierarchy.clone());
    let results: Vec<&Path> = results.iter().map(PathBuf::as_path).collect();
    check::report(report, names, &results, job.overwrite)
}

fn paths(names: &[String]) -> Vec<PathBuf> {
    names.iter().map(|name| path_of(name).into_owned()).collect()
}

impl GoalArgs {
    fn goal(&self) -> Goal {
        let Self { tolerance, area, keep_ratio, keep_count, target_size } = *self;
        let given = [
            tolerance.map(Goal::Tolerance),
            area.map(Goal::Area),
            keep_ratio.map(Goal::Ratio),
            keep_count.map(Goal::Count),
            target_size.map(Goal::Size),
        ];
        // One of them is required.
        given.into_iter().flatten().next().unwrap_or(Goal::Ratio(1.0))
    }
}

impl MethodArgs {
    fn method(&self) -> &'static Method {
        let usual = if self.hierarchy.is_some() { &Method::RDP } else { &METHODS[0] };
        self.method.unwrap_or(usual)
    }
}

impl Neighbours {
    fn topology(&self) -> Topology {
        Topology {
            strategy: match self.strategy {
                None | Some(StrategyName::Retroactive) => Strategy::Retroactive,
                Some(StrategyName::Proactive) => Strategy::Proactive,
            },
            snap: self.snap.unwrap_or(0.0),
            sides: self.sides.clone(),
            ..Topology::default()
        }
    }
}

fn parse_area(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number of 0 or more".to_owned()),
    }
}

fn parse_share(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("expected a number from 0 to 1".to_owned()),
    }
}

fn parse_method(name: &str) -> std::result::Result<&'static Method, String> {
    line::method(name).map_err(|e| e.to_string())
}

/// A simplification for people.
fn summary(r: &LineReport) -> String {
    let share = text::percent(r.kept as f64 / r.vertices.max(1) as f64);
    let unit = match r.measure {
        Measure::Geographic => " m",
        Measure::Plane | Measure::Space => "",
    };
    let (features, parts) = (text::count(r.features), text::count(r.parts));
    let largest = text::number(r.largest_distance);
    let mut rows = vec![
        ("read", format!("{features} features, {parts} lines and rings, {}", r.crs)),
        ("vertices", format!("{} of {} ({share})", text::count(r.kept), text::count(r.vertices))),
        ("method", format!("{}, threshold {}{unit}", r.method, text::number(r.threshold.value))),
        ("distance", format!("{largest}{unit} at most from what is left")),
    ];
    if r.collapsed > 0 {
        rows.push(("collapsed", format!("{} rings", text::count(r.collapsed))));
    }
    if r.arcs > 0 {
        let [arcs, refined, found] = [r.arcs, r.refined, r.input_crossings].map(text::count);
        rows.push(("topology", format!("{arcs} arcs, {refined} pieces refined")));
        rows.push(("crossings", format!("{found} that the input has")));
    }
    rows.extend(r.hierarchy.as_ref().map(|own| ("hierarchy", hierarchy(own))));
    rows.push(("files", format!("{}, {}", text::bytes(r.output_bytes), r.outputs.join(", "))));
    rows.extend(system::rows(r.transformed.as_ref()));
    rows.extend(report::took(&r.run, None, ""));
    rows.extend(report::notes(&r.notes));
    format!("{}\n{}", r.inputs.join(", "), text::table(&rows))
}

/// What a file of hierarchies was to a simplification.
fn hierarchy(own: &HierarchyReport) -> String {
    let done = if own.made { "made" } else { "checked" };
    let [prepared, asked] = [own.prepare_seconds, own.query_seconds].map(text::seconds);
    format!("{}, {}, {done} in {prepared}, asked in {asked}", own.file, text::bytes(own.bytes))
}
