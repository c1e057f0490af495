//! Options of reports on the quality of point clouds.

use std::path::{Path, PathBuf};

use terrane_options::{OptionRange, Options};

use super::index::{IndexFormat, written_files};
use super::job::QaJob;
use super::report::QaReport;
use terrane_base::error::Result;
use terrane_cloud as clouds;
use terrane_engine::Resources;
use terrane_engine::operation::{Operation, RunRequest, Writes, read_beside};
use terrane_engine::options::{CloudInput, FileName, Replacing};
use terrane_engine::outputs::{check_ending, not_among};

/// Report on the quality of a point cloud: density, voids, flight lines and headers, as one self-contained HTML file
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct QaOptions {
    /// Cell size of densities, voids, flight lines and footprints, in units of x and y
    #[option(
        value = "SIZE",
        range = OptionRange::POSITIVE,
        heading = "Report",
        default_text = "four times the point spacing, rounded up to 1, 2 or 5 times a power of ten"
    )]
    pub cell: Option<f64>,
    /// Required density of pulses (last returns), per square unit of x and y, or square metre where these are degrees
    #[option(value = "DENSITY", range = OptionRange::POSITIVE, heading = "Report")]
    pub min_density: Option<f64>,
    /// Smallest area of a void to count, in square units of x and y, or square metres where these are degrees
    #[option(
        value = "AREA",
        range = OptionRange::POSITIVE,
        heading = "Report",
        default_text = "a cell"
    )]
    pub min_void: Option<f64>,
    /// Compare flight lines only in cells where the height range of each is at most this
    #[option(
        value = "RANGE",
        range = OptionRange::POSITIVE,
        heading = "Report",
        default_text = "a tenth of the cell size"
    )]
    pub max_range: Option<f64>,
    /// Write a tile index with the footprint and attributes of each input: GeoJSON, FlatGeobuf, Shapefile or another
    /// format of features by its extension, or a Virtual Point Cloud (.vpc)
    #[option(value = "FILE", with = FileName, heading = "Report")]
    pub index: Option<PathBuf>,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

impl Operation for QaOptions {
    const NAME: &'static str = "qa";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Report;
    type Report = QaReport;

    fn check(&self, output: &Path) -> Result<()> {
        check_ending(output, &["html", "htm"], "a report")?;
        let Some(index) = &self.index else { return Ok(()) };
        IndexFormat::of(index).map(drop)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<QaReport> {
        if let Some(index) = &self.index {
            let read = [clouds::files(request.inputs.names())?, read_beside(self)?].concat();
            let written = written_files(index);
            let written = written.iter().map(PathBuf::as_path).chain([request.output]);
            not_among(&read, &written.collect::<Vec<_>>())?;
        }
        QaJob { options: self, request }.run()
    }
}
