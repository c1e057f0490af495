//! Doing what the plan of a grid says: all of it, or one task.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::manifest::{Manifest, TaskId};
use super::tile::{Done, Opened, Place, Tiles};
use super::{GridRun, Written, written};
use crate::atomic::refuse_existing;
use crate::cloud::Census;
use crate::error::{Error, ErrorKind, Result};
use crate::gridding::Recipe;
use crate::pipeline::grid::budget::Budget;
use crate::pipeline::grid::make::{Bands, report};
use crate::pipeline::grid::{GridReport, GridStage};
use crate::pipeline::plan::{self, Digest};
use crate::pipeline::{Cancel, Progress, Resources, peak_memory};
use crate::raster::{self, write};

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
    /// What the work may use.
    pub resources: Resources,
}

/// Works on a plan: looks at every byte of what is done already, does what is not or is damaged, and
/// writes the grid. What is done stays done however the run ends. A named task that is done is left
/// alone.
///
/// The grid is the same as that of [`run`](crate::pipeline::grid::run) on the same request, byte for
/// byte, whoever did which task how often.
///
/// # Errors
/// Those of a cloud-to-grid job, and `BadInput` for an input or program that is not what the plan was
/// made with, `Resource` while others work in the folder and for a grid whose tiles are not done.
pub fn run_grid(job: &RunGridJob, progress: &dyn Progress, cancel: &Cancel) -> Result<GridRun> {
    let started = Instant::now();
    let task = job.task.as_deref().map(str::parse).transpose()?;
    let mut run = Run::new(job, task, progress, cancel)?;
    match task {
        None => run.all(),
        Some(TaskId::Finish) => run.finish(false),
        Some(task) => run.one(task),
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
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
    report: GridRun,
    _lock: File,
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
        let lock = plan::lock(folder, alone)?;
        plan::check(crate::pipeline::plan::Planned::files(&plan), alone)?;
        let mut resources = job.resources.clone();
        resources.temp_dir.get_or_insert_with(|| folder.to_path_buf());
        let format = write::by_name(&plan.method.format)?;
        let default = || folder.join("grid").with_extension(format.extensions[0]);
        let output = job.output.clone().unwrap_or_else(default);
        let grid = plan.job(output, job.overwrite, resources);
        let (points, extent) = plan.open(&grid)?;
        let report = GridRun {
            folder: folder.display().to_string(),
            plan_id: id.to_string(),
            tasks: plan.grid.count() + 1,
            ..GridRun::default()
        };
        let opened = Opened { job: grid, points, extent };
        Ok(Self { folder, plan, id, opened, progress, cancel, report, _lock: lock })
    }

    /// All that is not done.
    fn all(&mut self) -> Result<()> {
        if self.is_written()? {
            self.note_written();
            return Ok(());
        }
        self.claim_output()?;
        for task in self.plan.grid.tasks().filter(|task| *task != TaskId::Finish) {
            self.one(task)?;
        }
        self.finish(true)
    }

    /// One tile.
    fn one(&mut self, task: TaskId) -> Result<()> {
        let place = Place::new(self.folder, self.id, task);
        match place.look(true, self.cancel) {
            Ok(Some(done)) => {
                self.found(&done);
                return Ok(());
            }
            Ok(None) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => return Err(error),
            Err(_) => self.report.damaged.push(task.to_string()),
        }
        let done = self.opened.make(&self.plan, (task, &place), self.progress, self.cancel)?;
        self.report.made.push(task.to_string());
        self.report.made_bytes += done.bytes;
        self.report.points += done.read;
        self.report.spilled_bytes += done.spilled;
        Ok(())
    }

    fn found(&mut self, done: &Done) {
        self.report.found += 1;
        self.report.found_bytes += done.bytes;
    }

    /// The last task; what is done was counted before in a run of all.
    fn finish(&mut self, counted: bool) -> Result<()> {
        if self.is_written()? {
            self.note_written();
            return Ok(());
        }
        self.claim_output()?;
        let (mut files, mut census) = (Vec::new(), Census::default());
        for task in self.plan.grid.tasks().filter(|task| *task != TaskId::Finish) {
            let place = Place::new(self.folder, self.id, task);
            let done = place.look(false, self.cancel)?.ok_or_else(|| self.not_done(task))?;
            census.read += done.read;
            census.kept += done.kept;
            if !counted {
                self.found(&done);
            }
            files.push(place.file.display().to_string());
        }
        let path = plan::noted_path(&self.opened.job.output)?;
        let mut note = Written { plan_id: self.id, path, digest: None };
        plan::write_note(self.folder, &note)?;
        self.report.grid = Some(GridReport { points: census, ..self.write(&files)? });
        self.report.written = Some(self.opened.job.output.display().to_string());
        note.digest = Some(plan::digest_of(std::slice::from_ref(&note.path), self.cancel)?);
        plan::write_note(self.folder, &note)
    }

    /// Puts the tiles together.
    fn write(&self, files: &[String]) -> Result<GridReport> {
        let started = Instant::now();
        let Opened { job, extent, points } = &self.opened;
        let (format, info) = (job.format()?, extent.written(job));
        let recipe = Recipe::new(&job.stats, &job.rules(extent.cell()));
        let mut sink = format.create(&job.output, &info, &job.write_options())?;
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
        let valid = bands.write(sink.as_mut(), budget.threads, self.progress, self.cancel)?;
        self.cancel.check()?;
        let notes = [points.notes().to_vec(), extent.notes.clone(), sink.notes()].concat();
        Ok(GridReport {
            input: self.plan.method.label.clone(),
            files: points.files().len(),
            bands: bands.reports(&valid),
            notes,
            output_bytes: sink.finish()?,
            threads: budget.threads,
            stages: vec![GridStage::since("write", started)],
            wall_seconds: started.elapsed().as_secs_f64(),
            ..report(job, &info, extent)
        })
    }

    fn not_done(&self, task: TaskId) -> Error {
        Error::new(ErrorKind::Resource, format!("{task} is not done"))
            .in_file(self.folder)
            .remedy(format!("run it first: --task {task}"))
    }

    /// Whether the grid is where it belongs, as it was written.
    fn is_written(&self) -> Result<bool> {
        let path = plan::noted_path(&self.opened.job.output)?;
        let Some(note) = written(self.folder, self.id).filter(|note| note.path == path) else {
            return Ok(false);
        };
        match plan::digest_of(&[path], self.cancel) {
            Err(error) if error.kind() == ErrorKind::Interrupted => Err(error),
            // What cannot be read is not what was written.
            found => Ok(found.is_ok_and(|digest| Some(digest) == note.digest)),
        }
    }

    /// Nothing was left to do.
    fn note_written(&mut self) {
        self.report.found = self.report.tasks;
        self.report.written = Some(self.opened.job.output.display().to_string());
    }

    /// Fails when something is where the grid belongs, unless a run that did not come to its end was
    /// writing there.
    fn claim_output(&mut self) -> Result<()> {
        let path = plan::noted_path(&self.opened.job.output)?;
        let is_own =
            |note: &Written| (note.plan_id, &note.path, note.digest) == (self.id, &path, None);
        let began: Option<Written> = plan::note(self.folder).filter(is_own);
        self.opened.job.overwrite |= began.is_some();
        let output = &self.opened.job.output;
        refuse_existing(output, self.opened.job.overwrite)?;
        plan::refuse_own(self.folder, &self.plan, output)
    }
}
