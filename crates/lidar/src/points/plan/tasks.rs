//! The work of a task: it writes the files of its tiles into one object; the last task moves all files into one
//! folder.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::manifest::{PlannedTranslateJob, PointTileBlocks, PointTileTask, PointTilesPlan};
use super::report::{PointTileRun, PointTileStatus, PointsWritten};
use crate::grid::CellSurroundings;
use crate::points::job::TranslateJob;
use crate::points::prepared::{chain, converter, prepared};
use crate::points::stages::AnyStage;
use crate::points::tile_subset::{CloudKnowledge, TileSubset, window};
use crate::points::tiled_output::{self, Spans};
use terrane_base::error::{Error, Result};
use terrane_cloud::{PointCloud, PointSource};
use terrane_engine::memory::beside_polygons;
use terrane_engine::outputs::refuse_file_name;
use terrane_engine::plan::{
    MadeArtifact, Numbered, OutputForm, OutputRequest, PlanKind, PlanManifest, PlanStep,
    PlannedWork, RunControl, StatusReport, TaskStates, damaged_object, refuse_another,
};
use terrane_engine::skip_bad::LostPoints;
use terrane_files::atomic::{AtomicFile, AtomicFolder};

/// A plan's cloud and job, opened.
pub(super) struct OpenedTranslate {
    pub(super) job: TranslateJob,
    pub(super) cloud: PointCloud,
}

/// Content of an object: its files in order, each with its size.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PointTileArtifactSummary {
    points: u64,
    files: Vec<(String, u64)>,
    /// Files with skipped damage.
    #[serde(default, skip_serializing_if = "LostPoints::is_empty")]
    losses: LostPoints,
}

impl PointTilesPlan {
    /// The plan of a job and its input; computes the statistics of the whole point cloud unless they are
    /// `known`.
    pub(super) fn new(
        job: &TranslateJob,
        cut: Option<u32>,
        known: Option<&CloudKnowledge>,
        at: RunControl<'_>,
    ) -> Result<(Self, OpenedTranslate)> {
        let mut opened = OpenedTranslate::new(job.clone())?;
        let converter = converter(&opened.job, &opened.cloud)?;
        chain(&opened.job, &converter)?;
        let info = converter.info().clone();
        let mut method = PlannedTranslateJob::of(job, &info)?;
        method.set_files(opened.cloud.files())?;
        opened.job.stages = method.stages.clone();
        let blocks = PointTileBlocks::of(&info, &method.squares, cut)?;
        blocks.check()?;
        let knowledge = known.map_or_else(|| opened.scan(at), |knowledge| Ok(knowledge.clone()))?;
        Ok((Self { method, blocks, knowledge: knowledge.clone() }, opened.knowing(&knowledge)))
    }

    /// Its input files.
    pub(super) fn files(&self, opened: &OpenedTranslate) -> Vec<PathBuf> {
        let on_disk = if opened.cloud.files().is_empty() { &[][..] } else { self.method.input() };
        let of_cloud = on_disk.iter().map(|name| terrane_files::path_of(name).into_owned());
        let of_stages = self.method.stages.iter().flat_map(|stage| stage.stage().files());
        of_cloud.chain(of_stages).collect()
    }
}

impl OpenedTranslate {
    fn new(job: TranslateJob) -> Result<Self> {
        let cloud = job.open()?;
        Ok(Self { job, cloud })
    }

    /// Statistics of the whole point cloud: of its ground, if needed, and its noise, if that is not local or
    /// excluded from the ground.
    fn scan(&self, at: RunControl<'_>) -> Result<CloudKnowledge> {
        match self.job.surveyed(self.cloud.info())?.is_empty() {
            true => Ok(CloudKnowledge::default()),
            false => prepared(&self.job, &self.cloud, None, at, |of| of.scan()),
        }
    }

    /// The remaining job with these statistics: noise is classified while reading.
    fn knowing(mut self, knowledge: &CloudKnowledge) -> Self {
        let stages = &mut self.job.stages;
        let noise = stages.iter().position(|stage| matches!(stage, AnyStage::ClassifyNoise(_)));
        if let Some(number) = noise.filter(|_| knowledge.noise.is_some()) {
            stages.remove(number);
        }
        self
    }

    /// Writes the files of some tiles into a folder, from the points near them, with a wider margin if
    /// necessary.
    pub(super) fn make(
        &self,
        work: &PointTilesPlan,
        spans: Spans,
        folder: &Path,
        at: RunControl<'_>,
    ) -> Result<tiled_output::SplitFiles> {
        let (job, info) = (&self.job, self.cloud.info());
        let cells = window(&work.method.squares, spans, job.reach(info)?, &info.frame);
        let side = crate::grid::tiling(info).side();
        let wide = (0..2).map(|i| cells.high[i].abs_diff(cells.low[i]) / 8).min().unwrap_or(0);
        let mut near = CellSurroundings { cells, margin: side.saturating_add(4).max(wide as i32) };
        loop {
            let subset = TileSubset::new(spans, near, &work.knowledge, &self.cloud, folder);
            let made = prepared(job, &self.cloud, Some(&subset), at, |of| of.make());
            if !subset.is_exceeded() {
                return made.map(|(made, _)| made);
            }
            near = near.wider();
        }
    }
}

impl PlannedWork for PointTilesPlan {
    const KIND: PlanKind = PlanKind::Points;
    const NAMES: &'static [Numbered<PointTileTask>] = &[("squares", PointTileTask)];

    type Task = PointTileTask;
    type Facts = PointTileArtifactSummary;
    type Run = PointTileRun;
    type Note = PointsWritten;
    type Status = PointTileStatus;
    type Opened = OpenedTranslate;

    fn check(&self) -> Result<()> {
        self.blocks.check()
    }

    fn tasks(&self) -> Vec<PointTileTask> {
        self.blocks.all().collect()
    }

    fn before(&self, _: PointTileTask) -> Vec<PointTileTask> {
        Vec::new()
    }

    fn size(&self, task: PlanStep<PointTileTask>) -> u64 {
        match task {
            PlanStep::Task(block) => PointTileBlocks::size(self.blocks.of_task(block)),
            PlanStep::Finish => PointTileBlocks::size(self.blocks.spans),
        }
    }

    fn status(&self) -> StatusReport<PointTileStatus> {
        let PointTileBlocks { points, cut, .. } = self.blocks;
        let (squares, side) = (self.blocks.counts(), self.method.squares.side);
        StatusReport {
            format: self.method.ending().to_owned(),
            tile_cells: cut,
            of: PointTileStatus { squares, side, points },
            ..StatusReport::default()
        }
    }

    fn output(&self, _: &OutputForm) -> Result<PathBuf> {
        Ok(PathBuf::from("points"))
    }

    fn open(plan: &PlanManifest<Self>, order: OutputRequest) -> Result<OpenedTranslate> {
        let OutputRequest { output, overwrite, resources, .. } = order;
        let Self { method, blocks, knowledge } = &plan.work;
        let mut job = TranslateJob { output, overwrite, ..method.job()? };
        job.resources = beside_polygons(&job.cloud, &resources);
        job.cloud.threads = job.resources.threads;
        let opened = OpenedTranslate::new(job)?;
        let info = converter(&opened.job, &opened.cloud)?.info().clone();
        let here = PointTileBlocks::of(&info, &method.squares, Some(blocks.cut))?;
        refuse_another("cloud", &plan.label, blocks, &here)?;
        Ok(opened.knowing(knowledge))
    }

    fn check_output(
        OpenedTranslate { job, cloud }: &OpenedTranslate,
        _: RunControl<'_>,
    ) -> Result<()> {
        refuse_file_name(&job.output)?;
        tiled_output::refuse_within(cloud.files(), &job.output)?;
        AtomicFolder::create(&job.output, job.overwrite, tiled_output::is_ours).map(drop)
    }

    fn make(
        opened: &OpenedTranslate,
        (block, object): (PointTileTask, &Path),
        states: &TaskStates<'_, Self>,
        run: &mut PointTileRun,
        at: RunControl<'_>,
    ) -> Result<MadeArtifact<PointTileArtifactSummary>> {
        let work = &states.folder.plan.work;
        // It goes with its files, and what a killed run left of one is removed.
        let folder = AtomicFolder::create(&object.with_extension("files"), true, |_| true)?;
        let made = opened.make(work, work.blocks.of_task(block), folder.inside(), at)?;
        let (files, losses) = (pack(folder.inside(), object)?, LostPoints::of(&opened.cloud));
        let facts = PointTileArtifactSummary { points: made.points, files, losses };
        run.points += made.points;
        Ok(MadeArtifact { facts, digest: None, spilled: 0 })
    }

    fn write(
        OpenedTranslate { job, cloud }: &OpenedTranslate,
        states: &TaskStates<'_, Self>,
        run: &mut PointTileRun,
        at: RunControl<'_>,
    ) -> Result<PointsWritten> {
        let PlanManifest { label, work, .. } = &states.folder.plan;
        let folder = AtomicFolder::create(&job.output, job.overwrite, tiled_output::is_ours)?;
        let mut written = prepared(job, cloud, None, at, |of| {
            Ok(PointsWritten {
                input: label.clone(),
                output: job.output.display().to_string(),
                point_format: of.work.converter.format().number(),
                crs: of.work.info.crs.label(),
                notes: of.notes(),
                ..PointsWritten::default()
            })
        })?;
        let mut losses = LostPoints::default();
        at.progress.begin("write", states.done.values().map(|done| done.bytes).sum());
        for block in states.done.keys() {
            at.cancel.check()?;
            let (object, done) = states.object(*block)?;
            unpack(&object, &done.facts.files, folder.inside())?;
            losses.add(&done.facts.losses);
            written.files += done.facts.files.len() as u64;
            written.points += done.facts.points;
            written.output_bytes += done.bytes;
            at.progress.advance(done.bytes);
        }
        at.progress.end();
        folder.commit()?;
        written.notes.extend(losses.notes());
        written.notes.extend(work.knowledge.notes());
        run.written = Some(written.clone());
        Ok(written)
    }

    fn written(note: PointsWritten, output: &Path, run: &mut PointTileRun) {
        run.written = Some(PointsWritten { output: output.display().to_string(), ..note });
    }
}

/// Concatenates the files of a folder by name; returns their names and sizes.
fn pack(folder: &Path, object: &Path) -> Result<Vec<(String, u64)>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::read(folder, e))?;
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(|e| Error::read(folder, e))?.path());
    }
    paths.sort();
    let mut packed = AtomicFile::create(object, true)?;
    let mut files = Vec::new();
    for path in paths {
        let mut file = File::open(&path).map_err(|e| Error::read(&path, e))?;
        let bytes = io::copy(&mut file, &mut packed).map_err(|e| Error::write(object, e))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.push((name, bytes));
    }
    packed.commit()?;
    Ok(files)
}

/// Extracts the files of an object into a folder.
fn unpack(object: &Path, files: &[(String, u64)], folder: &Path) -> Result<()> {
    let mut packed = BufReader::new(File::open(object).map_err(|e| Error::read(object, e))?);
    for (name, bytes) in files {
        let path = folder.join(name);
        let mut file = AtomicFile::create(&path, false)?;
        let copied = io::copy(&mut (&mut packed).take(*bytes), &mut file);
        if copied.map_err(|e| Error::write(&path, e))? != *bytes {
            return Err(damaged_object(object));
        }
        file.commit()?;
    }
    Ok(())
}
