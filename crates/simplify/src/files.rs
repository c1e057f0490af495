//! Files of a job: opened, paired with their outputs, and checked for a common CRS.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::goal::{LineGoal, measured};
use super::job::LineJob;
use super::report::LineReport;
use super::tool::{DistanceKind, SimplifyRule};
use terrane_base::error::{Error, Result, all};
use terrane_base::geom::Crs;
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::{self, FeatureReprojection, PositionExtent, Transformed};
use terrane_files::atomic;
use terrane_vector::{
    self as vector, FeatureSink, FeatureSource, LayerHeader, VectorFormat, VectorOpenOptions,
    VectorWriteOptions, WrittenFeatures,
};

/// An input and its output.
pub(super) struct LineFilePair {
    pub(super) input: PathBuf,
    pub(super) output: PathBuf,
    format: &'static VectorFormat,
    /// Transformation to the output CRS, if it differs.
    operation: Option<Arc<CoordinateOperation>>,
}

/// Inputs and outputs of a job.
pub(super) struct LineFiles {
    pub(super) pairs: Vec<LineFilePair>,
    /// Common CRS of the inputs.
    pub(super) crs: Crs,
}

impl LineFiles {
    /// Pairs the inputs of a job with outputs, and reads their headers.
    pub(super) fn of(job: &LineJob) -> Result<Self> {
        let mut pairs = pairs(job)?;
        let mut names: Vec<_> = pairs.iter().map(|pair| &pair.output).collect();
        names.sort();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::usage("two inputs have the same output file")
                .in_file(twice[0])
                .remedy("rename one of them, or simplify them one at a time"));
        }
        let systems = pairs.iter().map(|pair| Ok(pair.open(job)?.layer().crs.clone()));
        let mut crs: Option<Crs> = None;
        for (pair, own) in pairs.iter().zip(all(systems.collect())?) {
            match &crs {
                None => crs = Some(own),
                Some(first) if first.agrees(&own) => {}
                Some(first) => {
                    let [ours, theirs] = first.distinct_names(&own);
                    let message =
                        format!("CRS is {theirs}, but {} has {ours}", pairs[0].input.display());
                    return Err(Error::bad_input(message)
                        .in_file(&pair.input)
                        .remedy("transform the files to one CRS"));
                }
            }
        }
        let crs = crs.unwrap_or_default();
        if let Some(transform) = &job.transform {
            let operation = Arc::new(transform.operation(
                &pairs[0].input,
                &crs,
                extent(job, &pairs)?,
                &job.resources,
            )?);
            pairs.iter_mut().for_each(|pair| pair.operation = Some(operation.clone()));
        }
        Ok(Self { pairs, crs })
    }

    /// Adds the transformation to a report.
    pub(super) fn note_operation(&self, report: &mut LineReport) {
        let operation = self.pairs.first().and_then(|pair| pair.operation.as_ref());
        report.transformed = operation.map(|own| Transformed::of(own));
        report.notes.extend(operation.iter().flat_map(|own| own.notes().iter().cloned()));
    }

    /// Rule of a job with a given threshold, or with `threshold`.
    pub(super) fn rule(&self, job: &LineJob, threshold: f64) -> Result<SimplifyRule> {
        let plain = if job.is_space { DistanceKind::Space } else { DistanceKind::Plane };
        let (measure, threshold) = match job.goal {
            LineGoal::Tolerance(length) => measured(length, job.is_space, &self.crs)?,
            LineGoal::Area(area) => (plain, area),
            _ => (plain, threshold),
        };
        Ok(SimplifyRule { method: job.method, measure, threshold, collapse: job.collapse })
    }
}

/// Bounds of all features, from the features because headers may be wrong.
fn extent(job: &LineJob, pairs: &[LineFilePair]) -> Result<Option<[f64; 4]>> {
    let mut extent = PositionExtent::NONE;
    for pair in pairs {
        let mut source = pair.open(job)?;
        while let Some(mut feature) = source.next()? {
            feature
                .geometry
                .for_each_leaf(&mut |leaf| leaf.xy.iter().for_each(|at| extent.add(*at)));
        }
    }
    Ok(extent.get())
}

/// Output files of a job, without their sidecar files.
///
/// # Errors
/// No input; a format that is unknown or cannot be written.
pub fn outputs(job: &LineJob) -> Result<Vec<PathBuf>> {
    Ok(pairs(job)?.into_iter().map(|pair| pair.output).collect())
}

fn pairs(job: &LineJob) -> Result<Vec<LineFilePair>> {
    match job.input.as_slice() {
        [] => Err(Error::usage("no input file")),
        [input] if !job.is_into_folder() => Ok(vec![LineFilePair {
            input: input.clone(),
            output: job.output.clone(),
            format: vector::by_path(&job.output, job.format.as_deref())?,
            operation: None,
        }]),
        many => all(many.iter().map(|input| in_folder(job, input)).collect()),
    }
}

/// An input with its output of the same name in the job's folder.
fn in_folder(job: &LineJob, input: &Path) -> Result<LineFilePair> {
    let name = input
        .file_name()
        .ok_or_else(|| Error::usage("is not a file").in_file(input).remedy("name vector files"))?;
    let mut output = job.output.join(name);
    let format = match &job.format {
        Some(name) => vector::by_path(&output, Some(name))?,
        None => vector::identify(input)?.map_or_else(|| vector::by_path(input, None), Ok)?,
    };
    if format.create.is_none() {
        return Err(Error::usage(format!("{} can be read, but not written", format.name))
            .in_file(input)
            .remedy("choose another ‹format›"));
    }
    if job.format.is_some() {
        output.set_extension(format.extensions[0]);
    }
    Ok(LineFilePair { input: input.to_path_buf(), output, format, operation: None })
}

impl LineFilePair {
    /// Opens the input.
    pub(super) fn open(&self, job: &LineJob) -> Result<Box<dyn FeatureSource>> {
        vector::open(
            &self.input,
            &VectorOpenOptions { layer: job.layer.clone(), ..Default::default() },
        )
    }

    /// Starts the output.
    pub(super) fn create(
        &self,
        job: &LineJob,
        layer: &LayerHeader,
    ) -> Result<Box<dyn FeatureSink>> {
        if let Some(folder) = self.output.parent().filter(|_| job.is_into_folder()) {
            atomic::create_folders(folder)?;
        }
        self.create_at(&self.output, job, layer)
    }

    /// Creates a file like the output in another folder, with the final name, which some formats store in the
    /// file.
    pub(super) fn create_in(
        &self,
        folder: &Path,
        job: &LineJob,
        layer: &LayerHeader,
    ) -> Result<Box<dyn FeatureSink>> {
        let name = self.output.file_name().unwrap_or_default();
        self.create_at(&folder.join(name), job, layer)
    }

    fn create_at(
        &self,
        path: &Path,
        job: &LineJob,
        layer: &LayerHeader,
    ) -> Result<Box<dyn FeatureSink>> {
        let options = VectorWriteOptions {
            overwrite: job.overwrite,
            decimals: job.decimals,
            lines_are_rounded: job.topology.is_some(),
            temp_dir: job.resources.temp_dir.clone(),
            ..VectorWriteOptions::default()
        };
        // The header of the input is not valid for the output.
        let mut layer = LayerHeader { extent: None, ..layer.clone() };
        let Some(operation) = &self.operation else {
            return vector::create(path, self.format, &layer, &options);
        };
        layer.crs = operation.target().clone();
        layer.foreign.retain(transform::stays);
        let inner = vector::create(path, self.format, &layer, &options)?;
        Ok(Box::new(FeatureReprojection { inner, operation: operation.clone() }))
    }

    /// Size of the input in bytes, if it is a file.
    pub(super) fn size(&self) -> u64 {
        std::fs::metadata(&self.input).map_or(0, |meta| meta.len())
    }
}

/// Adds the written data to a report.
pub(super) fn note(report: &mut LineReport, written: WrittenFeatures, notes: Vec<String>) {
    report.output_bytes += written.bytes;
    report.outputs.extend(written.files.first().map(|path| path.display().to_string()));
    for note in notes.into_iter().chain(written.notes) {
        if !report.notes.contains(&note) {
            report.notes.push(note);
        }
    }
}
