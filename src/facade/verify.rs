//! Proofs of what was written, by code that shares nothing with what wrote it.

use std::path::{Path, PathBuf};

use super::cloud::Cloud;
use super::features::Features;
use super::grid::Grid;
use super::run::{Run, run_settings};
use terrane_base::Result;
use terrane_base::bound::Bound;
use terrane_files::name_of;
use terrane_jobs::line::Length;
use terrane_jobs::options::GridInput;
use terrane_jobs::verify::{
    self, CloudVerifyJob, CloudVerifyReport, LineVerifyJob, LineVerifyReport, VerifyJob,
    VerifyReport,
};
use terrane_raster::Inputs;

/// A proof to be done: of a mesh against a [`Grid`] or [`Cloud`], or of simplified lines against the
/// [`Features`] they were made from.
///
/// A broken promise is no error, but a report: its `verdict` has not `passed`, and its `failures` say what and
/// where; `judged` is true when all that is promised was looked at.
pub struct VerifyBuilder<'a, T> {
    pub(super) against: &'a T,
    file: PathBuf,
    tolerance: Option<f64>,
    /// Metres in the unit of the tolerance; `None` for units of the data.
    unit: Option<f64>,
    bound: Option<Bound>,
    min_angle: Option<f64>,
    keep_points: Option<PathBuf>,
    breaklines: Option<PathBuf>,
    topology: bool,
    pub(super) run: Run,
}

run_settings!(['a, T] VerifyBuilder<'a, T>);

impl<'a, T> VerifyBuilder<'a, T> {
    pub(super) fn of(against: &'a T, file: &Path) -> Self {
        let run = Run::default();
        let file = file.to_owned();
        Self {
            against,
            file,
            tolerance: None,
            unit: None,
            bound: None,
            min_angle: None,
            keep_points: None,
            breaklines: None,
            topology: false,
            run,
        }
    }

    /// The largest distance allowed, in units of the data (of meshes: of their heights). Meshes of terrane state theirs, lines do not; without one errors are
    /// measured and not judged.
    pub fn max_error(mut self, tolerance: f64) -> Self {
        (self.tolerance, self.unit) = (Some(tolerance), None);
        self
    }

    /// The job of proving a mesh against a grid, as far as builders say it alike.
    pub(super) fn mesh_job(&self, raster: &Inputs, reading: &GridInput) -> Result<VerifyJob> {
        let name = |file: &Option<PathBuf>| file.clone().map(name_of).transpose();
        Ok(VerifyJob {
            mesh: self.file.clone(),
            raster: raster.clone(),
            reading: reading.clone(),
            tolerance: self.tolerance,
            bound: self.bound,
            min_angle: self.min_angle,
            keep_points: name(&self.keep_points)?,
            breaklines: name(&self.breaklines)?,
            bands: None,
            resources: self.run.resources()?,
        })
    }
}

impl VerifyBuilder<'_, Grid> {
    /// What the largest distance is of: samples, or all lines between neighbouring ones. Meshes of terrane
    /// state theirs; what states none is held to it at samples. The report has the error of both.
    pub fn bound(mut self, bound: Bound) -> Self {
        self.bound = Some(bound);
        self
    }

    /// The smallest angle that triangles may have in plan, in degrees. Meshes of terrane that were made with one
    /// state it; what states none is not held to any.
    pub fn min_angle(mut self, degrees: f64) -> Self {
        self.min_angle = Some(degrees);
        self
    }

    /// Samples that have to be vertices: the nearest one to each point of a file of features, as the mesh was
    /// made with. Of a mesh that states such a file, it is not judged without it whether they are.
    pub fn keep_points(mut self, file: impl Into<PathBuf>) -> Self {
        self.keep_points = Some(file.into());
        self
    }

    /// Lines and polygons that edges have to follow, as the mesh was made with. Of a mesh that states such a file,
    /// it is not judged without it whether they do.
    pub fn breaklines(mut self, file: impl Into<PathBuf>) -> Self {
        self.breaklines = Some(file.into());
        self
    }

    /// Proves the mesh.
    ///
    /// # Errors
    /// What keeps the proof from being done: files that cannot be read, a solid, too little memory.
    pub fn run(self) -> Result<VerifyReport> {
        let job = self.mesh_job(&self.against.inputs, &self.against.reading)?;
        verify::run(&job, &*self.run.progress, &self.run.cancel)
    }
}

impl VerifyBuilder<'_, Cloud> {
    /// Points that have to be vertices: the nearest one to each point of a file of features, as the mesh was made
    /// with. Of a mesh that states such a file, it is not judged without it whether they are.
    pub fn keep_points(mut self, file: impl Into<PathBuf>) -> Self {
        self.keep_points = Some(file.into());
        self
    }

    /// Lines and polygons that edges have to follow, as the mesh was made with. Of a mesh that states such a file,
    /// it is not judged without it whether they do, and whether vertices are points.
    pub fn breaklines(mut self, file: impl Into<PathBuf>) -> Self {
        self.breaklines = Some(file.into());
        self
    }

    /// Proves the mesh.
    ///
    /// # Errors
    /// What keeps the proof from being done: files that cannot be read, a solid, too little memory.
    pub fn run(self) -> Result<CloudVerifyReport> {
        let job = CloudVerifyJob {
            mesh: self.file,
            inputs: self.against.inputs.clone(),
            options: self.against.options.clone(),
            tolerance: self.tolerance,
            keep_points: self.keep_points.map(name_of).transpose()?,
            breaklines: self.breaklines.map(name_of).transpose()?,
            resources: self.run.resources()?,
        };
        verify::verify_cloud(&job, &*self.run.progress, &self.run.cancel)
    }
}

impl VerifyBuilder<'_, Features> {
    /// The largest distance allowed, in metres: on the ellipsoid where the data are longitudes and latitudes.
    pub fn metres(mut self, tolerance: f64) -> Self {
        (self.tolerance, self.unit) = (Some(tolerance), Some(1.0));
        self
    }

    /// Judge crossings, rings and shared borders, too.
    pub fn topology(mut self, topology: bool) -> Self {
        self.topology = topology;
        self
    }

    /// Proves the lines.
    ///
    /// # Errors
    /// What keeps the proof from being done: files that cannot be read or compared, too little memory.
    pub fn run(self) -> Result<LineVerifyReport> {
        let job = LineVerifyJob {
            lines: self.file,
            original: self.against.path.clone(),
            layer: self.against.layer.clone(),
            tolerance: self.tolerance.map(|value| Length { value, unit: self.unit }),
            is_space: false,
            topology: self.topology,
            may_drop: false,
            sides: None,
            resources: self.run.resources()?,
        };
        verify::verify_lines(&job, &*self.run.progress, &self.run.cancel)
    }
}
