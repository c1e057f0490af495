//! Doing what the plan of a grid says: all of it, or one task.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::Value;

use super::GridRun;
use super::manifest::{Manifest, TaskId};
use super::tile::{Opened, Place, Survey, Tiles};
use crate::grid::budget::Budget;
use crate::grid::extent::Extent;
use crate::grid::make::{Bands, report};
use crate::grid::{GridJob, GridReport, GridStage};
use crate::plan::{self, Digest, DiskCheck, Look, Output, Planned, State};
use crate::{Cancel, Progress, Resources, peak_memory};
use terrane_base::error::{Error, Result};
use terrane_cloud::Census;
use terrane_files::name_of;
use terrane_gridding::Recipe;
use terrane_raster as raster;
use terrane_raster::write::{self, GridSink};

/// Work on the plan of a grid.
#[derive(Clone, Debug)]
pub struct RunGridJob {
    /// The folder of the plan.
    pub folder: PathBuf,
    /// One task by name; all that is not done when `None`.
    pub task: Option<String>,
    /// The file of the grid; `grid` with the format's ending in the folder when `None`.
    pub output: Option<PathBuf>,
    /// Replace an existing file.
    pub overwrite: bool,
    /// Whether to begin where the disk seems to have too little room.
    pub disk: DiskCheck,
    /// What the work may use.
    pub resources: Resources,
}

/// Works on a plan: looks at every byte of what is done already, does what is not or is damaged, and
/// writes the grid. What is done stays done however the run ends. A named task that is done is left
/// alone; the last one makes damaged tiles anew.
///
/// The grid is the same as that of [`run`](crate::grid::run) on the same request, byte for
/// byte, whoever did which task how often.
///
/// # Errors
/// Those of a cloud-to-grid job, and `BadInput` for an input or program that is not what the plan was
/// made with, `NotYet` while another does all that is left and for a grid whose tiles are not done,
/// `CannotWrite` when the disk has too little room.
pub fn run_grid(job: &RunGridJob, progress: &dyn Progress, cancel: &Cancel) -> Result<GridRun> {
    let started = Instant::now();
    let task = job.task.as_deref().map(str::parse).transpose()?;
    let mut run = Run::new(job, task, progress, cancel)?;
    match task {
        None => run.all(),
        Some(TaskId::Finish) => run.finish(),
        Some(TaskId::Tile(tile)) => run.one(tile),
    }
    .map_err(plan::kept)?;
    run.report.wall_seconds = started.elapsed().as_secs_f64();
    run.report.peak_memory = peak_memory();
    Ok(run.report)
}

/// A run in progress.
struct Run<'a> {
    folder: &'a Path,
    plan: Manifest,
    id: Digest,
    opened: Opened,
    output: Output,
    disk: DiskCheck,
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
    report: GridRun,
    _lock: Option<File>,
}

impl<'a> Run<'a> {
    fn new(
        job: &'a RunGridJob,
        task: Option<TaskId>,
        progress: &'a dyn Progress,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let folder = job.folder.as_path();
        let (plan, id) = plan::read::<Manifest>(folder)?;
        if let Some(task) = task.filter(|task| !plan.grid.has(*task)) {
            return Err(Error::usage(format!("the plan has no task {task}"))
                .in_file(folder)
                .remedy("see terrane status"));
        }
        let alone = task.is_none();
        let lock = plan::enter(folder, alone)?;
        plan::check(plan.files(), alone)?;
        let mut resources = job.resources.clone();
        resources.temp_dir.get_or_insert_with(|| folder.to_path_buf());
        let format = write::by_name(&plan.method.format)?;
        let default = || folder.join("grid").with_extension(format.extensions[0]);
        let path = job.output.clone().unwrap_or_else(default);
        let output = Output::new(folder, id, &path, Value::Null)?;
        let grid = plan.job(path, job.overwrite, resources);
        let (points, extent) = plan.open(&grid)?;
        let report = GridRun {
            folder: folder.display().to_string(),
            plan_id: id.to_string(),
            tasks: plan.grid.count() + 1,
            skipped: plan.skipped.clone(),
            ..GridRun::default()
        };
        let (opened, disk) = (Opened { job: grid, points, extent }, job.disk);
        Ok(Self { folder, plan, id, opened, output, disk, progress, cancel, report, _lock: lock })
    }

    /// All that is not done.
    fn all(&mut self) -> Result<()> {
        let is_written = self.is_written()?;
        self.progress.begin("check what is done", self.plan.grid.count());
        let mut survey = self.survey()?;
        self.progress.end();
        let left: Vec<u32> =
            self.plan.grid.tiles().filter(|tile| !survey.done.contains_key(tile)).collect();
        self.check_disk(&left, is_written)?;
        for tile in left {
            self.make(tile, &mut survey)?;
        }
        self.end(&survey, is_written)
    }

    /// One tile.
    fn one(&mut self, tile: u32) -> Result<()> {
        let mut survey = Survey::default();
        match self.place(tile).look(Look::Whole, self.cancel) {
            Ok(Some(done)) => drop(survey.done.insert(tile, done)),
            Ok(None) => {}
            Err(error) => {
                self.cancel.check().map_err(|_| error)?;
                survey.damaged.push(tile);
            }
        }
        if survey.done.is_empty() {
            self.check_disk(&[tile], true)?;
            self.make(tile, &mut survey)?;
        }
        self.note_found(&survey);
        Ok(())
    }

    /// The last task.
    fn finish(&mut self) -> Result<()> {
        if self.is_written()? {
            return self.end(&Survey::default(), true);
        }
        let mut survey = self.survey()?;
        if let Some(missing) = survey.missing(&self.plan.grid) {
            return Err(plan::not_done(self.folder, missing));
        }
        self.check_disk(&survey.damaged, false)?;
        for tile in survey.damaged.clone() {
            self.make(tile, &mut survey)?;
        }
        self.end(&survey, false)
    }

    /// Looks at every byte of what is done.
    fn survey(&self) -> Result<Survey> {
        let of = (self.folder, self.id);
        Survey::of(of, &self.plan.grid, Look::Whole, self.progress, self.cancel)
    }

    fn place(&self, tile: u32) -> Place {
        Place::new(self.folder, self.id, TaskId::Tile(tile))
    }

    /// Makes a tile.
    fn make(&mut self, tile: u32, survey: &mut Survey) -> Result<()> {
        let (task, place) = (TaskId::Tile(tile), self.place(tile));
        if survey.damaged.contains(&tile) {
            self.report.damaged.push(task.to_string());
        }
        let cells = self.plan.grid.cells(task);
        let done = self.opened.make((cells, &place), self.progress, self.cancel)?;
        self.report.made.push(task.to_string());
        self.report.made_bytes += done.bytes;
        self.report.points += done.read;
        self.report.spilled_bytes += done.spilled;
        survey.done.insert(tile, done);
        Ok(())
    }

    /// Fails when the disks will not hold these tiles and, unless it is written, the grid.
    fn check_disk(&self, tiles: &[u32], is_written: bool) -> Result<()> {
        let Manifest { grid, needs, .. } = &self.plan;
        let cells: usize = tiles.iter().map(|tile| grid.cells(TaskId::Tile(*tile)).len()).sum();
        let share = cells as f64 / grid.cells(TaskId::Finish).len() as f64;
        let objects = (needs.tile_bytes as f64 * share) as u64;
        let written = if is_written { 0 } else { needs.output_bytes };
        self.disk.check(self.folder, &self.opened.job.output, [objects, written])
    }

    fn note_found(&mut self, survey: &Survey) {
        let bytes: u64 = survey.done.values().map(|done| done.bytes).sum();
        self.report.found = (survey.done.len() - self.report.made.len()) as u64;
        self.report.found_bytes = bytes - self.report.made_bytes;
    }

    /// Writes the grid from all tiles, unless it is there.
    fn end(&mut self, survey: &Survey, is_written: bool) -> Result<()> {
        self.note_found(survey);
        self.report.written = Some(self.opened.job.output.display().to_string());
        if is_written {
            return Ok(());
        }
        self.output.begin()?;
        let mut census = Census::default();
        for done in survey.done.values() {
            census.read += done.read;
            census.kept += done.kept;
        }
        let file = |tile: &u32| name_of(self.place(*tile).file);
        let files = survey.done.keys().map(file).collect::<Result<Vec<_>>>()?;
        let Opened { job, extent, .. } = &self.opened;
        let made = self.opened.write(&files, job, extent, (self.progress, self.cancel))?;
        self.report.grid =
            Some(GridReport { points: census, input: self.plan.method.label.clone(), ..made });
        self.output.finish((), self.cancel)
    }

    /// Whether the grid is where it belongs, as it was written. Fails when something else is there that
    /// may not be replaced.
    fn is_written(&mut self) -> Result<bool> {
        let state = self.output.state::<()>(Look::Whole, self.cancel)?;
        if matches!(state, State::Whole(())) {
            return Ok(true);
        }
        let job = &mut self.opened.job;
        job.overwrite = self.output.claim(&state, job.overwrite)?;
        plan::refuse_own(self.folder, &self.plan, &job.output)?;
        self.opened.sink(&self.opened.job, &self.opened.extent).map(drop)?;
        Ok(false)
    }
}

impl Opened {
    /// What receives the grid of `job`, whose cells are those of `extent`; fails where it cannot be
    /// written.
    fn sink(&self, job: &GridJob, extent: &Extent) -> Result<Box<dyn GridSink>> {
        job.format()?.create(&job.output, &extent.written(job), &job.write_options())
    }

    /// Puts the tiles in `files` together to the output of `job`, whose cells are those of `extent`.
    pub(super) fn write(
        &self,
        files: &[String],
        job: &GridJob,
        extent: &Extent,
        (progress, cancel): (&dyn Progress, &Cancel),
    ) -> Result<GridReport> {
        let started = Instant::now();
        let (format, info) = (job.format()?, extent.written(job));
        let recipe = Recipe::new(&job.stats, &job.rules(extent.cell()));
        let mut sink = self.sink(job, extent)?;
        let budget = Budget::writing(&job.resources, format, sink.as_ref(), extent, &recipe)?;
        let bands = u32::try_from(job.stats.len()).unwrap_or(u32::MAX);
        let options = |band: u32| raster::OpenOptions {
            band,
            cache_bytes: (budget.blocks / u64::from(bands)) as usize,
            threads: budget.threads,
            temp_dir: job.resources.temp_dir.clone(),
            ..raster::OpenOptions::default()
        };
        let open = |band: u32| raster::open_all(files, &options(band));
        let tiles = Tiles { bands: (1..=bands).map(open).collect::<Result<_>>()? };
        let bands = Bands { cells: &tiles, bands: recipe.bands(), info: &info };
        let valid = bands.write(sink.as_mut(), budget.threads, progress, cancel)?;
        cancel.check()?;
        let notes = [self.points.notes().to_vec(), extent.notes.clone(), sink.notes()].concat();
        Ok(GridReport {
            files: self.points.files().len(),
            bands: bands.reports(&valid),
            notes,
            output_bytes: sink.finish()?,
            threads: budget.threads,
            stages: vec![GridStage::since("write", started)],
            wall_seconds: started.elapsed().as_secs_f64(),
            ..report(job, &info, extent)
        })
    }
}
