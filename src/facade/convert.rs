//! Grids from format to format.

use std::path::PathBuf;

use super::grid::Grid;
use super::run::{Run, output_settings, run_settings};
use terrane_base::Result;
use terrane_jobs::convert::{self, ConvertJob, ConvertReport};
use terrane_jobs::reading::Reading;
use terrane_raster::SampleType;

/// A copy of a grid to be made, exact unless [rounding](Self::round) is allowed.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("copy.tif");
/// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
/// dem.convert().write(&path)?;
/// let copy = terrane::open(&path)?;
/// assert_eq!(copy.heights(copy.info().bounds())?, dem.heights(dem.info().bounds())?);
/// # Ok(())
/// # }
/// ```
pub struct ConvertBuilder<'a> {
    grid: &'a Grid,
    format: Option<String>,
    creation: Vec<(String, String)>,
    bounds: Option<[f64; 4]>,
    sample_type: Option<SampleType>,
    round: bool,
    run: Run,
}

run_settings!([] ConvertBuilder<'_>);
output_settings!([] ConvertBuilder<'_>);

impl<'a> ConvertBuilder<'a> {
    pub(super) fn of(grid: &'a Grid) -> Self {
        Self {
            grid,
            format: None,
            creation: Vec::new(),
            bounds: None,
            sample_type: None,
            round: false,
            run: Run::default(),
        }
    }

    /// A creation option of the format, such as `COMPRESS`, `DEFLATE`.
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.creation.push((key.into(), value.into()));
        self
    }

    /// Only the cells that the box (x low, y low, x high, y high) overlaps.
    pub fn bounds(mut self, bounds: [f64; 4]) -> Self {
        self.bounds = Some(bounds);
        self
    }

    /// Type of the written samples; the grid's own, or what the format holds, unless told otherwise.
    pub fn sample_type(mut self, sample_type: SampleType) -> Self {
        self.sample_type = Some(sample_type);
        self
    }

    /// Write the nearest value where the type does not hold a height exactly, instead of failing.
    pub fn round(mut self, round: bool) -> Self {
        self.round = round;
        self
    }

    /// Copies the grid, within the memory allowed.
    ///
    /// # Errors
    /// A height that the type does not hold; damage in the grid; too little memory; an output that exists or
    /// cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<ConvertReport> {
        let job = ConvertJob {
            format: self.format,
            creation: self.creation,
            reading: Reading {
                bbox: self.bounds.or(self.grid.reading.bbox),
                ..self.grid.reading.clone()
            },
            sample_type: self.sample_type,
            round: self.round,
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..ConvertJob::new(self.grid.inputs.clone(), path.into())
        };
        convert::run(&job, &*self.run.progress, &self.run.cancel)
    }
}
