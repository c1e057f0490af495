//! Makes tiles of a grid, in one run or by a plan.

use std::path::Path;
use std::time::Instant;

use super::available::is_missing;
use super::division::TilesDivision;
use super::folder::TilesetFolder;
use super::grid_levels::ScannedGrid;
use super::input::OpenedTilesGrid;
use super::job::{PlanJob, TilesJob, check_formats};
use super::options::{TileOptions, TilesOptions};
use super::report::{StatusReport, TilesReport, TilesRun, TilesStatus};
use super::scan;
use super::tasks::TilesPlan;
use terrane_base::error::Result;
use terrane_engine::operation::{Divisible, Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_engine::plan::{
    self, DiskCheck, OutputForm, PlanKind, PlanManifest, RunControl, RunJob,
};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::Skipped;
use terrane_engine::{Cancel, Progress, feature_files, workers};
use terrane_files::refuse_in_memory;
use terrane_globe::GlobeTileId;
use terrane_raster::Inputs;

impl Operation for TilesOptions {
    const NAME: &'static str = "tiles";
    type Input = GridInput;
    const WRITES: Writes = Writes::Tiles;
    type Report = TilesReport;

    fn check(&self, _output: &Path) -> Result<()> {
        check_formats(&self.tiles)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<TilesReport> {
        let RunRequest { inputs, output, skipped, progress, cancel, .. } = request;
        let job = self.job(inputs, output);
        match &self.resuming.workdir {
            None => run(&job, progress, cancel),
            Some(folder) => run_in(folder, &job, skipped, self.resuming.disk(), progress, cancel),
        }
    }
}

/// Makes tiles. The output appears only on success.
///
/// # Errors
/// A grid without a georeference, with a pole, or across 180 degrees; an existing output; read and write
/// errors.
pub fn run(job: &TilesJob, progress: &dyn Progress, cancel: &Cancel) -> Result<TilesReport> {
    let (started, at) = (Instant::now(), RunControl { progress, cancel });
    terrane_files::atomic::refuse_existing(&job.output, job.overwrite)?;
    let folder = TilesetFolder::create(job)?;
    let opened = OpenedTilesGrid::new(job)?;
    let (mut gathered, rows) = (opened.survey.clone().gather(), [0, opened.division.place.size[1]]);
    scan::scan(&opened, rows, at, |summary| {
        gathered.add(summary);
        Ok(())
    })?;
    let overview = opened.overview(gathered)?;
    let ground = ScannedGrid::new(&opened, &overview);
    ground.make(&folder, at)?;
    let made = folder.finish(&ground, cancel)?;
    let run = RunStatistics::since(started, &job.resources).with_threads(opened.shares.threads);
    Ok(TilesReport { run, ..made })
}

impl TilesOptions {
    fn job(&self, inputs: &Inputs, output: &Path) -> TilesJob {
        TilesJob {
            reading: self.grid.clone(),
            overwrite: self.replacing.overwrite,
            tiles: self.tiles.clone(),
            resources: self.resources.clone(),
            ..TilesJob::new(inputs.clone(), output)
        }
    }
}

impl Divisible for TilesOptions {
    const TASK_SIZE: &'static str = "Number of tiles in a task, each with its subtiles, about a million samples or \
        more [default: 128]";
    terrane_engine::planned_as!(TilesPlan, TilesStatus, TilesRun);

    fn plan(&self, request: RunRequest<'_>, task_size: Option<u32>) -> Result<StatusReport> {
        let RunRequest { inputs, output: folder, skipped, .. } = request;
        let job = self.job(inputs, &folder.join("tiles"));
        let (folder, skipped) = (folder.to_path_buf(), skipped.to_vec());
        plan_tiles(&PlanJob { job, folder, cut: task_size, skipped })
    }
}

/// Writes the plan: output, input, tasks and required resources.
///
/// # Errors
/// Errors of [`run`] that are detected before the work; `Usage` for a folder with another plan or other files.
pub fn plan_tiles(job: &PlanJob) -> Result<StatusReport> {
    let plan::PlanJob { job, folder, cut, skipped } = job;
    refuse_in_memory(job.input.names())?;
    let (input, reading) = (job.input.resolve()?, job.reading.absolute()?);
    let geoid = job.tiles.geoid.as_deref().map(feature_files::absolute).transpose()?;
    let tiles = TileOptions { geoid, ..job.tiles.clone() };
    let opened = OpenedTilesGrid::new(&TilesJob { input, reading, tiles, ..job.clone() })?;
    let tiles = TilesPlan::new(&opened, *cut)?;
    let files = opened.files();
    let there = PlanManifest::<TilesPlan>::existing(folder);
    let needs = there.map_or_else(|| tiles.needs(&opened), |plan| Ok(plan.needs))?;
    let label = opened.job.input.to_string();
    PlanManifest::new(tiles, (label, files), needs, skipped)?.put(folder)?;
    plan::status::<TilesPlan>(folder)
}

/// Plans and runs `job` in `folder`, which resumes after an interruption. `skipped` files are recorded in the
/// plan.
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
    let form = OutputForm::default();
    let all = RunJob::until(folder, &job.output, job.overwrite, form, disk, &job.resources);
    let report = plan::run_in::<TilesPlan>(
        &all,
        || plan_tiles(&PlanJob::all(job, folder, skipped)).map(drop),
        RunControl { progress, cancel },
    )?;
    let mut tiles = PlanKind::Tiles.made(report.of.tiles)?;
    tiles.run.wall_seconds = report.wall_seconds;
    Ok(tiles)
}

impl ScannedGrid<'_> {
    fn make(&self, folder: &TilesetFolder, at: RunControl<'_>) -> Result<()> {
        let TilesDivision { near, .. } = self.opened.division;
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

    /// Processes each tile, on all threads.
    fn each(
        &self,
        stage: &str,
        tiles: &[GlobeTileId],
        at: RunControl<'_>,
        work: impl Fn(GlobeTileId) -> Result<()> + Sync,
    ) -> Result<()> {
        at.progress.begin(stage, tiles.len() as u64);
        workers::run(
            self.opened.shares.threads,
            tiles.len() as u64,
            at.cancel,
            || (),
            |(), i| {
                work(tiles[i as usize])?;
                at.progress.advance(1);
                Ok(())
            },
            Ok,
        )?;
        at.progress.end();
        Ok(())
    }
}
