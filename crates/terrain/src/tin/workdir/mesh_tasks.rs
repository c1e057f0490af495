//! The plan of a mesh: its job, the properties of its input, its tasks, and the work of a task.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::artifact_store::ArtifactCache;
use super::report::{MeshRun, MeshStatus};
use super::tasks::{StripTask, TileStrips};
use crate::tin::artifact::{ArtifactWriter, TinArtifactFacts, object_bytes};
use crate::tin::cost::{nanoseconds, seconds};
use crate::tin::counters::SampleCounts;
use crate::tin::estimate::MeshSize;
use crate::tin::goal::TinGoal;
use crate::tin::job::TinJob;
use crate::tin::layout::TileLayout;
use crate::tin::make::{OpenedTinJob, TinMaker, in_input};
use crate::tin::report::TinReport;
use crate::tin::run::{save, write};
use crate::tin::worker::ContainerSource;
use terrane_base::error::Result;
use terrane_base::limits;
use terrane_engine::outputs::refuse_other_name;
use terrane_engine::plan::{
    self, CheckDepth, MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest,
    PlanNeeds, PlanStep, PlannedGrid, PlannedWork, RunControl, StatusReport, TaskStates,
};
use terrane_engine::transform::TargetCrs;
use terrane_engine::{feature_files, memory};
use terrane_mesh::{self as mesh, MeshFormat};
use terrane_raster::GridSource;
use terrane_tin::{TilePosition, TileTriangle};

/// Share of the time that the writing of the mesh takes, about.
const WRITING: f64 = 0.1;

/// A mesh to make of a grid.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PlannedMesh {
    method: PlannedTinJob,
    grid: PlannedGrid,
}

/// The job.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct PlannedTinJob {
    #[serde(flatten)]
    job: TinJob,
    strip_rows: u32,
    height_origin: Option<f64>,
}

impl PlannedMesh {
    /// The plan of an opened job, with strips of `rows` rows of tiles.
    pub(super) fn new(job: &TinJob, opened: &OpenedTinJob, rows: Option<u32>) -> Result<Self> {
        let grid = PlannedGrid::of(opened.source.info());
        let strip_rows =
            TileStrips::new(TileLayout::new(grid.width, grid.height, job.tile)?, rows).rows();
        let (format, input) =
            (Some(opened.format.name.to_owned()), feature_files::noted(&job.input));
        let job = TinJob { format, input, ..job.clone() };
        let mesh = Self {
            method: PlannedTinJob { job, strip_rows, height_origin: opened.height_origin },
            grid,
        };
        mesh.check().map(|()| mesh)
    }

    /// The job that writes the mesh.
    fn job(&self, order: OutputRequest) -> TinJob {
        let OutputRequest { output, overwrite, form: OutputForm { split, solid_base }, resources } =
            order;
        let job = self.method.job.clone();
        TinJob { output, overwrite, split, solid_base, measure: true, resources, ..job }
    }

    fn format(&self) -> Result<&'static MeshFormat> {
        mesh::by_path(Path::new(""), self.method.job.format.as_deref())
    }

    /// The strips of the grid. Fails if it is too small.
    fn strips(&self) -> Result<TileStrips> {
        let layout = TileLayout::new(self.grid.width, self.grid.height, self.method.job.tile)?;
        Ok(TileStrips::new(layout, Some(self.method.strip_rows)))
    }

    fn tolerance(&self) -> f64 {
        match self.method.job.goal {
            TinGoal::MaxError(tolerance) => tolerance,
            _ => f64::NAN,
        }
    }

    /// Resources of the work, from the size of the whole mesh.
    pub(super) fn needs(&self, size: MeshSize, opened: &OpenedTinJob) -> Result<PlanNeeds> {
        let strips = self.strips()?;
        let job = &self.method.job;
        let has_lines = !opened.constraints.lines().paths().is_empty();
        let worker = job.refinement.worker_bytes(job.goal, strips.layout().side(), has_lines);
        let thread_memory = worker + opened.constraints.bytes();
        let transform_memory = job.transform.as_ref().map_or(0, TargetCrs::least_memory);
        let mesh_bytes = size.triangles * size_of::<TileTriangle>() as u64
            + size.vertices * (size_of::<TilePosition>() + size_of::<f64>()) as u64;
        let samples = self.grid.samples();
        let objects = strips.tasks().map(|task| {
            let work = strips.work(task);
            let share = work.samples() as f64 / samples as f64;
            object_bytes((mesh_bytes as f64 * share) as u64, work.tiles())
        });
        let total_seconds = seconds(samples, nanoseconds(size.vertices as f64 / samples as f64), 1);
        Ok(PlanNeeds {
            memory: memory::least(thread_memory, opened.source.block_bytes()).max(transform_memory),
            thread_memory,
            objects: objects.sum(),
            output: (opened.format.capacity)().file_bytes(size.vertices, size.triangles),
            seconds: [total_seconds * (1.0 - WRITING), total_seconds * WRITING],
        })
    }
}

/// The input and the job, opened.
pub(super) struct OpenedPlannedTin {
    tin: TinJob,
    opened: OpenedTinJob,
    tolerance: f64,
}

impl OpenedPlannedTin {
    fn maker<'a>(&'a self, at: RunControl<'a>) -> TinMaker<'a> {
        TinMaker { job: &self.tin, opened: &self.opened, progress: at.progress, cancel: at.cancel }
    }

    fn temp_dir(&self) -> &Path {
        self.tin.resources.temp_dir.as_deref().unwrap_or(Path::new("."))
    }
}

impl PlannedWork for PlannedMesh {
    const KIND: PlanKind = PlanKind::Tin;
    const NAMES: &'static [Numbered<StripTask>] = &StripTask::NAMES;
    /// Tiles are under digests of their own.
    const LAST_LOOK: CheckDepth = CheckDepth::Quick;
    const STAGE: Option<&'static str> = Some("triangulate");

    type Task = StripTask;
    type Facts = TinArtifactFacts;
    type Run = MeshRun;
    type Note = TinReport;
    type Status = MeshStatus;
    type Opened = OpenedPlannedTin;

    fn check(&self) -> Result<()> {
        self.method.job.goal.check()?;
        let PlannedGrid { width, height, .. } = self.grid;
        limits::check("number of columns or rows", width.max(height).into(), limits::MAX_SIDE)?;
        let tasks = 2 * u64::from(self.strips()?.count());
        limits::check("number of tasks", tasks, plan::MAX_TASKS)
    }

    fn tasks(&self) -> Vec<StripTask> {
        self.strips().map_or_else(|_| Vec::new(), |strips| strips.tasks().collect())
    }

    fn before(&self, task: StripTask) -> Vec<StripTask> {
        task.before()
    }

    fn size(&self, task: PlanStep<StripTask>) -> u64 {
        match task {
            PlanStep::Task(task) => self.strips().map_or(0, |strips| strips.work(task).samples()),
            PlanStep::Finish => self.grid.samples(),
        }
    }

    fn status(&self) -> StatusReport<MeshStatus> {
        StatusReport {
            format: self.method.job.format.clone().unwrap_or_default(),
            tile_cells: self.strips().map_or(0, |strips| strips.layout().side()),
            of: MeshStatus { max_error: self.tolerance(), samples: self.grid.samples() },
            ..StatusReport::default()
        }
    }

    fn check_name(&self, output: &Path, form: &OutputForm) -> Result<()> {
        if form.split.is_some() { Ok(()) } else { refuse_other_name(self.format()?, output) }
    }

    fn output(&self, form: &OutputForm) -> Result<PathBuf> {
        let format = self.format()?;
        let ending = if form.split.is_some() { "blocks" } else { format.extensions[0] };
        Ok(Path::new("mesh").with_extension(ending))
    }

    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<OpenedPlannedTin> {
        let mut tin = plan.work.job(order);
        tin.input = tin.input.called(plan.label.clone());
        let mut opened = OpenedTinJob::new(&tin)?;
        opened.height_origin = plan.work.method.height_origin;
        let Self { method, grid } = &plan.work;
        let all = files(&method.job, &*opened.source);
        grid.check(plan, &*opened.source, all)?;
        Ok(OpenedPlannedTin { tin, opened, tolerance: plan.work.tolerance() })
    }

    fn check_output(ready: &OpenedPlannedTin, at: RunControl<'_>) -> Result<()> {
        ready.maker(at).check_output()
    }

    fn make(
        ready: &OpenedPlannedTin,
        (task, object): (StripTask, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut MeshRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<TinArtifactFacts>> {
        let (strips, maker) = (states.folder.plan.work.strips()?, ready.maker(at));
        let work = strips.work(task);
        let cache = ArtifactCache::new(states, strips, TileStrips::first_of);
        let finished = work.loads().then_some(&cache as &dyn ContainerSource);
        let settings = maker.settings(maker.spec(ready.tolerance), ready.temp_dir());
        let object = ArtifactWriter::create(object)?;
        let saved = save(&*ready.opened.source, work.scope, finished, object, &settings)
            .map_err(|error| in_input(error, &ready.tin.input))?;
        if let StripTask::Strip(_) = task {
            run.made_samples += work.samples();
        }
        run.add(saved.clock.report());
        let (facts, digest) = saved.object.finish(saved.tally)?;
        Ok(MadeArtifact { facts, digest: Some(digest), spilled: saved.spilled_bytes })
    }

    fn write(
        ready: &OpenedPlannedTin,
        states: &TaskStates<'_, Self>,
        run: &mut MeshRun,
        at: RunControl<'_>,
    ) -> Result<TinReport> {
        let (started, maker) = (Instant::now(), ready.maker(at));
        let mut tally = SampleCounts::default();
        states.done.values().for_each(|done| tally.add(done.facts.tally));
        let cache =
            ArtifactCache::new(states, states.folder.plan.work.strips()?, TileStrips::last_of);
        at.progress.begin("write", states.folder.plan.work.grid.samples());
        let mut report = maker
            .complete(ready.tolerance, 0, |sink, spec| {
                let settings = maker.settings(spec, ready.temp_dir());
                write(&*ready.opened.source, &cache, tally, sink, &settings)
            })
            .map_err(|error| in_input(error, &ready.tin.input))?;
        at.progress.end();
        report.took(started.elapsed());
        run.mesh = Some(report.clone());
        Ok(report)
    }

    fn written(note: TinReport, output: &Path, run: &mut MeshRun) {
        run.mesh = Some(TinReport { output: output.display().to_string(), ..note });
    }
}

/// The files that `job` reads: those behind its input, polygons, points and lines to keep.
pub(super) fn files(job: &TinJob, source: &dyn GridSource) -> Vec<PathBuf> {
    let features = job.refinement.files().into_iter().flatten().flat_map(feature_files::files);
    let transform = job.transform.iter().flat_map(TargetCrs::files).map(Path::to_path_buf);
    let grid = plan::grid_files(&job.input, &job.reading, source);
    grid.into_iter().chain(features).chain(transform).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use terrane_engine::{REVISION, Resources};

    /// A plan of a grid of `side` samples along each side, as text.
    fn plan(side: u32) -> Value {
        json!({
            "kind": "tin", "terrane": env!("CARGO_PKG_VERSION"), "revision": REVISION,
            "label": "synth:rough",
            "method": {
                "input": { "names": ["synth:rough"], "label": "synth:rough" },
                "reading": { "band": null, "nodata": "nan", "bounds": null, "clip": null, "water": null },
                "format": "PLY", "max_error": 0.1,
                "refinement": {
                    "bound": "samples", "strict": false, "drop": true, "fit_heights": false, "triangulation": null,
                    "min_angle": null, "keep_points": null, "breaklines": null,
                },
                "tile": 16, "strip_rows": 2, "height_origin": null,
            },
            "grid": {
                "width": side, "height": side, "crs": "none",
                "transform": [0.1, 1e-300, 0.0, -7e22, 0.0, -1.0],
            },
            "files": [],
            "needs": {
                "memory": 0, "thread_memory": 0, "objects": 0, "output": 0, "seconds": [0.5, 0.0],
            },
        })
    }

    /// A plan after it was put into a folder and read again.
    fn read(plan: Value) -> Result<PlanManifest<PlannedMesh>> {
        let folder = tempfile::tempdir().unwrap();
        let plan: PlanManifest<PlannedMesh> = serde_json::from_value(plan).unwrap();
        plan.put(folder.path()).unwrap();
        PlanManifest::read(folder.path()).map(|(back, _)| back)
    }

    #[test]
    fn a_plan_comes_back_from_its_file_and_another_version_is_refused() {
        let back = read(plan(9000)).unwrap();
        assert_eq!(serde_json::to_value(&back).unwrap(), plan(9000));
        let (output, resources) = (PathBuf::new(), Resources::default());
        let order =
            OutputRequest { output, overwrite: false, form: OutputForm::default(), resources };
        assert!(back.work.job(order).reading.nodata.is_some_and(f64::is_nan));
        for (name, other) in [("terrane", json!("0.0.0")), ("revision", json!(REVISION + 1))] {
            let mut plan = plan(9000);
            plan[name] = other;
            let refused = read(plan).err().unwrap().to_string();
            assert!(refused.contains("was made by terrane"), "{refused}");
        }
    }

    #[test]
    fn a_plan_with_more_work_than_can_be_listed_is_refused() {
        let (most, few) = (1 << 28, "at least 2 x 2");
        for (side, part) in
            [(most, "number of tasks"), (u32::MAX, "number of columns or rows"), (0, few)]
        {
            let refused = read(plan(side)).err().unwrap().to_string();
            assert!(refused.contains("is not a valid plan") && refused.contains(part), "{refused}");
        }
        assert!(read(plan(1_000_000)).is_ok());
    }
}
