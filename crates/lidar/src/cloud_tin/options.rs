//! Options of meshes of clouds.

use std::path::Path;

use terrane_options::{OptionRange, OptionRule, Options};

use super::job::CloudTinJob;
use crate::points::{CloudStages, StagedCloud, StagedPlace};
use terrane_base::error::{Error, Result};
use terrane_cloud::CloudOpenOptions;
use terrane_engine::Resources;
use terrane_engine::local_frame::LocalFrame;
use terrane_engine::operation::RunRequest;
use terrane_engine::options::{CloudInput, Constraints, FileOutput, Resuming};
use terrane_engine::plan::RunControl;
use terrane_raster::Inputs;

/// Simplify a point cloud into a triangle mesh with a proven vertical error bound
///
/// The mesh is the Delaunay triangulation of a subset of the points and of anchor vertices on breaklines.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct CloudTinOptions {
    /// Maximum vertical distance of any point from the mesh, in the vertical unit of the data; 0 keeps all points
    #[option(value = "E", stands_for = "max_vertices", stands_for = "max_triangles", range = OptionRange::FROM_ZERO,
             heading = "Target")]
    pub max_error: Option<f64>,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Stages before.
    #[option(flatten)]
    pub stages: CloudStages,
    /// The mesh file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How the mesh lies in its file.
    #[option(flatten)]
    pub placing: LocalFrame,
    /// What stays.
    #[option(flatten)]
    pub constraints: Constraints,
    /// Where work is kept.
    #[option(flatten)]
    pub resuming: Resuming,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::OneOf(&["max_error"], "target"),
    OptionRule::NotWith("workdir", &["keep_degrees", "size", "scale", "exaggeration"]),
];

impl CloudTinOptions {
    /// Calls `act` with the job on some files, or on the points that stages make of them.
    ///
    /// # Errors
    /// No target; polygons that cannot be read; those of the stages and of `act`.
    pub(super) fn with_job<R>(
        &self,
        RunRequest { inputs, progress, cancel, .. }: RunRequest<'_>,
        output: &Path,
        place: StagedPlace<'_>,
        act: impl FnOnce(CloudTinJob) -> Result<R>,
    ) -> Result<(R, Vec<String>)> {
        let cloud = &self.cloud.options(&self.resources)?;
        let source = StagedCloud { inputs, cloud, has_ground_classes: false };
        let at = RunControl { progress, cancel };
        self.stages.before(source, place, &self.resources, at, |inputs, options| {
            act(CloudTinJob { options, ..self.unread(inputs, output)? })
        })
    }

    /// The job without its clip polygons.
    pub(super) fn unread(&self, inputs: &Inputs, output: &Path) -> Result<CloudTinJob> {
        let Some(max_error) = self.max_error else {
            return Err(Error::usage("no target given").remedy("pass ‹max_error›"));
        };
        Ok(CloudTinJob {
            inputs: inputs.clone(),
            options: CloudOpenOptions::default(),
            output: output.to_path_buf(),
            format: self.file.format.clone(),
            overwrite: self.file.replacing.overwrite,
            placing: self.placing,
            // Without the sign that a zero may have.
            tolerance: max_error.abs(),
            keep_points: self.constraints.keep_points.clone(),
            breaklines: self.constraints.breaklines.clone(),
            measure: true,
            resources: self.resources.clone(),
        })
    }
}
