//! A cloud-to-TIN job, and its report.

use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_cloud::{CloudOpenOptions, PointSource, ReturnCounts};
use terrane_engine::Resources;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::constraints::RequiredPointsReport;
use terrane_engine::local_frame::{LocalFrame, StorageScale};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_mesh::{self as mesh, MeshFormat};
use terrane_raster::Inputs;
use terrane_terrain::tin::{FlawReport, StageReport};

/// A cloud-to-TIN job.
#[derive(Clone, Debug)]
pub struct CloudTinJob {
    /// Files, folders, patterns or lists.
    pub inputs: Inputs,
    /// Filters and reading options.
    pub options: CloudOpenOptions,
    /// Mesh file to write.
    pub output: PathBuf,
    /// Mesh format by name; by the output's extension when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// Placement in formats with model coordinates.
    pub placing: LocalFrame,
    /// Largest vertical distance of any point from the mesh; 0 keeps every point.
    pub tolerance: f64,
    /// File of features: the nearest point of the point cloud to each of its points is a vertex.
    pub keep_points: Option<String>,
    /// File of lines and polygons that edges follow.
    pub breaklines: Option<String>,
    /// Measure largest error and RMSE for the report.
    pub measure: bool,
    /// Resources of the job.
    pub resources: Resources,
}

impl CloudTinJob {
    /// A job without constraints.
    pub fn new(
        inputs: impl Into<Inputs>,
        output: PathBuf,
        tolerance: f64,
        resources: Resources,
    ) -> Self {
        Self {
            inputs: inputs.into(),
            options: CloudOpenOptions { threads: resources.threads, ..CloudOpenOptions::default() },
            output,
            format: None,
            overwrite: false,
            placing: LocalFrame::default(),
            tolerance,
            keep_points: None,
            breaklines: None,
            measure: false,
            resources,
        }
    }

    /// Name of the inputs for the user.
    pub(super) fn label(&self) -> String {
        self.inputs.label().map_or_else(|| self.inputs.names().join(" "), str::to_owned)
    }

    /// Fails for an invalid tolerance.
    pub(super) fn check(&self) -> Result<()> {
        match self.tolerance >= 0.0 && self.tolerance.is_finite() {
            true => Ok(()),
            false => Err(Error::usage(format!("{} is not a valid maximum error", self.tolerance))
                .remedy("pass a number of 0 or more, in the unit of the heights")),
        }
    }

    /// The format to write.
    pub(super) fn format(&self) -> Result<&'static MeshFormat> {
        mesh::by_path(&self.output, self.format.as_deref())
    }
}

/// What a cloud-to-TIN job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct CloudTinReport {
    pub input: String,
    pub output: String,
    pub format: String,
    pub files: u64,
    pub crs: String,
    pub horizontal_unit: String,
    pub vertical_unit: String,
    pub tolerance: f64,
    /// Largest error of any point, when measured.
    pub max_error: Option<f64>,
    /// Root mean square error, when measured.
    pub rmse: Option<f64>,
    pub points: ReturnCounts,
    /// Points above another one at the same position; they are not constrained.
    pub stacked_points: u64,
    /// Report on points to keep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<RequiredPointsReport>,
    /// Report on breaklines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<BreaklinesReport>,
    /// Vertices on breaklines without an edge along them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apart: Option<FlawReport>,
    pub vertices: u64,
    pub triangles: u64,
    /// Vertices for each point that was kept.
    pub kept: f64,
    pub output_bytes: u64,
    /// Name of the .prj file beside the mesh, if one was written.
    pub prj: Option<String>,
    /// Placement in the file, if the format has model coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placed: Option<StorageScale>,
    pub regions: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub points_per_second: f64,
    pub stages: Vec<StageReport>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

impl CloudTinReport {
    /// Adds properties of the whole point cloud, and the time since `started`.
    pub(super) fn of_source(
        &mut self,
        source: &dyn PointSource,
        losses: &LostPoints,
        started: Instant,
    ) {
        self.files = source.files().len() as u64;
        self.notes.extend_from_slice(source.notes());
        self.notes.extend(losses.notes());
        self.notes.extend(source.info().crs.lost_in_wkt());
        self.run.wall_seconds = started.elapsed().as_secs_f64();
        self.points_per_second = self.run.rate(self.points.read);
    }

    /// Requirements that the mesh does not meet, as text.
    pub fn shortfall(&self) -> Option<String> {
        let FlawReport { count, first } = self.apart?;
        let [x, y] = first?;
        Some(format!(
            "{count} vertices on breaklines have no edge along them, the first one at x {x}, y {y}"
        ))
    }
}
