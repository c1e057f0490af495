//! `terrane info`: what a file is, for every format of grids, meshes, clouds and features.

use std::path::Path;

use serde::Serialize;

use crate::cli::many::Kind;
use crate::cli::{Outcome, args, cloud, cloud_info, feature_info, many, names, say, text};
use crate::cloud::is_cloud;
use crate::error::{Error, ErrorKind, Result};
use crate::geom::Point3;
use crate::jobs::sift::{Sifted, Skipped};
use crate::jobs::surface::{self, GridStats, Surface};
use crate::jobs::tin::{Plan, plan};
use crate::jobs::{Cancel, Progress, Resources};
use crate::mesh::MeshInfo;
use crate::raster::{GridInfo, Inputs, Note, notes, notes_on_heights};
use crate::vector;

/// Tell what grids, meshes, point clouds and files of lines are, what is odd about them, and what a TIN
/// of a grid would take
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid, mesh, cloud and feature files, or synthetic terrains by name; a folder, a list or a pattern in
    /// quotes is one mosaic or one cloud
    #[arg(required = true, value_name = "FILE", value_parser = names::any())]
    files: Vec<String>,
    /// Take all files together for one mosaic or one cloud
    #[arg(long)]
    mosaic: bool,
    /// Read all samples: share of valid ones, lowest, highest and mean height; of a cloud all points:
    /// counts by class and return, bounds found (features are read to the end in any case)
    #[arg(long)]
    stats: bool,
    /// The object of TopoJSON files to tell about [default: their first]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    cloud: cloud::Points,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Tells about each file; a bad one does not keep the others from being told about.
pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let progress = args.show.progress();
    let (mut is_any_told, mut failures) = (false, Vec::new());
    let at_once = if args.mosaic { args.files.len() } else { 1 };
    for files in args.files.chunks(at_once.max(1)) {
        let described = sift(files, args).and_then(|Sifted { names, skipped }| {
            Ok((describe(&names, args, progress.as_ref(), cancel)?, skipped))
        });
        match described {
            Ok((facts, skipped)) => {
                is_any_told = true;
                match args.show.json {
                    true => {
                        say::json_line(&many::WithSkipped { report: &facts, skipped: &skipped })?
                    }
                    false => say::result(&facts.text(&told(files)))?,
                }
            }
            Err(error) => {
                cancel.check()?;
                failures.push((told(files), error));
            }
        }
    }
    let may_skip = |(_, error): &(String, Error)| error.is_about_a_file();
    if args.many.skip_bad && is_any_told && failures.iter().all(may_skip) {
        return skip(&failures, args);
    }
    let last = failures.pop();
    failures.into_iter().for_each(|(_, error)| say::error(&args.many.advise(error)));
    last.map_or(Ok(Outcome::Kept), |(_, error)| Err(error))
}

/// Tells of files by themselves that are left out.
fn skip(failures: &[(String, Error)], args: &Args) -> Result<Outcome> {
    let skipped = failures.iter().map(|(name, error)| Skipped::new(name, error));
    let skipped: Vec<Skipped> = skipped.collect();
    skipped.iter().for_each(many::tell);
    if args.show.json && !skipped.is_empty() {
        say::json_line(&serde_json::json!({ "skipped": skipped }))?;
    }
    Ok(Outcome::Kept)
}

/// The files that are taken of what is to be told about together.
fn sift(files: &[String], args: &Args) -> Result<Sifted> {
    let resources = args.machine.resources();
    if files.iter().any(|file| feature_info::are_features(file)) {
        let options = vector::OpenOptions { layer: args.layer.clone() };
        return args.many.take(files, Kind::Features(&options), &resources);
    }
    let are_clouds = files.iter().map(|file| args.many.is_cloud(file));
    if are_clouds.collect::<Result<Vec<_>>>()?.contains(&true) {
        let options = args.cloud.open_options(&resources)?;
        return args.many.take(files, Kind::Clouds(&options), &resources);
    }
    args.many.take(files, Kind::Grids(&args.grid.open_options(&resources)), &resources)
}

/// What is known of a file.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Facts {
    Grid(Box<GridFacts>),
    Mesh(Box<MeshFacts>),
    Cloud(Box<cloud_info::Facts>),
    Features(Box<feature_info::Facts>),
}

impl Args {
    /// Fails when an object was named, because these are no features.
    fn refuse_layer(&self, files: &[String]) -> Result<()> {
        let Some(_) = self.layer else { return Ok(()) };
        Err(Error::usage("--layer is for files of features, and this is none")
            .in_file(Path::new(&told(files)))
            .remedy("leave --layer out"))
    }
}

fn told(files: &[String]) -> String {
    Inputs::from(files.to_vec()).to_string()
}

fn describe(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    if files.iter().any(|file| is_cloud(file)) {
        args.refuse_layer(files)?;
        return describe_cloud(files, args, progress, cancel);
    }
    if files.iter().any(|file| feature_info::are_features(file)) {
        return describe_features(files, args, progress, cancel);
    }
    args.refuse_layer(files)?;
    let as_grid = match describe_surface(files, args, progress, cancel) {
        Err(error) if error.kind() == ErrorKind::BadInput => error,
        other => return other,
    };
    // A table of positions may be features.
    match describe_features(files, args, progress, cancel) {
        Ok(Facts::Features(facts)) if facts.is_more_than_positions() => {
            let note = format!("taken for features, because as a grid: {as_grid}");
            Ok(Facts::Features(Box::new(facts.noted(note))))
        }
        _ => Err(as_grid),
    }
}

fn describe_features(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    let [file] = files else {
        return Err(
            Error::usage("features are told about file by file").remedy("leave --mosaic out")
        );
    };
    args.grid.refuse(file, "a file of features")?;
    args.cloud.refuse(file)?;
    let facts = feature_info::describe(file, args.layer.as_ref(), (progress, cancel))?;
    Ok(Facts::Features(Box::new(facts)))
}

fn describe_surface(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    args.grid.check_all(files)?;
    files.iter().try_for_each(|file| args.cloud.refuse(file))?;
    files.iter().try_for_each(|file| args.machine.check(file))?;
    if args.stats {
        files.iter().try_for_each(|file| args::only_grids("--stats", file))?;
    }
    let file = &told(files);
    let resources: Resources = args.machine.resources();
    match surface::open(files, &args.grid.open_options(&resources))? {
        Surface::Grid(grid) => {
            let measure = || surface::grid_stats(grid.as_ref(), &resources, progress, cancel);
            let stats = args.stats.then(measure).transpose()?;
            let plan = plan(grid.as_ref(), &resources);
            Ok(Facts::Grid(Box::new(GridFacts::new(file, grid.info(), stats, plan))))
        }
        Surface::Mesh(mesh) => {
            let bounds = surface::mesh_bounds(mesh.as_ref(), progress, cancel)?;
            Ok(Facts::Mesh(Box::new(MeshFacts::new(file, mesh.info(), bounds))))
        }
    }
}

fn describe_cloud(
    files: &[String],
    args: &Args,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Facts> {
    files.iter().try_for_each(|file| args.grid.refuse(file, "a point cloud"))?;
    let (resources, told) = (args.machine.resources(), told(files));
    let at = (files, told.as_str());
    let facts = cloud_info::describe(at, &args.cloud, args.stats, &resources, (progress, cancel))?;
    Ok(Facts::Cloud(Box::new(facts)))
}

impl Facts {
    fn text(&self, file: &str) -> String {
        let rows = match self {
            Facts::Grid(grid) => grid.rows(),
            Facts::Mesh(mesh) => mesh.rows(),
            Facts::Cloud(cloud) => cloud.rows(),
            Facts::Features(features) => features.rows(),
        };
        format!("{file}\n{}", text::table(&rows))
    }
}

#[derive(Serialize)]
struct GridFacts {
    file: String,
    format: &'static str,
    width: u32,
    height: u32,
    samples: u64,
    sample_type: &'static str,
    bands: u32,
    band: u32,
    nodata: Option<f64>,
    scale: f64,
    offset: f64,
    crs: String,
    epsg: Option<u32>,
    vertical_epsg: Option<u32>,
    horizontal_unit: &'static str,
    vertical_unit: Option<String>,
    georeferenced: bool,
    pixel_is_point: bool,
    /// As GDAL has it: of the outer corner of cell (0, 0).
    geotransform: [f64; 6],
    cell_size: [f64; 2],
    /// West, south, east, north of the samples.
    sample_bounds: [f64; 4],
    /// West, south, east, north of the cells around them.
    bounds: [f64; 4],
    block: [u32; 2],
    details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stats: Option<GridStats>,
    /// What a TIN of it would take; absent where it has no cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    tin: Option<Plan>,
    notes: Vec<Note>,
}

impl GridFacts {
    fn new(file: &str, info: &GridInfo, stats: Option<GridStats>, tin: Option<Plan>) -> Self {
        let map = &info.transform;
        Self {
            file: file.to_owned(),
            format: info.format,
            width: info.width,
            height: info.height,
            samples: u64::from(info.width) * u64::from(info.height),
            sample_type: info.sample_type.name(),
            bands: info.bands,
            band: info.band,
            nodata: info.nodata,
            scale: info.scale,
            offset: info.offset,
            crs: info.crs.label(),
            epsg: info.crs.epsg,
            vertical_epsg: info.crs.vertical_epsg,
            horizontal_unit: info.crs.horizontal_unit(),
            vertical_unit: info.crs.vertical_unit.clone(),
            georeferenced: info.georeferenced,
            pixel_is_point: info.pixel_is_point,
            geotransform: map.to_gdal(),
            cell_size: [map.a.hypot(map.d), map.b.hypot(map.e)],
            sample_bounds: bounds(info, 0.0),
            bounds: bounds(info, 0.5),
            block: [info.block.0, info.block.1],
            details: details(&info.details),
            notes: all_notes(info, stats.as_ref()),
            stats,
            tin,
        }
    }

    fn rows(&self) -> Vec<(String, String)> {
        let size = [self.width, self.height].map(|n| text::count(n.into())).join(" x ");
        let unit = self.horizontal_unit;
        let mut rows = vec![
            ("format", self.format.to_owned()),
            ("size", format!("{size}, {} samples", text::count(self.samples))),
            ("type", self.sample_type.to_owned()),
            ("band", format!("{} of {}", self.band, self.bands)),
            ("nodata", self.nodata.map_or("none".to_owned(), text::number)),
            ("crs", self.crs.clone()),
            ("vertical", self.vertical_unit.clone().unwrap_or_else(|| "unit unknown".to_owned())),
            ("cell", format!("{} {unit}", self.cell_size.map(position).join(" x "))),
            ("samples are", if self.pixel_is_point { "points" } else { "areas" }.to_owned()),
            ("bounds", self.bounds.map(position).join(", ")),
            ("transform", self.geotransform.map(position).join(", ")),
            ("block", format!("{} x {}", self.block[0], self.block[1])),
        ];
        if (self.scale, self.offset) != (1.0, 0.0) {
            let line =
                format!("stored x {} + {}", text::number(self.scale), text::number(self.offset));
            rows.push(("height", line));
        }
        let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        rows.extend(detail_rows(&self.details));
        rows.extend(self.stats.iter().flat_map(|stats| stats_rows(stats, self.samples)));
        rows.extend(self.tin.iter().flat_map(plan_rows));
        rows.extend(self.notes.iter().map(|note| ("note".to_owned(), note.text.clone())));
        rows
    }
}

/// Notes on what the file says, and on its heights where they were read.
fn all_notes(info: &GridInfo, stats: Option<&GridStats>) -> Vec<Note> {
    let samples = u64::from(info.width) * u64::from(info.height);
    let on_heights = stats.map(|stats| {
        let suspects = stats.suspected_nodata.map(|stored| (stored, stats.at_min));
        notes_on_heights(samples, stats.valid, suspects)
    });
    notes(info).into_iter().chain(on_heights.into_iter().flatten()).collect()
}

fn plan_rows(plan: &Plan) -> Vec<(String, String)> {
    let [coarse, fine] = plan.seconds.map(text::seconds);
    let rates: Vec<String> = std::iter::zip(plan.nanoseconds_per_sample, plan.kept)
        .map(|(rate, kept)| format!("{} ns at {} kept", text::number(rate), text::percent(kept)))
        .collect();
    let threads = if plan.threads == 1 { "thread" } else { "threads" };
    let [least, memory] = [plan.least_memory, plan.memory].map(text::bytes);
    let mut rows = vec![
        ("tin memory", format!("{least} at least, {memory} allowed (--memory)")),
        (
            "tin time",
            format!(
                "about {coarse} to {fine} on {} {threads} (a sample and thread: {})",
                plan.threads,
                rates.join(", ")
            ),
        ),
    ];
    let [coarse, fine] = plan.mesh_bytes.map(text::bytes);
    let mut disk = format!("about {coarse} to {fine} for the mesh (PLY)");
    if plan.spill_bytes[1] > 0 {
        let [coarse, fine] = plan.spill_bytes.map(text::bytes);
        disk += &format!(", {coarse} to {fine} of temporary space");
    }
    rows.push(("tin disk", disk));
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn stats_rows(stats: &GridStats, samples: u64) -> Vec<(String, String)> {
    let share = text::percent(stats.valid as f64 / samples.max(1) as f64);
    let mut rows = vec![("valid".to_owned(), format!("{}, {share}", text::count(stats.valid)))];
    let heights = [
        ("lowest", stats.min),
        ("highest", stats.max),
        ("mean", stats.mean),
        ("std dev", stats.std_dev),
    ];
    let known =
        heights.iter().filter_map(|(name, z)| Some((name.to_string(), text::number((*z)?))));
    rows.extend(known);
    rows
}

/// World rectangle around the samples, widened by `margin` cells.
fn bounds(info: &GridInfo, margin: f64) -> [f64; 4] {
    let (right, bottom) =
        (f64::from(info.width) - 1.0 + margin, f64::from(info.height) - 1.0 + margin);
    let corners = [(-margin, -margin), (right, -margin), (-margin, bottom), (right, bottom)];
    let world = corners.map(|(col, row)| info.transform.apply(col, row));
    let low = |axis: usize| world.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| world.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    [low(0), low(1), high(0), high(1)]
}

/// A coordinate to nine decimals, shortest form; tiny and huge ones in powers of ten.
pub(super) fn position(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-6..1e15).contains(&value.abs()) {
        return format!("{value:e}");
    }
    let text = format!("{value:.9}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[derive(Serialize)]
struct MeshFacts {
    file: String,
    format: &'static str,
    vertices: u64,
    triangles: u64,
    crs: Option<String>,
    indexed: bool,
    single_precision: bool,
    origin: Point3,
    /// Stored units in one unit of each coordinate.
    scale: Point3,
    /// Smallest and largest coordinates; absent without vertices.
    bounds: Option<[Point3; 2]>,
    details: serde_json::Map<String, serde_json::Value>,
}

impl MeshFacts {
    fn new(file: &str, info: &MeshInfo, bounds: Option<[Point3; 2]>) -> Self {
        Self {
            file: file.to_owned(),
            format: info.format,
            vertices: info.vertices,
            triangles: info.triangles,
            crs: info.crs.clone(),
            indexed: info.indexed,
            single_precision: info.single_precision,
            origin: info.origin,
            scale: info.scale,
            bounds,
            details: details(&info.details),
        }
    }

    fn rows(&self) -> Vec<(String, String)> {
        let corner = |p: Point3| p.map(position).join(", ");
        let sharing = if self.indexed { "shared by triangles" } else { "three to each triangle" };
        let stored = if self.single_precision { "32-bit" } else { "64-bit" };
        let mut rows = vec![
            ("format", self.format.to_owned()),
            ("vertices", format!("{}, {sharing}", text::count(self.vertices))),
            ("triangles", text::count(self.triangles)),
            ("crs", self.crs.clone().unwrap_or_else(|| "unknown".to_owned())),
            ("positions", format!("{stored}, origin {}", corner(self.origin))),
        ];
        if let Some([low, high]) = self.bounds {
            rows.push(("lowest corner", corner(low)));
            rows.push(("highest corner", corner(high)));
        }
        let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        rows.extend(detail_rows(&self.details));
        rows
    }
}

/// Facts by name; of facts with one name the last stays.
fn details(facts: &[(String, String)]) -> serde_json::Map<String, serde_json::Value> {
    facts.iter().map(|(name, value)| (name.clone(), value.clone().into())).collect()
}

fn detail_rows(
    details: &serde_json::Map<String, serde_json::Value>,
) -> impl Iterator<Item = (String, String)> {
    details
        .iter()
        .map(|(name, value)| (name.clone(), value.as_str().unwrap_or_default().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_keep_their_digits_and_no_more() {
        assert_eq!(position(30.0), "30");
        assert_eq!(position(-124.000138889), "-124.000138889");
        assert_eq!(position(4_000_000.5), "4000000.5");
        assert_eq!((position(0.0), position(-0.0)), ("0".to_owned(), "0".to_owned()));
        assert_eq!(position(1e-9), "1e-9");
        assert_eq!(position(-2.5e-12), "-2.5e-12");
        assert_eq!(position(1e300), "1e300");
        assert_eq!(position(499_999.999_5), "499999.9995");
    }
}
