//! A prepared job on points: run whole, run on a subset of tiles, or analysed for a plan.

use std::collections::BTreeSet;
use std::time::Instant;

use super::context::TranslateContext;
use super::input_records::InputRecords;
use super::job::{StageNeeds, TranslateJob};
use super::memory_shares::TranslateMemory;
use super::report::TranslateReport;
use super::split::SplitColumn;
use super::stages::ground::GroundInput;
use super::stages::noise::NoiseMarks;
use super::stages::noise::noise_index::Noise;
use super::stages::{Dedupe, StageChain, StageInput};
use super::tile_subset::{CloudKnowledge, TileSubset};
use super::tiled_output::{SplitFiles, refuse_within};
use crate::records::over;
use terrane_base::error::Result;
use terrane_cloud::write::CloudWriteOptions;
use terrane_cloud::{PointCloud, PointFormatConverter, PointSource};
use terrane_engine::input::workers;
use terrane_engine::memory::with_polygons;
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::refuse_existing;

/// Writes the points. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// An output that exists, cannot be created, or has an unknown extension; files that cannot be merged;
/// attributes that the format does not hold; too little memory.
pub fn run(
    job: &TranslateJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TranslateReport> {
    let (start, at) = (Instant::now(), RunControl { progress, cancel });
    refuse_existing(&job.output, job.overwrite)?;
    job.packing()?;
    let cloud = job.open()?;
    if job.squares.is_some() || job.split.is_some() {
        refuse_within(cloud.files(), &job.output)?;
    }
    let mut report = with_polygons(&job.cloud, &job.resources, |resources| {
        let job = TranslateJob { resources, ..job.clone() };
        prepared(&job, &cloud, None, at, |prepared| prepared.report(start))
    })?;
    report.run.memory_budget = job.resources.memory;
    Ok(report)
}

/// Prepares a job on a point cloud, or some tiles of it, and calls `act`.
pub(super) fn prepared<T: Send>(
    job: &TranslateJob,
    cloud: &PointCloud,
    subset: Option<&TileSubset<'_>>,
    at: RunControl<'_>,
    act: impl FnOnce(&Prepared<'_>) -> Result<T> + Send,
) -> Result<T> {
    let packing = job.packing()?;
    let converter = converter(job, cloud)?;
    let (format, columns) = (converter.format(), converter.columns());
    let chain = chain(job, &converter)?;
    let split = job.split.as_ref().map(|split| SplitColumn::new(split, format, &columns));
    let split = split.transpose()?;
    let source = InputRecords::within(cloud, &converter, subset.map(TileSubset::window))
        .with(subset.and_then(TileSubset::noise).map(|noise| &noise.own));
    let needed =
        job.needed(packing, |number| chain.input(number), source.count(), subset.is_some());
    let needed = StageNeeds { held: chain.bytes(), ..needed };
    let shares =
        TranslateMemory::new(&job.resources, converter.size(), converter.extra_bytes(), needed)?;
    let threads = shares.threads;
    let info = &chain.output;
    let file = converter.file(info.frame, info.crs.clone());
    let options = CloudWriteOptions { packing, overwrite: job.overwrite, ..file };
    let work = TranslateContext {
        job,
        input: cloud,
        cloud: cloud.info(),
        split: split.as_ref(),
        info,
        converter: &converter,
        options,
        shares,
        subset,
        at,
    };
    let resources = Resources { threads, ..job.resources.clone() };
    let prepared = Prepared { work, source: &source, chain: &chain };
    workers(&resources)?.install(|| act(&prepared))
}

/// A prepared job.
pub(super) struct Prepared<'a> {
    pub(super) work: TranslateContext<'a>,
    pub(super) source: &'a InputRecords<'a>,
    chain: &'a StageChain,
}

impl Prepared<'_> {
    /// Writes the output; returns its files, and notes on points, one line each.
    pub(super) fn make(&self) -> Result<(SplitFiles, Vec<String>)> {
        let (work, mut notes) = (&self.work, Vec::new());
        let files = self.chain.run(self.source, work, &mut notes, |records| work.write(records))?;
        // Several may say that the unit is a guess.
        let mut told = BTreeSet::new();
        notes.retain(|note| told.insert(note.clone()));
        Ok((files, notes))
    }

    /// Writes the output and reports on it; the work began at `start`.
    pub(super) fn report(&self, start: Instant) -> Result<TranslateReport> {
        let (files, notes) = self.make()?;
        let TranslateContext { job, info, converter, shares, .. } = &self.work;
        let run = RunStatistics::since(start, &job.resources).with_threads(shares.threads);
        let census = self.source.census();
        Ok(TranslateReport {
            input: job.input.join(", "),
            output: job.output.display().to_string(),
            point_format: converter.format().number(),
            census: Some(census),
            files: files.files,
            points: files.points,
            crs: info.crs.label(),
            output_bytes: files.bytes,
            points_per_second: Some(run.rate(census.read)),
            run,
            transformed: self.chain.transformed(),
            notes: [self.notes(), LostPoints::of(self.source.cloud()).notes().collect(), notes]
                .concat(),
        })
    }

    /// Notes on the point cloud and on its attributes, one line each.
    pub(super) fn notes(&self) -> Vec<String> {
        let notes = self.source.cloud().notes().iter();
        notes.chain(self.work.converter.notes()).cloned().collect()
    }

    /// Statistics of the whole point cloud for a plan: the noise and the ground.
    pub(super) fn scan(&self) -> Result<CloudKnowledge> {
        let Self { work, source, chain } = self;
        let surveyed = work.job.surveyed(work.converter.info())?;
        let input = match surveyed.ground {
            Some(_) => GroundInput::open(work.job, false)?,
            None => None,
        };
        let context = |number| chain.context(number, work);
        let is_own = input.is_none() || surveyed.noise.is_some();
        let single = surveyed.dedupe.filter(|_| is_own);
        let single = single.map(|number| Dedupe::select(*source, &context(number))).transpose()?;
        let records = over(&single, *source);
        let marks = surveyed.noise.map(|(number, stage)| stage.mark(records, &context(number)));
        let marks = marks.transpose()?;
        let noted = marks.as_ref().map(|marks| marks.noted(single.as_ref())).transpose()?;
        let notes = marks.iter().flat_map(|marks| marks.notes.clone()).collect();
        let mut noise = noted.map(|own| Noise { own, ground: None, notes });
        let marked = marks.map(NoiseMarks::records);
        let records = over(&marked, records);
        let known = surveyed.noise.zip(noise.as_mut());
        let known = known.map(|((number, stage), noise)| (stage, context(number), noise));
        let seen = surveyed
            .ground
            .map(|(number, query)| query.scan(records, &context(number), input.as_ref(), known));
        Ok(CloudKnowledge { seen: seen.transpose()?, noise })
    }
}

/// The stages of a job.
///
/// # Errors
/// As [`StageChain::open`].
pub(super) fn chain(
    job: &TranslateJob,
    converter: &PointFormatConverter<'_>,
) -> Result<StageChain> {
    let info = converter.info();
    let input = StageInput {
        info,
        format: converter.format(),
        columns: &converter.columns(),
        added: &[],
        is_new: &|name| converter.added_at(name).is_some(),
        packing: job.packing()?,
        job,
        is_last: false,
        is_above_ground: false,
        height_step: info.frame.scale[2],
    };
    StageChain::open(&job.stages, input)
}

/// The reader of the points of a job.
pub(super) fn converter<'a>(
    job: &TranslateJob,
    cloud: &'a PointCloud,
) -> Result<PointFormatConverter<'a>> {
    PointFormatConverter::new(cloud, job.target()?, &job.dimensions())
}

/// Least memory for a part of a job with `points` points, and its part for a thread.
pub(super) fn min_memory(job: &TranslateJob, cloud: &PointCloud, points: u64) -> Result<[u64; 2]> {
    let converter = converter(job, cloud)?;
    let needed = job.needed(job.packing()?, |_| converter.info(), points, true);
    let needed = StageNeeds { held: chain(job, &converter)?.bytes(), ..needed };
    Ok(TranslateMemory::min_memory(converter.size(), converter.extra_bytes(), &needed))
}
