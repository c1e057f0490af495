//! The plan of tiles: settings, input, and tasks.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::artifact::{TileArtifactWriter, add_known, add_summaries, each_tile};
use super::available::{KnownTiles, is_missing};
use super::division::{TileNumbering, TilesDivision, TilesTask};
use super::folder::{TileFile, TilesetFolder};
use super::georeference::GridFootprint;
use super::grid_levels::ScannedGrid;
use super::input::{OpenedTilesGrid, worker_bytes};
use super::job::TilesJob;
use super::report::{TilesReport, TilesRun, TilesStatus};
use super::{probe, scan};
use terrane_options::Choice;

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;
use terrane_engine::feature_files;
use terrane_engine::memory::{self, with_slack};
use terrane_engine::plan::{
    self, MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest, PlanNeeds,
    PlanStep, PlannedGrid, PlannedWork, RunControl, StatusReport, TaskStates,
};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::workers;
use terrane_globe::{GlobeTileId, GridOverview};

/// Default number of tiles per task: regions with about 134 million samples.
const CUT: u32 = 128;
/// Largest number of tiles per task.
const MAX_CUT: u32 = 1 << 16;
/// Nanoseconds of one thread per sample to make and to write its tiles, as measured on one machine; see
/// benches/history/2026.md, 27.
const SAMPLE: [f64; 2] = [650.0, 60.0];

/// Tiles of a grid.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct TilesPlan {
    method: PlannedTilesJob,
    grid: PlannedGrid,
}

/// Settings.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct PlannedTilesJob {
    #[serde(flatten)]
    job: TilesJob,
    /// Georeference of the grid.
    place: GridFootprint,
    /// Maximum level.
    last: u8,
    /// Tiles per task.
    cut: u32,
}

/// Summary of an object.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TileArtifactSummary {
    tiles: u64,
}

/// The opened input and job.
pub(super) struct PreparedTiles {
    opened: OpenedTilesGrid,
    /// After the first pass.
    overview: OnceLock<GridOverview>,
}

impl TilesPlan {
    /// Those of an opened job.
    pub(super) fn new(opened: &OpenedTilesGrid, cut: Option<u32>) -> Result<Self> {
        let TilesDivision { place, last, .. } = opened.division.clone();
        let job = TilesJob { input: feature_files::noted(&opened.job.input), ..opened.job.clone() };
        let method = PlannedTilesJob { job, place, last, cut: cut.unwrap_or(CUT) };
        let tiles = Self { method, grid: PlannedGrid::of(opened.grid.info()) };
        tiles.check().map(|()| tiles)
    }

    /// Required resources.
    pub(super) fn needs(&self, opened: &OpenedTilesGrid) -> Result<PlanNeeds> {
        let samples = self.grid.samples() as f64;
        let [bytes, output] = probe::expect(opened)?;
        let [shared, each] = opened.mask.as_ref().map_or([0; 2], |mask| mask.bytes(1));
        let worker = worker_bytes(&opened.survey) + each;
        let fixed_bytes = with_slack(opened.survey.bytes() + shared) + worker;
        Ok(PlanNeeds {
            memory: memory::least(fixed_bytes, opened.grid.block_bytes()),
            thread_memory: worker,
            objects: scan::written_bytes(opened) + bytes,
            output,
            seconds: SAMPLE.map(|nanoseconds| samples * nanoseconds * 1e-9),
        })
    }

    fn division(&self) -> TilesDivision {
        TilesDivision::new(self.method.place.clone(), self.method.last)
    }

    /// Tasks of each kind.
    fn counts(&self) -> [u32; 3] {
        self.division().counts(self.method.cut)
    }

    /// Tiles of a task among all possible tiles.
    fn tiles_of(&self, task: u32, all: &TileNumbering) -> Vec<GlobeTileId> {
        let [task, cut] = [task, self.method.cut].map(u64::from);
        all.slice(task * cut..(task + 1) * cut)
    }
}

impl PreparedTiles {
    /// The grid with its overview, gathered from the survey tasks on first use.
    fn ground(&self, states: &TaskStates<'_, TilesPlan>) -> Result<ScannedGrid<'_>> {
        if self.overview.get().is_none() {
            let mut gathered = self.opened.survey.clone().gather();
            for task in surveys(states.folder.plan.work.counts()) {
                add_summaries(&states.object(task)?.0, &mut gathered)?;
            }
            let overview = self.opened.overview(gathered)?;
            let _is_first = self.overview.set(overview);
        }
        let overview = self
            .overview
            .get()
            .ok_or_else(|| Error::new(ErrorKind::Internal, "the survey of the grid is lost"))?;
        Ok(ScannedGrid::new(&self.opened, overview))
    }

    /// Makes tiles on all threads, and writes them to an object.
    fn tiles(
        &self,
        stage: &str,
        object: &Path,
        ids: &[GlobeTileId],
        at: RunControl<'_>,
        make: impl Fn(&GlobeTileId) -> Result<Vec<TileFile>> + Sync,
    ) -> Result<u64> {
        let mut writer = TileArtifactWriter::create(object)?;
        at.progress.begin(stage, ids.len() as u64);
        workers::in_order(
            self.opened.shares.threads,
            ids.len() as u64,
            at.cancel,
            || (),
            |(), i| {
                let made = make(&ids[i as usize])?;
                at.progress.advance(1);
                Ok(made)
            },
            |made| made.iter().try_for_each(|made| writer.tile(made)),
        )?;
        at.progress.end();
        let count = writer.index()?;
        writer.finish().map(|()| count)
    }
}

fn surveys([count, ..]: [u32; 3]) -> impl Iterator<Item = TilesTask> {
    (0..count).map(TilesTask::Survey)
}

fn nears([_, count, _]: [u32; 3]) -> impl Iterator<Item = TilesTask> {
    (0..count).map(TilesTask::Near)
}

impl PlannedWork for TilesPlan {
    const KIND: PlanKind = PlanKind::Tiles;
    const NAMES: &'static [Numbered<TilesTask>] = &TilesTask::NAMES;

    type Task = TilesTask;
    type Facts = TileArtifactSummary;
    type Run = TilesRun;
    type Note = TilesReport;
    type Status = TilesStatus;
    type Opened = PreparedTiles;

    fn check(&self) -> Result<()> {
        let PlannedGrid { width, height, .. } = self.grid;
        limits::check("columns or rows", width.max(height).into(), limits::MAX_SIDE)?;
        if !(1..=MAX_CUT).contains(&self.method.cut) {
            return Err(Error::usage(format!("task size {} is out of range", self.method.cut))
                .remedy(format!("pass 1 to {MAX_CUT}")));
        }
        let tasks = self.counts().into_iter().map(u64::from).sum();
        limits::check("number of tasks", tasks, plan::MAX_TASKS)
    }

    fn tasks(&self) -> Vec<TilesTask> {
        let counts = self.counts();
        let far = (0..counts[2]).map(TilesTask::Far);
        surveys(counts).chain(nears(counts)).chain(far).collect()
    }

    fn before(&self, task: TilesTask) -> Vec<TilesTask> {
        let counts = self.counts();
        match task {
            TilesTask::Survey(_) => Vec::new(),
            TilesTask::Near(_) => surveys(counts).collect(),
            TilesTask::Far(_) => surveys(counts).chain(nears(counts)).collect(),
        }
    }

    fn size(&self, task: PlanStep<TilesTask>) -> u64 {
        let division = self.division();
        let width = u64::from(self.grid.width);
        match task {
            PlanStep::Task(TilesTask::Survey(number)) => {
                let [first, end] = division.rows(number);
                u64::from(end - first) * width
            }
            PlanStep::Task(TilesTask::Near(near)) => {
                let regions = self.tiles_of(near, &division.regions());
                regions.iter().map(|id| division.samples(&id.bounds())).sum()
            }
            // Most of the work is on blocks of samples.
            PlanStep::Task(TilesTask::Far(far)) => {
                self.tiles_of(far, &division.above(division.far_end())).len() as u64 * 4096
            }
            PlanStep::Finish => self.grid.samples(),
        }
    }

    fn status(&self) -> StatusReport<TilesStatus> {
        StatusReport {
            format: self
                .method
                .job
                .tiles
                .format
                .iter()
                .map(|f| f.name())
                .collect::<Vec<_>>()
                .join(", "),
            of: TilesStatus { max_level: self.method.last, samples: self.grid.samples() },
            ..StatusReport::default()
        }
    }

    fn output(&self, _: &OutputForm) -> Result<PathBuf> {
        Ok(PathBuf::from("tiles"))
    }

    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<PreparedTiles> {
        let OutputRequest { output, overwrite, resources, .. } = order;
        let Self { method, grid } = &plan.work;
        let mut job = TilesJob { output, overwrite, resources, ..method.job.clone() };
        job.tiles.max_level = Some(method.last);
        job.input = job.input.called(plan.label.clone());
        let opened = OpenedTilesGrid::new(&job)?;
        grid.check(plan, &*opened.grid, opened.files())?;
        Ok(PreparedTiles { opened, overview: OnceLock::new() })
    }

    fn check_output(ready: &PreparedTiles, _: RunControl<'_>) -> Result<()> {
        TilesetFolder::create(&ready.opened.job).map(drop)
    }

    fn make(
        ready: &PreparedTiles,
        (task, object): (TilesTask, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut TilesRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<TileArtifactSummary>> {
        let (work, opened) = (&states.folder.plan.work, &ready.opened);
        let tiles = match task {
            TilesTask::Survey(number) => {
                let mut writer = TileArtifactWriter::create(object)?;
                let mut bytes = Vec::new();
                scan::scan(opened, opened.division.rows(number), at, |summary| {
                    bytes.clear();
                    summary.write(&mut bytes);
                    writer.put(&bytes)
                })?;
                writer.finish()?;
                0
            }
            TilesTask::Near(number) => {
                let ground = ready.ground(states)?;
                let regions = work.tiles_of(number, &opened.division.regions());
                ready.tiles("near levels", object, &regions, at, |id| {
                    let mut made = Vec::new();
                    let mut put = |tile| {
                        made.push(tile);
                        Ok(())
                    };
                    ground.region(*id, &mut put, at.cancel).map(|()| made)
                })?
            }
            TilesTask::Far(number) => {
                let ground = ready.ground(states)?;
                let mut there = KnownTiles::default();
                for near in nears(work.counts()) {
                    add_known(&states.object(near)?.0, &mut there)?;
                }
                let mut known = there.clone();
                known.add_above(opened.division.near);
                let far_end = opened.division.far_end();
                let mut ids = work.tiles_of(number, &opened.division.above(far_end));
                ids.retain(|id| is_missing(*id, [&there, &known]));
                ready.tiles("far levels", object, &ids, at, |id| {
                    ground.far(*id, &known, at.cancel)
                })?
            }
        };
        run.made_tiles += tiles;
        Ok(MadeArtifact { facts: TileArtifactSummary { tiles }, digest: None, spilled: 0 })
    }

    fn write(
        ready: &PreparedTiles,
        states: &TaskStates<'_, Self>,
        run: &mut TilesRun,
        at: RunControl<'_>,
    ) -> Result<TilesReport> {
        let (started, opened) = (Instant::now(), &ready.opened);
        let (ground, folder) = (ready.ground(states)?, TilesetFolder::create(&opened.job)?);
        let tasks = states.done.keys().copied();
        let tasks: Vec<_> = tasks.filter(|task| !matches!(task, TilesTask::Survey(_))).collect();
        at.progress.begin("write", states.done.values().map(|done| done.facts.tiles).sum());
        workers::run(
            opened.shares.threads,
            tasks.len() as u64,
            at.cancel,
            || (),
            |(), i| {
                each_tile(&states.object(tasks[i as usize])?.0, |made| {
                    at.cancel.check()?;
                    folder.put(&made)?;
                    at.progress.advance(1);
                    Ok(())
                })
            },
            Ok,
        )?;
        at.progress.end();
        let made = folder.finish(&ground, at.cancel)?;
        let statistics = RunStatistics::since(started, &opened.job.resources);
        let report = TilesReport { run: statistics.with_threads(opened.shares.threads), ..made };
        run.tiles = Some(report.clone());
        Ok(report)
    }

    fn written(note: TilesReport, output: &Path, run: &mut TilesRun) {
        run.tiles = Some(TilesReport { output: output.display().to_string(), ..note });
    }
}
