//! A prepared job on points: run whole, run on a subset of tiles, or analysed for a plan.

use std::time::Instant;

use super::assign::{AssignedRecords, AttributeAssigner};
use super::context::TranslateContext;
use super::ground_input::GroundInput;
use super::height_above_ground::queries::HeightsAs;
use super::input_records::InputRecords;
use super::job::TranslateJob;
use super::memory_shares::TranslateMemory;
use super::noise::noise_index::Noise;
use super::report::TranslateReport;
use super::reprojection::MovedRecords;
use super::split::SplitColumn;
use super::tile_subset::{CloudKnowledge, TileSubset};
use super::tiled_output::{SplitFiles, refuse_within};
use crate::records::{PointRecords, over};
use terrane_base::error::Result;
use terrane_cloud::write::CloudWriteOptions;
use terrane_cloud::{PointCloud, PointFormatConverter, PointSource};
use terrane_engine::input::workers;
use terrane_engine::memory::with_polygons;
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::transform::Transformed;
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
    let input_info = job.above.info(converter.info());
    let (format, columns) = (converter.format(), converter.columns());
    let assigning = AttributeAssigner::new(&job.assign, format, &columns, &input_info.frame)?;
    let split = job.split.as_ref().map(|split| SplitColumn::new(split, format, &columns));
    let split = split.transpose()?;
    let source = InputRecords::within(cloud, &converter, subset.map(TileSubset::window))
        .with(subset.and_then(TileSubset::noise).map(|noise| &noise.own));
    let needed = job.needed(packing, converter.info(), source.count(), subset.is_some());
    let shares =
        TranslateMemory::new(&job.resources, converter.size(), converter.extra_bytes(), needed)?;
    let threads = shares.threads;
    let reprojection = job.reprojection(&input_info)?;
    let info = reprojection.as_ref().map_or(&input_info, |reprojection| &reprojection.info);
    let file = converter.file(info.frame, info.crs.clone());
    let options = CloudWriteOptions { packing, overwrite: job.overwrite, ..file };
    let work = TranslateContext {
        job,
        input: cloud,
        cloud: cloud.info(),
        assigning: &assigning,
        split: split.as_ref(),
        input_info: &input_info,
        info,
        reprojection: reprojection.as_ref(),
        converter: &converter,
        options,
        shares,
        subset,
        at,
    };
    let resources = Resources { threads, ..job.resources.clone() };
    let prepared = Prepared { work, source: &source };
    workers(&resources)?.install(|| act(&prepared))
}

/// A prepared job.
pub(super) struct Prepared<'a> {
    pub(super) work: TranslateContext<'a>,
    pub(super) source: &'a InputRecords<'a>,
}

impl Prepared<'_> {
    /// Writes the output; returns its files, and notes on points, one line each.
    pub(super) fn make(&self) -> Result<(SplitFiles, Vec<String>)> {
        let ground_input = self.work.job.ground_input(self.work.subset.is_some())?;
        self.work.run(self.source, ground_input.as_ref())
    }

    /// Writes the output and reports on it; the work began at `start`.
    pub(super) fn report(&self, start: Instant) -> Result<TranslateReport> {
        let (files, notes) = self.make()?;
        let TranslateContext { job, info, reprojection, converter, shares, .. } = &self.work;
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
            transformed: reprojection.map(|reprojection| Transformed::of(&reprojection.operation)),
            notes: [self.notes(), LostPoints::of(self.source.cloud()).notes().collect(), notes]
                .concat(),
        })
    }

    /// Notes on the point cloud and on its attributes, one line each.
    pub(super) fn notes(&self) -> Vec<String> {
        let TranslateContext { converter, reprojection, .. } = &self.work;
        let notes = self.source.cloud().notes().iter().chain(converter.notes());
        notes.chain(reprojection.iter().flat_map(|of| &of.notes)).cloned().collect()
    }

    /// Statistics of the whole point cloud for a plan: the noise and the ground.
    pub(super) fn scan(&self) -> Result<CloudKnowledge> {
        let (work, above) = (&self.work, &self.work.job.above);
        let ground_input = work.job.ground_input(false)?;
        let is_own = ground_input.is_none() || above.noise().is_some();
        let single = if is_own { work.single(self.source)? } else { None };
        let records = over(&single, self.source);
        let marked = work.mark(records)?;
        let mut noise = match &marked {
            Some(marked) => {
                let (own, notes) = (marked.noted(single.as_ref())?, marked.notes.clone());
                Some(Noise { own, ground: None, notes })
            }
            None => None,
        };
        let seen = match ground_input {
            Some(input) => Some(work.scan_ground_input(&input, noise.as_mut())?),
            None if above.is_requested() => {
                Some(work.ground_search().scan(over(&marked, records))?)
            }
            None => None,
        };
        Ok(CloudKnowledge { noise, seen })
    }
}

impl TranslateContext<'_> {
    /// Writes the selected records, and returns notes.
    fn run(
        &self,
        source: &dyn PointRecords,
        ground_input: Option<&GroundInput>,
    ) -> Result<(SplitFiles, Vec<String>)> {
        let (job, record) = (self.job, self.shares.flow.record);
        let single = self.single(source)?;
        let records = over(&single, source);
        let marked = self.mark(records)?;
        let records = over(&marked, records);
        let annotated = job.above.is_requested().then(|| self.annotate(records, ground_input));
        let annotated = annotated.transpose()?;
        let records = over(&annotated, records);
        let (assigning, cloud) = (self.assigning, self.input);
        let assigned = (!job.assign.is_empty()).then_some(AssignedRecords {
            records,
            assigning,
            record,
            cloud,
        });
        let records = over(&assigned, records);
        let lines = job.overlap.map(|overlap| self.lines(records, overlap)).transpose()?;
        let records = over(&lines, records);
        let thinned = job.thin.map(|thin| self.thin(records, thin)).transpose()?;
        let records = over(&thinned, records);
        let apart =
            job.distance.map(|distance| self.discs(distance).select(records)).transpose()?;
        let records = over(&apart, records);
        let reprojected = self.reprojection.map(|to| MovedRecords { records, to, record });
        let records = over(&reprojected, records);
        let sorted = job.sort.map(|by| self.sort(records, by)).transpose()?;
        let files = self.write(over(&sorted, records))?;
        let note = lines.iter().zip(job.overlap).map(|(lines, overlap)| {
            let (side, left_out) = (overlap.side(self.input_info), lines.left_out());
            format!("overlap: {left_out} points of other flight lines dropped, in cells of {side}")
        });
        let noise = marked.iter().flat_map(|marked| &marked.notes);
        let ground = annotated.iter().flat_map(|annotated| &annotated.notes);
        let mut notes: Vec<_> = noise.chain(ground).cloned().chain(note).collect();
        // Both may say that the unit is a guess.
        notes.dedup();
        Ok((files, notes))
    }
}

/// The reader of the points of a valid job.
pub(super) fn converter<'a>(
    job: &TranslateJob,
    cloud: &'a PointCloud,
) -> Result<PointFormatConverter<'a>> {
    let has_dimension = job.above.heights == Some(HeightsAs::Dimension);
    let converter = PointFormatConverter::new(cloud, job.target()?, has_dimension)?;
    job.check(converter.format(), job.packing()?, converter.info())?;
    Ok(converter)
}

/// Least memory for a part of a job with `points` points, and its part for a thread.
pub(super) fn min_memory(job: &TranslateJob, cloud: &PointCloud, points: u64) -> Result<[u64; 2]> {
    let converter = converter(job, cloud)?;
    let needed = job.needed(job.packing()?, converter.info(), points, true);
    Ok(TranslateMemory::min_memory(converter.size(), converter.extra_bytes(), needed))
}
