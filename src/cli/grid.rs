//! `terrane grid`: clouds of points become grids.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::atomic;
use crate::cli::shared::ground::GroundName;
use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{
    Outcome, args, check, lists, many, names, parse, pipes, points, report, text,
};
use crate::cloud::OpenOptions;
use crate::error::{Error, Result};
use crate::gridding::{self, Asked};
use crate::jobs::grid::{self, Canopy, Compat, GridJob, GridReport, GroundFrom, Placement, Preset};
use crate::jobs::sift::Sifted;
use crate::jobs::{Cancel, Resources};
use crate::raster::SampleType;
use crate::raster::write::GridFormat;

/// Make a grid of a cloud of points: statistics of the points in each cell
///
/// Cells take points at their western and southern border, and their corners lie at multiples of the
/// cell size. One pass over the points, whatever the extent; the bytes are the same for any order of
/// points and files, any number of threads and any memory.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "grid")]
pub(super) struct Args {
    /// Cloud of points: files (.las, .laz, or text with a point in each line), folders, patterns in
    /// quotes, or lists are one cloud. The last name is that of the file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    model: Model,
    #[command(flatten)]
    wanted: Wanted,
    #[command(flatten)]
    out: Output,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Which grid of which points, written how: for a run of its own, and for a plan.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Wanted {
    /// Statistics, a band for each, such as mean,max,p95,idw:radius=2,power=1
    #[arg(long, value_name = "LIST", default_value = "mean", value_parser = parse_stats)]
    stat: Stats,
    #[command(flatten)]
    cells: Cells,
    #[command(flatten)]
    method: Method,
    #[command(flatten)]
    points: points::Points,
    #[command(flatten)]
    pub(super) file: Written,
}

/// The statistics of one list.
#[derive(Clone, Debug)]
struct Stats(Vec<Asked>);

/// A model of the terrain, in place of statistics.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Models of the terrain")]
pub(super) struct Model {
    /// The ground: its points, linear in their triangulation at the centres of cells
    #[arg(long, conflicts_with_all = ["stat", "dsm", "chm"])]
    dtm: bool,
    /// What is seen from above: first returns, linear in their triangulation, without the pits that
    /// pulses leave which went deep into a crown; by another method with --canopy
    #[arg(long, conflicts_with_all = ["stat", "chm"])]
    dsm: bool,
    /// The height of --dsm above --dtm, 0 where it would be below
    #[arg(long, conflicts_with = "stat")]
    chm: bool,
    /// Which points are ground: class (those of class 2, or of --class), those that a method such as
    /// csf:rigidness=1 finds among last returns, or auto: by class if there are any, else by the method
    /// adaptive [default: auto]
    #[arg(long, value_name = "HOW", value_parser = GroundName::parse)]
    ground: Option<GroundName>,
    /// How --dsm and --chm get rid of returns from deep in crowns: pit-free, or spike-free with its parameters,
    /// such as spike-free:freeze=1.5, which is made of all returns [default: pit-free]
    #[arg(long, value_name = "METHOD", value_parser = parse_canopy)]
    canopy: Option<Canopy>,
    /// Water of a file of features, made level in --dtm: polygons are lakes, as high as their lowest bank, and
    /// those that a line of the file runs within are rivers, falling along it (drawn downstream)
    #[arg(long, value_name = "FILE", value_parser = names::any(), requires = "dtm")]
    water: Option<String>,
}

impl Model {
    /// A job for statistics, for the model instead, if one is asked for.
    pub(super) fn job(&self, job: GridJob) -> Result<GridJob> {
        let preset = self.preset();
        if self.ground.is_some() && preset.is_none() {
            return Err(idle("--ground", "for --dtm, --dsm and --chm"));
        }
        if self.canopy.is_some() && preset.is_none_or(|preset| preset == Preset::Dtm) {
            return Err(idle("--canopy", "for --dsm and --chm"));
        }
        Ok(GridJob {
            stats: preset.map_or(job.stats, |preset| vec![preset.band()]),
            preset,
            ground: GroundName::of(self.ground),
            canopy: self.canopy.unwrap_or_default(),
            water: self.water.clone(),
            ..job
        })
    }

    fn preset(&self) -> Option<Preset> {
        let presets = [(self.dtm, Preset::Dtm), (self.dsm, Preset::Dsm), (self.chm, Preset::Chm)];
        presets.into_iter().find(|(wanted, _)| *wanted).map(|(_, preset)| preset)
    }
}

/// Where the cells lie.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Cells")]
struct Cells {
    /// Side of a cell, or its width and height, in the units of the CRS [default of --dtm, --dsm and --chm: about the
    /// distance between points, rounded up to 1, 2 or 5 times a power of ten]
    #[arg(long, value_name = "SIZE", value_parser = parse::cell)]
    cell: Option<[f64; 2]>,
    /// A corner of some cell [default: 0,0]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = parse_pair)]
    align: Option<[f64; 2]>,
    /// All cells that this box overlaps, instead of those of the whole cloud
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true, value_parser = parse::bbox)]
    bbox: Option<[f64; 4]>,
    /// The very cells of this grid
    #[arg(long, value_name = "GRID", value_parser = names::any(), conflicts_with_all = ["cell", "align", "bbox"])]
    like: Option<String>,
    /// Follow the conventions of another program: pdal takes all points within --radius of a cell's
    /// centre for every statistic, from the lowest x and y on; lasr gives points on a border to the
    /// cell south of it
    #[arg(long, value_name = "PROGRAM", value_enum, default_value_t = CompatName::None)]
    compat: CompatName,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CompatName {
    None,
    Pdal,
    Lasr,
}

/// How values are made.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
struct Method {
    /// Points nearer than this to a cell's centre, for idw and nearest [default: the cell's longer
    /// side times the root of 2]
    #[arg(long, value_name = "R", value_parser = parse::positive)]
    radius: Option<f64>,
    /// Weights of idw are distance to the power of minus P, 4 at most [default: 1]
    #[arg(long, value_name = "P", value_parser = parse::positive)]
    power: Option<f64>,
    /// For tin and models of the terrain: triangles with an edge longer than this are no surface [default: all are]
    #[arg(long, value_name = "LENGTH", value_parser = parse::positive)]
    max_edge: Option<f64>,
    /// Fill voids from known cells at most N columns and rows away, weighted by the inverse of the
    /// larger of the two
    #[arg(long, visible_alias = "window", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    fill: Option<u32>,
}

/// How it is written.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Output")]
pub(super) struct Written {
    /// Format to write [default: by the output's ending; GTiff in tiles for a .tif]
    #[arg(short, long, value_name = "NAME")]
    pub(super) format: Option<String>,
    /// Option of the format, with GDAL's names, such as COMPRESS=ZSTD
    #[arg(long, value_name = "KEY=VAL", value_parser = parse::key_value)]
    co: Vec<(String, String)>,
    /// Type of the written samples; floats hold the nearest value
    #[arg(long = "type", value_name = "NAME", value_parser = parse::sample_type, default_value = "float32")]
    sample_type: SampleType,
    /// Write the nearest value where a type of whole numbers, or the format, does not hold one exactly
    #[arg(long)]
    round: bool,
    /// Written value for voids
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, value_parser = parse::finite_or_nan, default_value = "-9999")]
    nodata: f64,
}

/// What else is written, and over what.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Output")]
struct Output {
    /// Replace files that exist
    #[arg(long)]
    overwrite: bool,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl Verb for Args {
    const NAME: &'static str = "grid";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![
            lists::statistics(),
            lists::grounds(),
            lists::canopies(),
            lists::grids_written(),
            lists::creation_options(),
            lists::EXIT_CODES.to_owned(),
        ]
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
    let options = args.wanted.open_options(&resources)?;
    let clouds = many::Kind::Clouds(&options);
    let mut args = args.clone();
    let mut stdin = pipes::Stdin::expect(&mut args.input, pipes::Holds::Points, &resources)?;
    args.input = args.many.find(&args.input, clouds)?;
    let job = job(&args)?;
    stdin.gather(&mut args.input, cancel)?;
    let Sifted { names, skipped } = args.many.sift(args.input, clouds, &resources)?;
    let cloud = args.many.reading(job.cloud.clone());
    let job = GridJob { input: names, cloud, ..job };
    let report = grid::run(&job, args.show.progress().as_ref(), cancel)?;
    let told = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.out.report {
        report::write(path, args.out.overwrite, &told)?;
    }
    args.show.tell(&told, || summary(&report))?;
    Ok(Outcome::Kept)
}

/// Checks what can be checked without work, and makes the job.
fn job(args: &Args) -> Result<GridJob> {
    atomic::refuse_stdout(&args.output)?;
    let job = args.model.job(args.wanted.job(&args.input, args.machine.resources())?)?;
    let job = GridJob { output: args.output.clone(), overwrite: args.out.overwrite, ..job };
    args.wanted.check(job.format()?)?;
    job.check()?;
    args.check_files()?;
    Ok(job)
}

/// The error of an option that cannot act.
fn idle(option: &str, why: &str) -> Error {
    Error::usage(format!("{option} cannot act: it is {why}")).remedy(format!("leave {option} out"))
}

impl Wanted {
    /// How the clouds are opened.
    pub(super) fn open_options(&self, resources: &Resources) -> Result<OpenOptions> {
        self.points.open_options(resources)
    }

    /// The job that makes it of `input`; its output is left to be named.
    pub(super) fn job(&self, input: &[String], resources: Resources) -> Result<GridJob> {
        let Self { stat, cells, method, points, file } = self;
        Ok(GridJob {
            input: input.to_vec(),
            cloud: points.open_options(&resources)?,
            output: PathBuf::new(),
            format: file.format.clone(),
            creation: file.co.clone(),
            stats: stat.0.clone(),
            preset: None,
            ground: GroundFrom::Auto,
            canopy: Canopy::default(),
            water: None,
            placement: Placement {
                cell: cells.cell,
                align: cells.align,
                bbox: cells.bbox,
                like: cells.like.clone(),
                is_chosen: false,
            },
            compat: match cells.compat {
                CompatName::None => Compat::None,
                CompatName::Pdal => Compat::Pdal,
                CompatName::Lasr => Compat::Lasr,
            },
            radius: method.radius,
            power: method.power,
            max_edge: method.max_edge,
            fill: method.fill.unwrap_or(0),
            sample_type: file.sample_type,
            round: file.round,
            nodata: file.nodata,
            overwrite: false,
            resources,
        })
    }

    /// Fails when an option was given that cannot act in a format.
    pub(super) fn check(&self, format: &GridFormat) -> Result<()> {
        let floats = [SampleType::F16, SampleType::F32, SampleType::F64];
        if self.file.round && format.holds_types && floats.contains(&self.file.sample_type) {
            return Err(idle("--round", "for whole numbers: floats hold the nearest value anyway"));
        }
        Ok(())
    }
}

impl Args {
    /// Fails when an output is an input, or cannot be made.
    fn check_files(&self) -> Result<()> {
        let (report, overwrite) = (self.out.report.as_deref(), self.out.overwrite);
        let files = crate::cloud::files(&self.input)?;
        self.wanted.cells.like.as_deref().map_or(Ok(()), check::input)?;
        check::not_among(&files, &[&self.output])?;
        check::new_file(&self.output, overwrite)?;
        let beside = self.wanted.cells.like.iter().chain(&self.model.water);
        let beside: Vec<_> = beside.cloned().collect();
        check::not_among(&beside, &[&self.output])?;
        let read = [files, self.wanted.points.files()?, beside].concat();
        check::report(report, &read, &[&self.output], overwrite)
    }
}

fn parse_canopy(text: &str) -> std::result::Result<Canopy, String> {
    text.parse().map_err(|e: Error| e.to_string())
}

/// A list of statistics.
fn parse_stats(text: &str) -> std::result::Result<Stats, String> {
    gridding::parse_list(text).map(Stats).map_err(|e| e.to_string())
}

/// "x,y".
fn parse_pair(text: &str) -> std::result::Result<[f64; 2], String> {
    let pair = text.split_once(',').map(|(x, y)| (parse::finite(x), parse::finite(y)));
    match pair {
        Some((Ok(x), Ok(y))) => Ok([x, y]),
        _ => Err("expected x,y".to_owned()),
    }
}

/// A made grid for people.
pub(super) fn summary(r: &GridReport) -> String {
    let unit = r.vertical_unit.as_deref().unwrap_or("unit of height unknown");
    let [width, height] = r.cell.map(text::number);
    let mut rows = vec![
        ("points", points(r)),
        (
            "grid",
            format!(
                "{} x {} cells of {width} x {height}, {}, {unit}",
                text::count(r.width.into()),
                text::count(r.height.into()),
                r.crs
            ),
        ),
        ("bands", bands(r)),
    ];
    rows.extend(r.water.as_ref().map(|water| ("water", text::water(water))));
    rows.push((
        "file",
        format!("{}, {}, {}", text::bytes(r.output_bytes), r.format, r.sample_type),
    ));
    let stage = |s: &grid::GridStage| format!("{} {}", s.name, text::seconds(s.seconds));
    let stages = r.stages.iter().map(stage).collect::<Vec<_>>().join(", ");
    let rate = text::rate(r.points_per_second, "points");
    rows.extend(report::took(&r.run, Some(rate), &stages));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn points(r: &GridReport) -> String {
    let p = &r.points;
    let dropped = [
        (p.withheld, "withheld"),
        (p.filtered, "filtered out"),
        (p.outside, "outside the bounds of their file"),
        (p.lost, "lost"),
        (r.outside_grid, "outside the grid"),
    ];
    let dropped = dropped.into_iter().filter(|(count, _)| *count > 0);
    let dropped = dropped.map(|(count, why)| format!(", {} {why}", text::count(count)));
    let read = match r.cloud_points {
        None => format!("{} read", text::count(p.read)),
        Some(all) => {
            let [all, read] = [all, p.read].map(text::count);
            format!("{all} in the cloud; {read} read by tiles, those near several for each")
        }
    };
    read + &dropped.collect::<String>()
}

fn bands(r: &GridReport) -> String {
    let share = |valid: u64| text::percent(valid as f64 / r.cells.max(1) as f64);
    let band = |b: &grid::BandReport| format!("{} ({} of the cells)", b.name, share(b.valid));
    r.bands.iter().map(band).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::figures::Figures;

    #[test]
    fn corners_are_read() {
        assert_eq!(parse_pair("-1.5,2"), Ok([-1.5, 2.0]));
        assert!(parse_pair("1").is_err());
        assert!(parse_stats("mean,modus").is_err());
    }

    #[test]
    fn a_summary_tells_what_became_of_the_points() {
        let report = GridReport {
            points: crate::cloud::Census {
                read: 1234,
                kept: 1200,
                withheld: 34,
                ..Default::default()
            },
            outside_grid: 7,
            bands: vec![grid::BandReport { name: "mean".into(), valid: 5 }],
            cells: 10,
            run: Figures { spilled_bytes: Some(2048), peak_memory: Some(1), ..Figures::default() },
            ..GridReport::default()
        };
        let told = summary(&report);
        for part in
            ["1,234 read, 34 withheld, 7 outside the grid", "mean (50.00 % of", "2.0 KiB through"]
        {
            assert!(told.contains(part), "{part} in\n{told}");
        }
    }
}
