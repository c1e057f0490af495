//! Point clouds to grids: one pass over the points whatever the extent, several bands at once, the
//! same bytes whatever the order of files, the threads and the memory.

mod blocks;
mod budget;
mod extent;
mod feed;
mod preset;
mod queue;
mod report;
mod source;
mod surface;

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::cloud::{self, OpenOptions, PointSource};
use crate::error::{Error, Result};
use crate::geom::{Frame, Rect};
use crate::gridding::{self, Asked, Recipe, Rules, Units};
use crate::pipeline::convert::{copy_levels, task};
use crate::pipeline::{Cancel, Progress, Resources, peak_memory};
use crate::raster::write::{self, BandName, GridFormat, GridSink, WriteOptions};
use crate::raster::{GridInfo, GridSource, SampleType};
use blocks::Blocks;
use budget::Budget;
use extent::Extent;
pub use extent::{Compat, Placement};
use feed::{Fed, Feed};
pub use preset::{GroundFrom, Preset};
use preset::{Making, Model};
pub use report::{BandReport, GridReport, GridStage};
use source::{BandSource, Finished};
use surface::{Heights, Surfaces};

/// A cloud-to-grid job.
#[derive(Clone, Debug)]
pub struct GridJob {
    /// Files, folders, patterns or lists of clouds.
    pub input: Vec<String>,
    /// How they are read.
    pub cloud: OpenOptions,
    /// File to write.
    pub output: PathBuf,
    /// Name of the format to write; by the output's ending when `None`, a plain GeoTIFF in tiles for
    /// a `.tif`.
    pub format: Option<String>,
    /// Creation options of the format, as (key, value).
    pub creation: Vec<(String, String)>,
    /// A band for each ([`gridding::parse_list`]).
    pub stats: Vec<Asked>,
    /// The model of the terrain that the only band is ([`Preset::band`]), if it is one.
    pub preset: Option<Preset>,
    /// Which points are ground, for a preset: `cloud.filter.classes` names their classes, 2 if `None`.
    pub ground: GroundFrom,
    /// Where the cells lie.
    pub placement: Placement,
    /// Whose conventions are followed.
    pub compat: Compat,
    /// Radius of idw and nearest (of all statistics, in the manner of PDAL), in world units; the
    /// greater side of a cell times the root of 2 when `None`.
    pub radius: Option<f64>,
    /// Power of the distance that weights of idw fall off by; 1 when `None`.
    pub power: Option<f64>,
    /// Triangles with a longer edge, in world units, are no surface; all are when `None`.
    pub max_edge: Option<f64>,
    /// Voids are filled from known cells at most so many columns and rows away; 0 fills none.
    pub fill: u32,
    /// Type of the written samples.
    pub sample_type: SampleType,
    /// Write the nearest value where a type of whole numbers does not hold one exactly.
    pub round: bool,
    /// Written value for voids.
    pub nodata: f64,
    /// Replace an existing output.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

/// Stands for voids unless told otherwise.
const NODATA: f64 = -9999.0;

impl GridJob {
    /// The job with everything else at its default, for cells of `cell` world units.
    pub fn new(
        input: impl IntoIterator<Item = impl Into<String>>,
        output: impl Into<PathBuf>,
        stats: Vec<Asked>,
        cell: f64,
    ) -> Self {
        Self {
            input: input.into_iter().map(Into::into).collect(),
            cloud: OpenOptions::default(),
            output: output.into(),
            format: None,
            creation: Vec::new(),
            stats,
            preset: None,
            ground: GroundFrom::default(),
            placement: Placement::new([cell; 2]),
            compat: Compat::None,
            radius: None,
            power: None,
            max_edge: None,
            fill: 0,
            sample_type: SampleType::F32,
            round: false,
            nodata: NODATA,
            overwrite: false,
            resources: Resources::default(),
        }
    }

    /// As [`new`](Self::new), for a model of the terrain.
    pub fn of_preset(
        input: impl IntoIterator<Item = impl Into<String>>,
        output: impl Into<PathBuf>,
        preset: Preset,
        cell: f64,
    ) -> Self {
        Self { preset: Some(preset), ..Self::new(input, output, vec![preset.band()], cell) }
    }

    /// The format to write.
    pub fn format(&self) -> Result<&'static GridFormat> {
        let usual = self.is_plain_tiff().then_some(PLAIN);
        write::by_path(&self.output, self.format.as_deref().or(usual))
    }

    /// True for a `.tif` of no format in particular.
    fn is_plain_tiff(&self) -> bool {
        let ending = self.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        self.format.is_none() && matches!(ending.as_str(), "tif" | "tiff")
    }

    /// The creation options: a GeoTIFF is tiled unless it is to be in strips, for tiles are what
    /// blocks of cells fit into.
    fn creation(&self) -> Vec<(String, String)> {
        let mut creation = self.creation.clone();
        let given = creation.iter().any(|(key, _)| key.eq_ignore_ascii_case("TILED"));
        if !given && self.format().is_ok_and(|format| format.name == PLAIN) {
            creation.push(("TILED".to_owned(), "YES".to_owned()));
        }
        creation
    }

    fn write_options(&self) -> WriteOptions {
        let bands = self.stats.iter().map(|asked| BandName {
            name: asked.label.clone(),
            in_vertical_unit: asked.statistic.is_height(),
        });
        let single = !self.format().is_ok_and(|format| format.several_bands);
        WriteOptions {
            overwrite: self.overwrite,
            creation: self.creation(),
            sample_type: None,
            nodata: None,
            round: self.round,
            temp_dir: self.resources.temp_dir.clone(),
            bands: if single && self.stats.len() == 1 { Vec::new() } else { bands.collect() },
        }
    }

    fn rules(&self, cell: [f64; 2]) -> Rules {
        let usual = cell[0].max(cell[1]) * std::f64::consts::SQRT_2;
        Rules {
            radius: self.radius.unwrap_or(usual),
            power: self.power.unwrap_or(1.0),
            around: self.compat == Compat::Pdal,
        }
    }

    /// How the cloud is read: where only a box of cells is wanted, without the points that are too far
    /// away from it to be in any of its values, so that files and parts beyond are not even read. A
    /// triangle may have corners anywhere.
    fn reading(&self) -> OpenOptions {
        let mut options = self.cloud.clone();
        let cell = self.placement.cell.unwrap_or_default();
        let recipe = Recipe::new(&self.stats, &self.rules(cell));
        if let (Some([x0, y0, x1, y1]), None, false) =
            (self.placement.bbox, options.filter.bounds, recipe.triangulates())
        {
            let reach = recipe.reach();
            let [x, y] = cell.map(|side| reach + f64::from(self.fill + 2) * side);
            options.filter.bounds = Some([x0 - x, y0 - y, x1 + x, y1 + y]);
        }
        options
    }

    /// Folder for what does not fit into memory.
    fn spill_folder(&self) -> &Path {
        let beside = self.output.parent().filter(|folder| !folder.as_os_str().is_empty());
        self.resources.temp_dir.as_deref().or(beside).unwrap_or(Path::new("."))
    }

    /// Fails when the job cannot be done whatever the points.
    pub fn check(&self) -> Result<()> {
        let format = self.format()?;
        format.check(&self.creation)?;
        gridding::check_power(self.power.unwrap_or(1.0))?;
        if self.stats.is_empty() {
            return Err(Error::usage("no statistic is asked for").remedy("add --stat mean"));
        }
        self.preset.map_or(Ok(()), |preset| preset::check(preset, self))?;
        self.placement.check(self.compat)?;
        crate::atomic::refuse_existing(&self.output, self.overwrite)
    }
}

/// The format of a `.tif` unless another is named.
const PLAIN: &str = "GTiff";

/// Runs the job. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// Whatever the inputs, the output and the memory allow not; more points in a cell than can be
/// counted.
pub fn run(job: &GridJob, progress: &dyn Progress, cancel: &Cancel) -> Result<GridReport> {
    job.check()?;
    let start = Instant::now();
    let cloud = cloud::synth::source(&job.input, &job.reading())?;
    let opened = GridStage::since("open", start);
    let report = make(&*cloud, job, progress, cancel)?;
    let stages = [vec![opened], report.stages].concat();
    let wall_seconds = start.elapsed().as_secs_f64();
    let notes = [cloud.notes().to_vec(), report.notes].concat();
    let files = cloud.files().len();
    Ok(GridReport { stages, wall_seconds, notes, files, ..report })
}

/// As [`run`], of points from any source (`job.input` is only named in the report).
pub fn grid(
    points: &dyn PointSource,
    job: &GridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridReport> {
    if job.preset.is_some() {
        let message = "a preset reads its cloud several times, by class and return";
        return Err(Error::usage(message).remedy("run the job with the cloud's name"));
    }
    make(points, job, progress, cancel)
}

fn make(
    points: &dyn PointSource,
    job: &GridJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridReport> {
    let start = Instant::now();
    job.check()?;
    let extent = Extent::new(points.info(), job)?;
    let recipe = Recipe::new(&job.stats, &job.rules(extent.cell()));
    let info = written(&extent, job);
    let format = job.format()?;
    let mut sink = format.create(&job.output, &info, &job.write_options())?;
    let share = if recipe.triangulates() { job.resources.memory / 2 } else { 0 };
    let rest = Resources { memory: job.resources.memory - share, ..job.resources.clone() };
    let budget =
        Budget::divide(&rest, format, sink.as_ref(), &extent, &recipe, points.info().count)?;
    let folder = job.spill_folder();
    let blocks = Blocks::new(&recipe, &extent, &budget, folder);
    let (threads, memory) = (budget.threads, share);
    let (fed, heights) = match job.preset {
        Some(preset) => {
            let reading = job.reading();
            let making = Making { job, reading, threads, memory, progress, cancel };
            let model = Model::new(preset, points.info(), &making)?;
            (Fed { census: model.census, outside: 0 }, Some(Heights::Model(Box::new(model))))
        }
        None => {
            let store = (memory > 0).then(|| surface::store(points.info(), folder, memory));
            let (source, into) = (points, store.as_ref());
            let (extent, recipe, blocks) = (&extent, &recipe, &blocks);
            let feed = Feed { source, extent, recipe, blocks, store: into };
            let fed = feed.run(threads, progress, cancel)?;
            let surfaces = store.map(|store| Surfaces::new(store, points.info().frame));
            (fed, surfaces.transpose()?.map(Box::new).map(Heights::Surfaces))
        }
    };
    let accumulated = GridStage::since("points", start);
    let begun = Instant::now();
    let units = units(&extent, points);
    let (recipe, extent, max_edge) = (&recipe, &extent, job.max_edge);
    let finished = Finished { blocks, recipe, extent, units, heights, max_edge };
    let valid = write_bands(&finished, &info, sink.as_mut(), budget.threads, progress, cancel)?;
    cancel.check()?;
    let through = finished.heights.as_ref().map_or(0, Heights::spilled_bytes);
    let made_of = finished.heights.as_ref().map_or(&[][..], Heights::notes).to_vec();
    let (spilled, notes) = (finished.blocks.spilled_bytes() + through, sink.notes());
    let output_bytes = sink.finish()?;
    let written = GridStage::since("write", begun);
    let bands = recipe.bands().iter().zip(valid);
    let wall_seconds = start.elapsed().as_secs_f64();
    Ok(GridReport {
        format: format.name.to_owned(),
        points: fed.census,
        outside_grid: fed.outside,
        bands: bands.map(|(band, valid)| BandReport { name: band.label.clone(), valid }).collect(),
        notes: [extent.notes.clone(), made_of, notes].concat(),
        output_bytes,
        spilled_bytes: spilled,
        threads: budget.threads,
        points_per_second: fed.census.read as f64 / accumulated.seconds,
        stages: vec![accumulated, written],
        wall_seconds,
        ..report(job, &info, extent)
    })
}

fn units(extent: &Extent, points: &dyn PointSource) -> Units {
    let Frame { scale, offset } = points.info().frame;
    Units { scale: scale[2], offset: offset[2], area: extent.lattice.area() }
}

/// The grid as it is written.
fn written(extent: &Extent, job: &GridJob) -> GridInfo {
    let Rect { col, row, width, height } = extent.output;
    GridInfo {
        transform: extent.lattice.transform().shifted(f64::from(col), f64::from(row)),
        georeferenced: true,
        crs: extent.crs.clone(),
        nodata: Some(job.nodata),
        bands: u32::try_from(job.stats.len()).unwrap_or(u32::MAX),
        ..GridInfo::plain("grid of points", width, height, job.sample_type)
    }
}

/// Hands the values of all bands to the sink; returns how many cells of each have one.
fn write_bands(
    finished: &Finished<'_>,
    info: &GridInfo,
    sink: &mut dyn GridSink,
    threads: usize,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Vec<u64>> {
    let bands = finished.recipe.bands().iter();
    let bands: Vec<_> = bands.map(|band| BandSource::new(finished, band, info)).collect();
    let sources: Vec<&dyn GridSource> = bands.iter().map(|band| band as &dyn GridSource).collect();
    let window = info.bounds();
    progress.begin("write", window.len() as u64);
    let pieces = task::Pieces::new(window, &bands[0], sink, 0);
    let task = task::Task { sources: &sources, window, sink, pieces };
    task.run(threads, progress, cancel)?;
    progress.end();
    copy_levels(sink, threads, progress, cancel)?;
    Ok(bands.iter().map(BandSource::valid).collect())
}

fn report(job: &GridJob, info: &GridInfo, extent: &Extent) -> GridReport {
    let [west, y, cell_x, cell_y] = {
        let t = info.transform;
        [t.x0 - 0.5 * t.a, t.y0 - 0.5 * t.e, t.a, -t.e]
    };
    GridReport {
        input: job.input.join(", "),
        output: job.output.display().to_string(),
        width: info.width,
        height: info.height,
        cells: u64::from(info.width) * u64::from(info.height),
        cell: [cell_x, cell_y],
        corner: [west, y],
        crs: info.crs.label(),
        vertical_unit: info.crs.vertical_unit.clone(),
        sample_type: info.sample_type.name().to_owned(),
        nodata: job.nodata,
        radius: extent.radius(&job.rules(extent.cell()), job),
        memory_budget: job.resources.memory,
        peak_memory: peak_memory(),
        ..GridReport::default()
    }
}
