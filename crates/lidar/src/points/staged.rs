//! Stages before an operation that is not one on points: they make a file that the operation reads.
//!
//! The file is that of `terrane points` with these stages. **Why a file:** the stages and the operation have the whole
//! memory one after the other, and an operation that reads the points several times runs the stages once.

use std::path::{Path, PathBuf};

use serde::Serialize;
use terrane_options::{OptionKind, OptionRule, Options};

use super::job::TranslateJob;
use super::pipeline;
use super::prepared::run;
use super::stages::{AnyStage, StageText};
use crate::grid::AsText;
use terrane_base::error::{ErrorKind, Result};
use terrane_cloud::{CloudFilter, CloudOpenOptions};
use terrane_engine::Resources;
use terrane_engine::made_input::MadeInput;
use terrane_engine::options::FileName;
use terrane_engine::plan::{self, RunControl};
use terrane_raster::Inputs;

terrane_engine::by_text!(AsText, OptionKind::Text, StageText);

/// File name of the points.
const POINTS: &str = "points.las";

/// Stages on points
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Stages", setters = group, rules = OF_STAGES)]
#[non_exhaustive]
pub struct CloudStages {
    /// Stage on points: NAME or NAME:ARGUMENTS, as listed by terrane points ‹help›. Repeatable; stages run in the order
    /// given, after filters; in terrane points also after other options, before points are sorted
    #[option(value = "STAGE", with = AsText)]
    pub stage: Vec<StageText>,
    /// JSON file of stages: a list of NAME:ARGUMENTS, or a PDAL pipeline of supported filters
    #[option(value = "FILE", with = FileName)]
    pub pipeline: Option<PathBuf>,
}

const OF_STAGES: &[OptionRule] = &[OptionRule::NotWith("stage", &["pipeline"])];

/// A point cloud to which stages are applied.
#[derive(Clone, Copy)]
pub struct StagedCloud<'a> {
    /// Files, folders, patterns or lists.
    pub inputs: &'a Inputs,
    /// How they are read.
    pub cloud: &'a CloudOpenOptions,
    /// Whether the classes of the filter select the ground of a model, and are applied after the stages.
    pub has_ground_classes: bool,
}

/// Where the points after the stages are kept.
#[derive(Clone, Debug)]
pub enum StagedPlace<'a> {
    /// In a temporary folder beside this output.
    Beside(&'a Path),
    /// In this folder, to be found there by a run that resumes.
    In(PathBuf),
}

impl StagedPlace<'_> {
    /// In the folder of a plan.
    ///
    /// # Errors
    /// A file, or a folder with other contents.
    pub(crate) fn of_plan(folder: &Path) -> Result<Self> {
        plan::refuse_file(folder)?;
        plan::refuse_others(folder)?;
        Ok(Self::In(folder.join(plan::POINTS)))
    }
}

/// What the points depend on.
#[derive(Serialize)]
struct StagedRequest<'a> {
    stages: &'a [AnyStage],
    cloud: &'a CloudOpenOptions,
}

impl CloudStages {
    /// The stages of both options.
    ///
    /// # Errors
    /// A file that is not a list of stages.
    pub(super) fn all(&self) -> Result<Vec<AnyStage>> {
        let pipeline = self.pipeline.as_deref().map(pipeline::read).transpose()?;
        let stages = self.stage.iter().map(|stage| stage.stage().clone());
        Ok(stages.chain(pipeline.into_iter().flatten()).collect())
    }

    /// Calls `act` with the point cloud, or with the file of its points after the stages; returns the result, and notes
    /// on the stages.
    ///
    /// # Errors
    /// As [`run`]; the errors of `act`.
    pub fn before<R>(
        &self,
        source: StagedCloud<'_>,
        place: StagedPlace<'_>,
        resources: &Resources,
        at: RunControl<'_>,
        act: impl FnOnce(&Inputs, CloudOpenOptions) -> Result<R>,
    ) -> Result<(R, Vec<String>)> {
        let StagedCloud { inputs, cloud, has_ground_classes } = source;
        let stages = self.all()?;
        if stages.is_empty() {
            return Ok((act(inputs, cloud.clone())?, Vec::new()));
        }
        let (mut own, mut rest) = (cloud.clone(), CloudFilter::default());
        rest.keep_withheld = own.filter.keep_withheld;
        if has_ground_classes {
            rest.classes = own.filter.classes.take();
        }
        let make = |path: &Path| {
            let job = TranslateJob {
                cloud: own.clone(),
                resources: resources.clone(),
                overwrite: true,
                ..TranslateJob::new(inputs.names().to_vec(), path)
            };
            let report = run(&job.stages(stages.clone()), at.progress, at.cancel);
            let report = report.map_err(|error| match error.kind() {
                ErrorKind::Resource => {
                    error.at("the stages (the operation after them may need more)")
                }
                _ => error,
            })?;
            let read = report.census.unwrap_or_default().read;
            let note = format!("stages: {} of {read} points", report.points);
            Ok([vec![note], report.notes].concat())
        };
        // The surface is not one of all points.
        let label = format!("{} (after stages)", MadeInput::label(inputs));
        let made = match place {
            StagedPlace::Beside(output) => {
                MadeInput::temporary(label, output, POINTS, resources, make)
            }
            StagedPlace::In(folder) => {
                let request = StagedRequest { stages: &stages, cloud: &own };
                let beside = stages.iter().flat_map(|stage| stage.stage().files()).collect();
                MadeInput::in_folder(label, inputs, beside, &folder, POINTS, &request, make)
            }
        }?;
        let cloud = CloudOpenOptions { filter: rest, threads: own.threads, ..Default::default() };
        let result = act(&made.inputs, cloud).map_err(|error| made.renamed(error))?;
        Ok((result, made.notes))
    }
}
