//! Contour lines of grids.

use std::path::PathBuf;

use super::grid::Grid;
use super::run::{Run, System, output_settings, run_settings, system_settings};
use terrane_base::{Error, Result};
use terrane_jobs::contour::{self, ContourJob, ContourReport, Heights};
use terrane_jobs::line::Length;

/// Contour lines to be made: at every interval or at given heights, joined across tiles, voids respected.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("contours.geojson");
/// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
/// let report = dem.contours().every(20.0).write(&path)?;
/// assert!(report.levels > 0);
/// let path = folder.path().join("degrees.geojson");
/// let report = dem.contours().every(20.0).to_crs("EPSG:4326").write(&path)?;
/// assert_eq!(report.transformed.unwrap().crs, "EPSG:4326 (WGS 84)");
/// # Ok(())
/// # }
/// ```
pub struct ContourBuilder<'a> {
    grid: &'a Grid,
    heights: Option<Heights>,
    tolerance: Option<f64>,
    with_z: bool,
    format: Option<String>,
    system: System,
    run: Run,
}

run_settings!([] ContourBuilder<'_>);
output_settings!([] ContourBuilder<'_>);
system_settings!([] ContourBuilder<'_>);

impl<'a> ContourBuilder<'a> {
    pub(super) fn of(grid: &'a Grid) -> Self {
        let (system, run) = (System::default(), Run::default());
        Self { grid, heights: None, tolerance: None, with_z: false, format: None, system, run }
    }

    /// At multiples of this height.
    pub fn every(mut self, interval: f64) -> Self {
        self.heights = Some(Heights::Every { interval, base: 0.0 });
        self
    }

    /// At these heights.
    pub fn at(mut self, heights: impl Into<Vec<f64>>) -> Self {
        self.heights = Some(Heights::List(heights.into()));
        self
    }

    /// Leave out vertices within this distance of the line that is left, in units of the grid, so that no two
    /// lines come to cross.
    pub fn simplify(mut self, tolerance: f64) -> Self {
        self.tolerance = Some(tolerance);
        self
    }

    /// Give each vertex the height of its line as z.
    pub fn with_z(mut self, with_z: bool) -> Self {
        self.with_z = with_z;
        self
    }

    /// Makes the lines and writes them as features, within the memory allowed.
    ///
    /// # Errors
    /// No heights, or an interval that is none; damage in the grid; too little memory; an output that exists,
    /// cannot be written or holds no lines; a system that nothing is known to lead to; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<ContourReport> {
        let none = || Error::usage("no heights of lines are given").remedy("say .every(...)");
        let job = ContourJob {
            reading: self.grid.reading.clone(),
            transform: self.system.transform()?,
            format: self.format,
            overwrite: self.run.overwrite,
            tolerance: self.tolerance.map(|value| Length { value, unit: None }),
            with_z: self.with_z,
            resources: self.run.resources()?,
            ..ContourJob::new(self.grid.inputs.clone(), path.into(), self.heights.ok_or_else(none)?)
        };
        contour::run(&job, &*self.run.progress, &self.run.cancel)
    }
}
