//! Lines and polygons in files.

use std::path::{Path, PathBuf};

use terrane_base::Result;
use terrane_jobs::line::LineOptions;
use terrane_jobs::operation::{AnyOperation, Call, Job, Request};
use terrane_jobs::options::FeatureInput;
use terrane_jobs::verify::{LineProof, Written};
use terrane_jobs::{Cancel, Progress};
use terrane_raster::Inputs;
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
/// assert!(lines.verify(&simpler).tolerance(0.1).run()?.verdict.passed);
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

    /// Simpler lines and rings; heights, measures, ids and properties are carried.
    pub fn simplify(&self) -> Job<'_, LineOptions> {
        let features = FeatureInput { layer: self.layer.clone() };
        let options = LineOptions { features, ..LineOptions::default() };
        Job::new(Inputs::from(self.path.clone()), options)
    }

    /// Runs one of the [`OPERATIONS`](crate::OPERATIONS) on features, with options by name, and tells its report as JSON.
    ///
    /// # Errors
    /// Options that there are not; else those of [`Job::write`].
    pub fn run(
        &self,
        operation: &AnyOperation,
        output: &Path,
        options: &serde_json::Map<String, serde_json::Value>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<serde_json::Value> {
        let inputs = &Inputs::from(self.path.clone());
        let reading = terrane_options::to_map(&FeatureInput { layer: self.layer.clone() });
        let request = Request { inputs, output, skipped: &[], is_measured: true, progress, cancel };
        (operation.run)(&Call { request, reading, options })
    }

    /// The proof of simplified lines in a file against these.
    pub fn verify(&self, lines: impl AsRef<Path>) -> Job<'_, LineProof, Written> {
        let features = FeatureInput { layer: self.layer.clone() };
        let (file, original) = (lines.as_ref().to_path_buf(), Inputs::from(self.path.clone()));
        Job::new(Written { file, original }, LineProof { features, ..LineProof::default() })
    }
}
