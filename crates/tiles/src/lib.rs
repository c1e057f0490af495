//! Tiles of the globe's terrain at every level of detail, of a grid of any size.
//!
//! **Once over the grid**: its range, means for voids, a plane for each block of samples, and the samples along the
//! borders of large tiles ([`terrane_globe::Plan`]).
//!
//! **Near levels**: a *region* is a tile with at most 1,024 samples along a side. Its samples are read once, and
//! all its tiles down to the deepest level are made of them. Regions are independent.
//!
//! **Far levels**: tiles that hold several regions are made of the overview, and measured by blocks; where a block
//! does not tell, its samples are read.
//!
//! Whatever is made depends on the grid and the options alone: at once, or by a plan whose tasks look, make regions,
//! and make what is above them. Files are put into a folder that appears whole.

mod beyond;
mod cloud;
mod division;
mod far;
mod folder;
mod format;
mod glance;
mod mask;
mod near;
mod object;
mod options;
mod place;
mod probe;
mod report;
mod spans;
mod three;
mod work;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use terrane_options::check;

pub use beyond::Beyond;
pub use cloud::{GroundModel, Kept, Made, run_cloud};
use division::Division;
use folder::Folder;
pub use format::Format;
use mask::Mask;
pub use options::{
    CloudTilesOptions, CloudTilesSetters, ModelOptions, ModelSetters, TileOptions, TileSetters,
    TilesOptions, TilesSetters,
};
pub use place::{AS_GIVEN, ON_ELLIPSOID, WITH_GEOID};
use place::{Heights, Place};
pub use report::{LevelReport, TilesReport, TilesRun, TilesStatus};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::figures::Figures;
use terrane_engine::memory::{self, Shares};
use terrane_engine::operation::{Divisible, Request};
use terrane_engine::options::GridInput;
use terrane_engine::plan::{self, At, DiskCheck, Form, Kind, Plan, RunJob};
use terrane_engine::sift::Skipped;
use terrane_engine::workers;
use terrane_engine::{Cancel, Progress, Resources, beside};
use terrane_files::refuse_held;
use terrane_globe::{DEEPEST, Gathered, Level, Overview, Relief, TileId, deepest_for, in_shorts};
use terrane_raster::{self as raster, GridSource, Inputs, Water, looks_like_nodata};
use work::Tiles;

/// Metres below or above which there is no ground.
const MOST_HEIGHT: f64 = 1e6;
/// Samples around a region that slopes are told from.
const APRON: u32 = 10;

/// Tiles to make of a grid. A plan notes what they depend on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TilesJob {
    /// File names, or a grid in memory by name.
    pub input: Inputs,
    /// What is read of it.
    #[serde(with = "terrane_options::as_map")]
    pub reading: GridInput,
    /// Folder to make.
    #[serde(skip)]
    pub output: PathBuf,
    /// Replace a folder of tiles that exists.
    #[serde(skip)]
    pub overwrite: bool,
    /// What tiles hold.
    #[serde(with = "terrane_options::as_map")]
    pub tiles: TileOptions,
    /// What the job may use.
    #[serde(skip)]
    pub resources: Resources,
}

impl TilesJob {
    /// The job with everything else at its default.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>) -> Self {
        Self {
            input: input.into(),
            reading: GridInput::default(),
            output: output.into(),
            overwrite: false,
            tiles: TileOptions::default(),
            resources: Resources::default(),
        }
    }
}

/// Tiles to plan; a task has so many tiles of regions, or of levels above them (`cut`).
pub type PlanJob = plan::PlanJob<TilesJob>;
/// The plan of tiles, or how far the work on it has come.
pub type StatusReport = plan::StatusReport<TilesStatus>;

/// A grid that is opened, and how the work on it is divided.
struct Opened {
    job: TilesJob,
    grid: Box<dyn GridSource>,
    shares: Shares,
    heights: Heights,
    /// What is water, where tiles tell of it.
    mask: Option<Mask>,
    division: Division,
    /// What is looked at first.
    look: terrane_globe::Plan,
}

/// What is known once all was looked at.
struct Ground<'a> {
    opened: &'a Opened,
    overview: &'a Overview,
    /// By set, from level 0 on.
    levels: Vec<Vec<Level>>,
}

/// Makes tiles. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// A grid whose place on the globe is not known, or one around a pole or across 180 degrees;
/// an output that exists; all that reading and writing may find.
pub fn run(job: &TilesJob, progress: &dyn Progress, cancel: &Cancel) -> Result<TilesReport> {
    let (started, at) = (Instant::now(), At { progress, cancel });
    terrane_files::atomic::refuse_existing(&job.output, job.overwrite)?;
    let folder = Folder::create(job)?;
    let opened = Opened::new(job)?;
    let (mut gathered, rows) = (opened.look.clone().gather(), [0, opened.division.place.whole[1]]);
    glance::look(&opened, rows, at, |glance| {
        gathered.add(glance);
        Ok(())
    })?;
    let overview = opened.seen(gathered)?;
    let ground = Ground::new(&opened, &overview);
    ground.make(&folder, at)?;
    let made = folder.finish(&ground, cancel)?;
    let run = Figures::since(started, &job.resources).with_threads(opened.shares.threads);
    Ok(TilesReport { run, ..made })
}

impl Divisible for TilesOptions {
    const TASK_SIZE: &'static str = "Tiles in a task: regions of about a million samples, each made with all tiles in it, or \
                                     larger ones [default: 128]";
    terrane_engine::planned_as!(Tiles, TilesStatus, TilesRun);

    fn plan(&self, request: Request<'_>, task_size: Option<u32>) -> Result<StatusReport> {
        let Request { inputs, output: folder, skipped, .. } = request;
        let job = self.job(inputs, &folder.join("tiles"));
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_tiles(&PlanJob { job, folder, cut: task_size, skipped })
    }
}

/// Writes down what is to be made, from what, by which tasks, and what they need.
///
/// # Errors
/// Those of [`run`] that are found before the work; `Usage` for a folder that holds another plan or other files.
pub fn plan_tiles(job: &PlanJob) -> Result<StatusReport> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    refuse_held(job.input.names())?;
    let (input, reading) = (job.input.resolve()?, job.reading.absolute()?);
    let geoid = job.tiles.geoid.as_deref().map(beside::absolute).transpose()?;
    let tiles = TileOptions { geoid, ..job.tiles.clone() };
    let opened = Opened::new(&TilesJob { input, reading, tiles, ..job.clone() })?;
    let tiles = Tiles::new(&opened, *cut)?;
    let files = opened.files();
    let there = Plan::<Tiles>::there(folder);
    let needs = there.map_or_else(|| tiles.needs(&opened), |plan| Ok(plan.needs))?;
    let label = opened.job.input.to_string();
    Plan::new(tiles, (label, files), needs, skipped)?.put(folder)?;
    plan::status::<Tiles>(folder)
}

/// Plans and runs `job` in `folder`, so that a run that was killed goes on where it was when it is started again.
/// `skipped` are files that are left out of the input, to be noted in the plan.
///
/// # Errors
/// Those of [`plan_tiles`] and of any [`RunJob`].
pub fn run_in(
    folder: &Path,
    job: &TilesJob,
    skipped: &[Skipped],
    disk: DiskCheck,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TilesReport> {
    let (to, with) = ((folder, &*job.output), (disk, &job.resources));
    let all = RunJob::until(to, job.overwrite, Form::default(), with);
    let plan = || plan_tiles(&PlanJob::all(job, folder, skipped)).map(drop);
    let report = plan::run_in::<Tiles>(&all, plan, At { progress, cancel })?;
    let mut tiles = Kind::Tiles.made(report.of.tiles)?;
    tiles.run.wall_seconds = report.wall_seconds;
    Ok(tiles)
}

impl Opened {
    fn new(job: &TilesJob) -> Result<Self> {
        if let Some(level) = job.tiles.max_level.filter(|level| *level > DEEPEST) {
            return Err(Error::usage(format!("level {level} is too deep"))
                .remedy(format!("choose {DEEPEST} at most")));
        }
        check_formats(&job.tiles)?;
        let options = job.reading.options(&job.resources, 0)?;
        let seen = memory::look_at(&job.input, &options)?;
        let (input, resources) = ((&job.input, job.tiles.geoid.as_deref()), &job.resources);
        let (chart, heights) = place::of(seen.info(), input, resources)?;
        let chart = chart.sloping(job.tiles.beyond.slope());
        let last = job.tiles.max_level.unwrap_or_else(|| deepest_for(chart.spacing()));
        let water = options.water.as_ref().filter(|_| job.tiles.water_mask);
        let mask = |water: &Arc<Water>| Mask::of(water, seen.info(), last, resources);
        let mask = water.map(mask).transpose()?;
        let division = Division::new(Place::of(&chart), last);
        let look = glance::plan(chart, &division);
        let [shared, each] = mask.as_ref().map_or([0; 2], |mask| mask.bytes(resources.threads));
        let held = memory::with_slack(look.bytes() + heights.lift.bytes() + shared);
        let worker = glance::worker_bytes(&look) + each;
        let (grid, shares) =
            memory::open_beside(held, &job.input, &options, &job.resources, worker)?;
        Ok(Self { job: job.clone(), grid, shares, heights, mask, division, look })
    }

    /// Reads heights in metres.
    fn read(&self, rect: Rect, heights: &mut Vec<f64>) -> Result<()> {
        heights.clear();
        heights.resize(rect.len(), 0.0);
        self.grid.read_f64(rect, heights)?;
        let width = rect.width as usize;
        self.heights.lift.lift(heights, |number| {
            let [col, row] = [number % width, number / width].map(|at| at as f64);
            let [first, top] = [rect.col, rect.row].map(f64::from);
            Ok(self.look.chart().place([first + col, top + row]))
        })
    }

    /// The files that are read.
    fn files(&self) -> Vec<PathBuf> {
        let Self { job, grid, .. } = self;
        let geoid = job.tiles.geoid.iter().map(PathBuf::from);
        plan::grid_files(&job.input, &job.reading, &**grid).into_iter().chain(geoid).collect()
    }

    /// What the grid is called.
    fn name(&self) -> PathBuf {
        PathBuf::from(self.job.input.to_string())
    }

    /// The grid from afar.
    ///
    /// # Errors
    /// One without a sample, or with absurd heights.
    fn seen(&self, gathered: Gathered) -> Result<Overview> {
        let refuse = |error: Error, remedy: &str| error.in_file(&self.name()).remedy(remedy);
        let overview = gathered.finish().ok_or_else(|| {
            let remedy = "check its nodata value, or choose another ‹band›";
            refuse(Error::bad_input("the grid has no valid sample"), remedy)
        })?;
        let [lowest, highest] = overview.range;
        let furthest = if lowest < -MOST_HEIGHT { lowest } else { highest };
        if furthest.abs() > MOST_HEIGHT {
            // As the sample is held, so that the digits are those of the file.
            let stored = (furthest / self.heights.lift.metres) as f32;
            let remedy = format!("if it stands for nodata, pass ‹nodata› {stored:e}");
            let error = Error::bad_input(format!("the height {stored:e} is absurd"));
            return Err(refuse(error, &remedy));
        }
        Ok(overview)
    }
}

impl<'a> Ground<'a> {
    fn new(opened: &'a Opened, overview: &'a Overview) -> Self {
        let reliefs = overview.reliefs(opened.division.last);
        let of_set = |format: &Format| levels(*format, opened, overview.ends(), &reliefs);
        let levels = opened.job.tiles.format.iter().map(of_set).collect();
        Self { opened, overview, levels }
    }

    /// The level of a tile, by set.
    fn of_level(&self, id: TileId) -> impl Iterator<Item = &Level> {
        self.levels.iter().map(move |levels| &levels[usize::from(id.level)])
    }

    /// The lowest height as it is stored, where it looks like a nodata value.
    fn suspect(&self) -> Option<f64> {
        let lowest = self.overview.range[0] / self.opened.heights.lift.metres;
        looks_like_nodata(lowest, self.opened.grid.info())
    }

    /// What is to be said of the heights.
    fn notes(&self) -> Vec<String> {
        let of_nodata = self.suspect().map(|stored| {
            format!("the lowest height, {stored:e}, looks like an undeclared nodata value")
        });
        let info = self.opened.grid.info();
        let metres = self.opened.heights.lift.metres;
        let [a, b] = self.overview.range.map(|height| height / metres);
        let odd = raster::no_terrain(info, [a.min(b), a.max(b)]).filter(|_| of_nodata.is_none());
        let of_grid = raster::cautions(info).into_iter().chain(odd);
        self.opened.heights.notes.iter().cloned().chain(of_nodata).chain(of_grid).collect()
    }

    fn make(&self, folder: &Folder, at: At<'_>) -> Result<()> {
        let Division { near, .. } = self.opened.division;
        self.each("near levels", &self.opened.division.regions().all(), at, |id| {
            self.region(id, &mut |made| folder.put(&made), at.cancel)
        })?;
        let mut known = folder.known();
        let there = known.clone();
        known.add_above(near);
        let mut above = self.opened.division.above(self.opened.division.far_end()).all();
        above.retain(|id| is_missing(*id, [&there, &known]));
        self.each("far levels", &above, at, |id| {
            self.far(id, &known, at.cancel)?.iter().try_for_each(|made| folder.put(made))
        })
    }

    /// Does something to each tile, on all threads.
    fn each(
        &self,
        stage: &str,
        tiles: &[TileId],
        at: At<'_>,
        work: impl Fn(TileId) -> Result<()> + Sync,
    ) -> Result<()> {
        at.progress.begin(stage, tiles.len() as u64);
        let one = |(): &mut (), i: u64| {
            work(tiles[i as usize])?;
            at.progress.advance(1);
            Ok(())
        };
        let (threads, count) = (self.opened.shares.threads, tiles.len() as u64);
        workers::run(threads, count, at.cancel, || (), one, Ok)?;
        at.progress.end();
        Ok(())
    }
}

/// Fails where no format is asked for, one twice, or what a format has not.
fn check_formats(tiles: &TileOptions) -> Result<()> {
    let is_twice = |i: usize| tiles.format[..i].contains(&tiles.format[i]);
    if tiles.format.is_empty() || (0..tiles.format.len()).any(is_twice) {
        return Err(Error::usage("a format of tiles is asked for twice, or none")
            .remedy("name each format once"));
    }
    check(tiles)
}

/// The levels of a set, of heights in a range.
fn levels(format: Format, opened: &Opened, range: [f64; 2], reliefs: &[Relief]) -> Vec<Level> {
    let Opened { job: TilesJob { tiles, .. }, division, .. } = opened;
    let mut levels: Vec<Level> = Vec::with_capacity(reliefs.len());
    for (number, relief) in (0..).zip(reliefs) {
        let level = Level::new(number, division.place.spacing, relief);
        levels.push(match format {
            Format::QuantizedMesh => level,
            Format::ThreeTiles => {
                let level = if tiles.skirts { level.with_skirts(levels.last()) } else { level };
                let level = level.on_lattice(range);
                if tiles.meshopt { in_shorts(level) } else { level }
            }
        });
    }
    levels
}

/// Whether a tile belongs to all that is known and is not there.
fn is_missing(id: TileId, [there, known]: [&spans::Known; 2]) -> bool {
    let holds = |known: &spans::Known| known.level(id.level).holds(id.x, id.y);
    holds(known) && !holds(there)
}
