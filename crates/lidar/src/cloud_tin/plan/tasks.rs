//! The work of a task: it writes the vertices that its regions select or add into one object by tile; the last
//! task writes the mesh.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::needs::TileSample;
use super::report::{CloudTinStatus, PointRun, PointStatus};
use crate::cloud_tin::context::CloudTinContext;
use crate::cloud_tin::job::{CloudTinJob, CloudTinReport};
use crate::cloud_tin::lines::CloudLines;
use crate::cloud_tin::make::{self, CloudTinClock, report};
use crate::cloud_tin::prepared::PreparedCloudTin;
use crate::cloud_tin::regions::{CloudTinRegion, CloudTinRegions, no_surface};
use crate::cloud_tin::vertex_selection::{
    BAND, CloudTinErrors, RegionInspection, RegionWorklist, due, inspect_all, select_first,
};
use crate::cloud_tin::write::write;
use crate::point_index::{PointStore, PointTileIndexes, TileFileWriter, Tiling};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_base::limits;
use terrane_cloud::{self as cloud, CloudInfo, CloudOpenOptions, PointSource, ReturnCounts};
use terrane_delaunay::{ConvexHull, SiteWindow};
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::memory::beside_polygons;
use terrane_engine::outputs::refuse_other_name;
use terrane_engine::plan::{
    self, Digest, MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest,
    PlanStep, PlannedWork, RunControl, StatusReport, TaskStates, refuse_another,
};
use terrane_engine::skip_bad::LostPoints;
use terrane_files::atomic::AtomicFile;
use terrane_files::{name_of, path_of};
use terrane_mesh::{self as mesh, MeshFormat, check_prj};
use terrane_raster::Inputs;

/// Rounds of tasks that check the mesh.
const ROUNDS: u32 = 2;
/// Default number of points of a task.
const TASK_POINTS: u64 = 1 << 24;
/// Most tasks of a round, as each depends on all tasks of the round before.
const MAX_PARTS: u64 = 1 << 12;

/// A mesh to make of a cloud.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct CloudMesh {
    method: PlannedCloudTinJob,
    cloud: CloudHeaderSummary,
    pub(super) seen: CloudTinScan,
}

/// The job, with paths that are valid wherever a task runs on this file system.
#[derive(Clone, Serialize, Deserialize)]
struct PlannedCloudTinJob {
    inputs: Vec<String>,
    /// Name of the source in the mesh, if it is not that of the files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    source: Option<String>,
    #[serde(flatten)]
    options: CloudOpenOptions,
    format: String,
    max_error: f64,
    /// Most points of a task, if given.
    cut: Option<u32>,
}

/// Summary of the headers.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct CloudHeaderSummary {
    points: u64,
    /// Lowest and highest x, y and z, in steps.
    bounds: [[i32; 3]; 2],
    scale: [f64; 3],
    offset: [f64; 3],
    crs: String,
}

/// Statistics of all points, computed when the plan was made.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct CloudTinScan {
    census: ReturnCounts,
    /// Files with skipped damage.
    #[serde(default, skip_serializing_if = "LostPoints::is_empty")]
    losses: LostPoints,
    /// Corners of the hull.
    hull: Vec<[i32; 3]>,
    pub(super) regions: Vec<CloudTinRegion>,
    parts: Vec<CloudTinPart>,
}

/// The tiles and the regions of a task.
#[derive(Clone, Serialize, Deserialize)]
struct CloudTinPart {
    block: CloudTinRegion,
    regions: Range<usize>,
}

/// A task: its round, 0 for the selection, and the number of its part.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CloudTinTask {
    round: u32,
    part: u32,
}

impl CloudTinTask {
    const NAMES: [Numbered<Self>; 3] = [
        ("choose", |part| Self { round: 0, part }),
        ("prove", |part| Self { round: 1, part }),
        ("again", |part| Self { round: ROUNDS, part }),
    ];
}

impl fmt::Display for CloudTinTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", Self::NAMES[self.round as usize].0, self.part)
    }
}

/// Metadata of an object.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct VertexArtifactSummary {
    points: u64,
    /// Digest of the index of its tiles.
    index: Digest,
    /// Windows of influence of the checked regions, and their points.
    inspections: Vec<(usize, [[i32; 2]; 2], u64)>,
}

/// A plan's cloud and job, opened.
pub(super) struct OpenedCloudTin {
    job: CloudTinJob,
    label: String,
    source: Box<dyn PointSource>,
}

impl OpenedCloudTin {
    pub(super) fn new(job: CloudTinJob, label: String) -> Result<Self> {
        let source = cloud::source(job.inputs.names(), &job.options)?;
        Ok(Self { job, label, source })
    }

    pub(super) fn ready(&self) -> Result<PreparedCloudTin<'_>> {
        let format = self.job.format()?;
        let features = ConstraintFeatures::default();
        PreparedCloudTin::new(&self.job, &self.label, &*self.source, features, format)
    }
}

impl CloudHeaderSummary {
    fn of(info: &CloudInfo) -> Result<Self> {
        let bounds = info.bounds.ok_or_else(no_surface)?.map(|Point { x, y, z }| [x, y, z]);
        let crs = info.crs.wkt.clone().unwrap_or_else(|| info.crs.label());
        let (scale, offset) = (info.frame.scale, info.frame.offset);
        Ok(Self { points: info.count, bounds, scale, offset, crs })
    }
}

impl CloudTinScan {
    /// Reads the points once: divides them into regions of at most `max_points` points, and tasks of at most `cut`
    /// points (one region at least) or the default. Returns the statistics and the estimated share of points
    /// that become vertices.
    pub(super) fn scan(
        OpenedCloudTin { source, .. }: &OpenedCloudTin,
        cut: Option<u32>,
        max_points: u64,
        ready: &PreparedCloudTin<'_>,
        at: RunControl<'_>,
    ) -> Result<(Self, f64)> {
        let (sample, filling) = (TileSample::new(ready), ready.filling(at));
        let empty = PointStore::empty(ready.tiling(), ready.folder(), 0).outline();
        let points = empty.filled_and(&**source, &filling, &|batch| sample.take(batch))?;
        let hull = points.hull()?;
        if hull.is_flat() {
            return Err(no_surface());
        }
        let default_cut = TASK_POINTS.max(2 * source.info().count / MAX_PARTS);
        let regions = CloudTinRegions::new(&points, &[], max_points).all;
        let cut = cut.map_or(default_cut, u64::from).max(max_points);
        let blocks = CloudTinRegions::new(&points, &[], cut).all;
        let seen = Self {
            census: *points.census(),
            losses: points.losses().clone(),
            hull: hull.corners().iter().map(|p| [p.x, p.y, p.z]).collect(),
            parts: parts(&regions, blocks),
            regions,
        };
        Ok((seen, sample.share(ready, &hull, at.silent())?))
    }
}

impl CloudMesh {
    /// The plan of an opened job with the statistics of its points.
    pub(super) fn of(
        opened: &OpenedCloudTin,
        cut: Option<u32>,
        seen: CloudTinScan,
    ) -> Result<Self> {
        let OpenedCloudTin { job, source, .. } = opened;
        let inputs = match source.files() {
            [] => job.inputs.names().to_vec(),
            files => files.iter().map(|name| absolute(name)).collect::<Result<_>>()?,
        };
        let (options, max_error) = (job.options.clone(), job.tolerance);
        let format = job.format()?.name.to_owned();
        let label = job.inputs.label().map(str::to_owned);
        let method = PlannedCloudTinJob { inputs, source: label, options, format, max_error, cut };
        let mesh = Self { method, cloud: CloudHeaderSummary::of(source.info())?, seen };
        mesh.check().map(|()| mesh)
    }

    /// Its input files.
    pub(super) fn files(&self, opened: &OpenedCloudTin) -> Vec<PathBuf> {
        let on_disk = if opened.source.files().is_empty() { &[][..] } else { &self.method.inputs };
        on_disk.iter().map(|name| path_of(name).into_owned()).collect()
    }

    fn format(&self) -> Result<&'static MeshFormat> {
        mesh::by_path(Path::new(""), Some(&self.method.format))
    }

    /// Rounds of tasks after the selection: none if all points are vertices.
    fn rounds(&self) -> u32 {
        if self.method.max_error == 0.0 { 0 } else { ROUNDS }
    }

    /// The tasks of some rounds.
    fn tasks_of(&self, rounds: Range<u32>) -> Vec<CloudTinTask> {
        let parts = self.seen.parts.len() as u32;
        rounds.flat_map(|round| (0..parts).map(move |part| CloudTinTask { round, part })).collect()
    }

    fn part(&self, task: CloudTinTask) -> &CloudTinPart {
        &self.seen.parts[task.part as usize]
    }
}

fn absolute(name: &str) -> Result<String> {
    name_of(plan::noted_path(&path_of(name))?)
}

/// Blocks, and the regions of each.
fn parts(regions: &[CloudTinRegion], blocks: Vec<CloudTinRegion>) -> Vec<CloudTinPart> {
    let (mut parts, mut next) = (Vec::with_capacity(blocks.len()), 0);
    for block in blocks {
        let first = next;
        next += regions[first..].iter().take_while(|region| block.contains(region.low)).count();
        parts.push(CloudTinPart { block, regions: first..next });
    }
    parts
}

/// Context of a task, or of the last one.
struct CloudTinTaskContext<'a> {
    mesh: &'a CloudMesh,
    opened: &'a OpenedCloudTin,
    ready: &'a PreparedCloudTin<'a>,
    tiling: Tiling,
    hull: Vec<Point>,
    regions: CloudTinRegions,
    lines: CloudLines<'a>,
    at: RunControl<'a>,
}

impl<'a> CloudTinTaskContext<'a> {
    fn new(
        mesh: &'a CloudMesh,
        opened: &'a OpenedCloudTin,
        ready: &'a PreparedCloudTin<'a>,
        at: RunControl<'a>,
    ) -> Self {
        let tiling = ready.tiling();
        let hull: Vec<_> = mesh.seen.hull.iter().map(|&[x, y, z]| Point::new(x, y, z)).collect();
        let regions = CloudTinRegions::known(&mesh.seen.regions, &tiling);
        let mut lines = CloudLines::new(&ready.constraints, ConvexHull::of(hull.clone()), &tiling);
        lines.divide(&regions, &tiling);
        Self { mesh, opened, ready, tiling, hull, regions, lines, at }
    }

    /// The work on some points, with `resident_bytes` beside them.
    fn work<'w>(
        &'w self,
        points: &'w PointStore,
        resident_bytes: u64,
    ) -> Result<CloudTinContext<'w>> {
        self.ready.work(points, &self.regions, &self.lines, resident_bytes, self.at)
    }

    fn empty(&self, bytes: u64) -> PointStore {
        PointStore::empty(self.tiling, self.ready.folder(), bytes)
    }

    /// The points in a window, optionally only those of some tiles.
    fn read(&self, within: SiteWindow, squares: Option<&[usize]>) -> Result<PointStore> {
        let filling = self.ready.filling(self.at);
        let filling = crate::point_index::PointStoreSetup { within: Some(within), ..filling };
        let empty = self.empty(filling.memory);
        let empty = match squares {
            Some(squares) => empty.only(squares.iter().copied()),
            None => empty,
        };
        empty.filled(&*self.opened.source, &filling)
    }

    /// The points of these regions.
    fn read_regions(&self, regions: &[usize]) -> Result<PointStore> {
        let regions = regions.iter().map(|number| &self.regions.all[*number]);
        let squares: Vec<_> =
            regions.clone().flat_map(|region| region.squares(&self.tiling)).collect();
        let windows = regions.map(|region| region.window(&self.tiling));
        match windows.reduce(|all, window| all.union(&window)) {
            None => Ok(self.empty(0)),
            Some(within) => self.read(within, Some(&squares)),
        }
    }

    /// The first vertices of some regions; all points if the tolerance is 0.
    fn select(&self, block: &CloudTinRegion, regions: Range<usize>) -> Result<PointStore> {
        let band = self.tiling.side() / BAND;
        let points = self.read(block.window(&self.tiling).grown(band), None)?;
        let (work, tolerance) = (self.work(&points, 0)?, self.ready.tolerance());
        if tolerance == 0.0 {
            return Ok(points);
        }
        let vertices = self.empty(work.vertex_bytes);
        select_first(&work, regions, tolerance, &self.hull, &self.empty(0), &vertices)?;
        Ok(vertices)
    }

    /// Checks the regions of a task that are due in its round; returns their results.
    fn scan(
        &self,
        task: CloudTinTask,
        states: &TaskStates<'_, CloudMesh>,
    ) -> Result<Vec<(usize, RegionInspection)>> {
        let (mesh, regions) = (self.mesh, self.mesh.part(task).regions.clone());
        let all = vertices_of(states, mesh.tasks_of(0..task.round))?;
        let due = match task.round {
            1 => regions.collect(),
            round => {
                let changed = vertices_of(states, mesh.tasks_of(round - 1..round))?;
                let changed = changed.squares().map(|(square, _)| square);
                let due = due(&last_inspections(states, task)?, changed, &self.tiling);
                due.into_iter().map(|number| regions.start + number).collect::<Vec<_>>()
            }
        };
        let (points, resident_bytes) = (self.read_regions(&due)?, all.bytes());
        let work = self.work(&points, resident_bytes)?;
        let vertices = self.empty(work.vertex_bytes).over(all);
        inspect_all(&work, &vertices, self.ready.tolerance(), &self.hull, &due)
    }

    /// Adds the remaining vertices after all rounds.
    fn settle(
        &self,
        states: &TaskStates<'_, CloudMesh>,
        work: &CloudTinContext<'_>,
        vertices: &PointStore,
    ) -> Result<CloudTinErrors> {
        let (rounds, tolerance) = (self.mesh.rounds(), self.ready.tolerance());
        let last = self.mesh.tasks_of(rounds..rounds + 1);
        let inspections = last
            .iter()
            .map(|task| last_inspections(states, CloudTinTask { round: rounds + 1, ..*task }));
        let inspections = inspections.collect::<Result<Vec<_>>>()?.concat();
        let changed = vertices_of(states, last)?;
        let changed = changed.squares().map(|(square, _)| square);
        let worklist = RegionWorklist::after(inspections, changed, &self.tiling);
        let finished = worklist.run(vertices, |due| {
            let points = self.read_regions(due)?;
            let work = CloudTinContext { points: &points, ..*work };
            inspect_all(&work, vertices, tolerance, &self.hull, due)
        })?;
        Ok(finished.end(tolerance).0)
    }
}

/// The vertices in the objects of some tasks.
fn vertices_of(
    states: &TaskStates<'_, CloudMesh>,
    tasks: Vec<CloudTinTask>,
) -> Result<PointTileIndexes> {
    let mut objects = Vec::with_capacity(tasks.len());
    for task in tasks {
        let (path, done) = states.object(task)?;
        objects.push((path, done.facts.index));
    }
    PointTileIndexes::open(objects)
}

/// The last results of the regions of a task before its round.
fn last_inspections(
    states: &TaskStates<'_, CloudMesh>,
    task: CloudTinTask,
) -> Result<Vec<RegionInspection>> {
    let regions = states.folder.plan.work.part(task).regions.clone();
    let mut inspections = vec![RegionInspection::settled(SiteWindow::ALL, 0); regions.len()];
    for round in 1..task.round {
        let (_, done) = states.object(CloudTinTask { round, ..task })?;
        for &(region, [low, high], points) in &done.facts.inspections {
            inspections[region - regions.start] =
                RegionInspection::settled(SiteWindow { low, high }, points);
        }
    }
    Ok(inspections)
}

/// Writes the points of a block of tiles into an object; returns their number.
fn put(store: &PointStore, block: &CloudTinRegion, object: &Path) -> Result<(u64, Digest)> {
    let mut writer = TileFileWriter::create(object)?;
    let (mut points, mut count) = (Vec::new(), 0);
    for square in block.squares(store.tiling()) {
        store.load_distinct(square, &mut points)?;
        writer.put(square, &points)?;
        count += points.len() as u64;
    }
    Ok((count, writer.finish()?))
}

impl PlannedWork for CloudMesh {
    const KIND: PlanKind = PlanKind::Cloud;
    const NAMES: &'static [Numbered<CloudTinTask>] = &CloudTinTask::NAMES;

    type Task = CloudTinTask;
    type Facts = VertexArtifactSummary;
    type Run = PointRun;
    type Note = CloudTinReport;
    type Status = PointStatus;
    type Opened = OpenedCloudTin;

    fn check(&self) -> Result<()> {
        limits::check("number of tasks of a round", self.seen.parts.len() as u64, MAX_PARTS)
    }

    fn tasks(&self) -> Vec<CloudTinTask> {
        self.tasks_of(0..self.rounds() + 1)
    }

    fn before(&self, task: CloudTinTask) -> Vec<CloudTinTask> {
        self.tasks_of(0..task.round)
    }

    fn size(&self, task: PlanStep<CloudTinTask>) -> u64 {
        match task {
            PlanStep::Task(task) => self.part(task).block.points,
            PlanStep::Finish => self.seen.census.kept,
        }
    }

    fn status(&self) -> CloudTinStatus {
        let (max_error, points) = (self.method.max_error, self.seen.census.kept);
        StatusReport {
            format: self.method.format.clone(),
            of: PointStatus { max_error, points, regions: self.seen.regions.len() as u64 },
            ..StatusReport::default()
        }
    }

    fn check_name(&self, output: &Path, _: &OutputForm) -> Result<()> {
        refuse_other_name(self.format()?, output)
    }

    fn output(&self, _: &OutputForm) -> Result<PathBuf> {
        let format = self.format()?;
        Ok(Path::new("mesh").with_extension(format.extensions[0]))
    }

    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<OpenedCloudTin> {
        let OutputRequest { output, overwrite, resources, .. } = order;
        let Self { method, cloud, .. } = &plan.work;
        let resources = beside_polygons(&method.options, &resources);
        let options = CloudOpenOptions { threads: resources.threads, ..method.options.clone() };
        let inputs = Inputs::from(method.inputs.clone());
        let inputs = match &method.source {
            Some(source) => inputs.called(source.clone()),
            None => inputs,
        };
        let job = CloudTinJob {
            overwrite,
            options,
            format: Some(method.format.clone()),
            ..CloudTinJob::new(inputs, output, method.max_error, resources)
        };
        let opened = OpenedCloudTin::new(job, plan.label.clone())?;
        refuse_another(
            "cloud",
            &plan.label,
            cloud,
            &CloudHeaderSummary::of(opened.source.info())?,
        )?;
        Ok(opened)
    }

    fn check_output(opened: &OpenedCloudTin, _: RunControl<'_>) -> Result<()> {
        let (CloudTinJob { output, overwrite, .. }, ready) = (&opened.job, opened.ready()?);
        drop(AtomicFile::create(output, *overwrite)?);
        check_prj(output, &ready.info.crs, *overwrite)
    }

    fn make(
        opened: &OpenedCloudTin,
        (task, object): (CloudTinTask, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut PointRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<VertexArtifactSummary>> {
        let (mesh, ready) = (&states.folder.plan.work, opened.ready()?);
        let (context, part) = (CloudTinTaskContext::new(mesh, opened, &ready, at), mesh.part(task));
        let (vertices, mut inspections) = match task.round {
            0 => (context.select(&part.block, part.regions.clone())?, Vec::new()),
            _ => {
                let inspections = context.scan(task, states)?;
                let additions = context.empty(u64::MAX);
                inspections.iter().try_for_each(|(_, of)| additions.add(&of.additions))?;
                (additions, inspections)
            }
        };
        inspections.sort_unstable_by_key(|(region, _)| *region);
        let (points, index) = put(&vertices, &part.block, object)?;
        run.vertices += points;
        let inspections =
            inspections.into_iter().map(|(region, RegionInspection { influence, errors, .. })| {
                (region, [influence.low, influence.high], errors.points)
            });
        let facts = VertexArtifactSummary { points, index, inspections: inspections.collect() };
        Ok(MadeArtifact { facts, digest: None, spilled: vertices.spilled() })
    }

    fn write(
        opened: &OpenedCloudTin,
        states: &TaskStates<'_, Self>,
        run: &mut PointRun,
        at: RunControl<'_>,
    ) -> Result<CloudTinReport> {
        let (started, mesh, ready) = (Instant::now(), &states.folder.plan.work, opened.ready()?);
        let (context, mut clock) =
            (CloudTinTaskContext::new(mesh, opened, &ready, at), CloudTinClock::default());
        let (none, all) = (context.empty(0), vertices_of(states, mesh.tasks())?);
        let work = context.work(&none, all.bytes())?;
        let vertices = context.empty(work.vertex_bytes).over(all);
        let errors = match mesh.rounds() {
            0 => CloudTinErrors::default(),
            _ => context.settle(states, &work, &vertices)?,
        };
        clock.lap("prove", vertices.count());
        let written = write(&work, &vertices, &context.hull, &ready.info.frame, ready.sink()?)?;
        clock.lap("write", written.vertices);
        let ReturnCounts { kept, .. } = mesh.seen.census;
        let stacked = kept - if mesh.rounds() == 0 { written.vertices } else { errors.points };
        let (spilled, apart) = (vertices.spilled(), Vec::new());
        let outcome = make::CloudTinOutcome { written, errors, stacked, spilled, apart };
        let mut report = report(&ready, &work, mesh.seen.census, &outcome, clock)?;
        report.of_source(&*opened.source, &mesh.seen.losses, started);
        run.mesh = Some(report.clone());
        Ok(report)
    }

    fn written(note: CloudTinReport, output: &Path, run: &mut PointRun) {
        run.mesh = Some(CloudTinReport { output: output.display().to_string(), ..note });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_each_region_once() {
        let region = |low: [u32; 2], side: u32| CloudTinRegion {
            low,
            end: low.map(|at| at + side),
            points: 1,
        };
        let regions = [
            region([0, 0], 1),
            region([1, 0], 1),
            region([2, 0], 2),
            region([0, 2], 2),
            region([2, 2], 1),
            region([3, 3], 1),
        ];
        let of = |blocks: Vec<CloudTinRegion>| -> Vec<Range<usize>> {
            parts(&regions, blocks).into_iter().map(|part| part.regions).collect()
        };
        assert!(of(vec![region([0, 0], 4)]) == vec![0..6; 1]);
        let quarters = [[0, 0], [2, 0], [0, 2], [2, 2]].map(|low| region(low, 2));
        assert_eq!(of(quarters.to_vec()), [0..2, 2..3, 3..4, 4..6]);
    }
}
