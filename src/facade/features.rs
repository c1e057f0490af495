//! Lines and polygons in files.

use std::path::{Path, PathBuf};

use super::run::{Run, System, output_settings, run_settings, system_settings};
use super::simplify::Method;
use super::verify::VerifyBuilder;
use terrane_base::{Error, Result};
use terrane_jobs::line::{self, Goal, Length, LineJob, LineReport, Topology};
use terrane_vector::{self as vector, OpenOptions};

/// Features in a file: points, lines and polygons. Nothing of them is held.
pub struct Features {
    pub(super) path: PathBuf,
    pub(super) layer: Option<String>,
}

/// Opens a file of features: GeoJSON, FlatGeobuf, Shapefile, TopoJSON, GPX, CSV or WKT.
///
/// # Errors
/// A file that is missing, damaged at its beginning, or of no known format.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("line.wkt");
/// # std::fs::write(&path, "LINESTRING(0 0, 1 0.01, 2 0)\n").unwrap();
/// # let simpler = folder.path().join("simpler.geojson");
/// let lines = terrane::open_features(&path)?;
/// let report = lines.simplify().tolerance(0.1).write(&simpler)?;
/// assert_eq!((report.vertices, report.kept), (3, 2));
/// assert!(lines.verify(&simpler).max_error(0.1).run()?.verdict.passed);
/// # Ok(())
/// # }
/// ```
pub fn open_features(path: impl AsRef<Path>) -> Result<Features> {
    Features { path: path.as_ref().to_owned(), layer: None }.checked()
}

impl Features {
    fn checked(self) -> Result<Self> {
        vector::open(&self.path, &OpenOptions { layer: self.layer.clone() })?;
        Ok(self)
    }

    /// This object of a TopoJSON file, instead of its first one.
    ///
    /// # Errors
    /// An object there is not.
    pub fn layer(self, name: impl Into<String>) -> Result<Self> {
        Self { layer: Some(name.into()), ..self }.checked()
    }

    /// Simpler lines and rings.
    pub fn simplify(&self) -> LineBuilder<'_> {
        LineBuilder {
            of: self,
            goal: None,
            method: Method::default(),
            topology: None,
            format: None,
            decimals: None,
            system: System::default(),
            run: Run::default(),
        }
    }

    /// The proof of simplified lines in a file against these.
    pub fn verify(&self, lines: impl AsRef<Path>) -> VerifyBuilder<'_, Features> {
        VerifyBuilder::of(self, lines.as_ref())
    }
}

/// Simpler lines to be made. Heights, measures, ids and properties are carried.
pub struct LineBuilder<'a> {
    of: &'a Features,
    goal: Option<Goal>,
    method: Method,
    topology: Option<Topology>,
    format: Option<String>,
    decimals: Option<u8>,
    system: System,
    run: Run,
}

run_settings!([] LineBuilder<'_>);
output_settings!([] LineBuilder<'_>);
system_settings!([] LineBuilder<'_>);

impl LineBuilder<'_> {
    /// No vertex further than this from the segment in its place, in units of the data.
    pub fn tolerance(mut self, distance: f64) -> Self {
        self.goal = Some(Goal::Tolerance(Length { value: distance, unit: None }));
        self
    }

    /// The same in metres, on the ellipsoid where the data are longitudes and latitudes.
    pub fn metres(mut self, distance: f64) -> Self {
        self.goal = Some(Goal::Tolerance(Length { value: distance, unit: Some(1.0) }));
        self
    }

    /// No triangle of a smaller effective area than this, for methods that go by area.
    pub fn area(mut self, area: f64) -> Self {
        self.goal = Some(Goal::Area(area));
        self
    }

    /// At most this share of the vertices, from 0 to 1.
    pub fn keep_ratio(mut self, share: f64) -> Self {
        self.goal = Some(Goal::Ratio(share));
        self
    }

    /// At most so many vertices.
    pub fn keep_count(mut self, count: u64) -> Self {
        self.goal = Some(Goal::Count(count));
        self
    }

    /// How vertices are chosen; the cone unless told otherwise.
    pub fn method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// Look at neighbours: no line comes to cross itself or another, and borders that are shared stay so.
    pub fn topology(mut self, topology: bool) -> Self {
        self.topology = topology.then(Topology::default);
        self
    }

    /// Round positions to so many digits behind the point; with topology vertices keep theirs where lines
    /// would touch, cross or change sides.
    pub fn decimals(mut self, digits: u8) -> Self {
        self.decimals = Some(digits);
        self
    }

    /// Simplifies and writes, within the memory allowed.
    ///
    /// # Errors
    /// No goal, or one that the method does not have or that cannot be met; damage in the file, with its
    /// place; too little memory; an output that exists, cannot be written or does not hold the features; a
    /// system that nothing is known to lead to; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<LineReport> {
        let none = || Error::usage("the lines have nothing to reach").remedy("say .tolerance(...)");
        let job = LineJob {
            layer: self.of.layer.clone(),
            method: self.method.entry(),
            topology: self.topology,
            transform: self.system.transform()?,
            format: self.format,
            decimals: self.decimals,
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..LineJob::new(&self.of.path, path.into(), self.goal.ok_or_else(none)?)
        };
        line::run(&job, &*self.run.progress, &self.run.cancel)
    }
}
