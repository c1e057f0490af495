//! Lines and polygons in files.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_engine::Resources;
use terrane_engine::operation::{HasGroup, Job};
use terrane_engine::options::FeatureInput;
use terrane_engine::proof::WrittenOutput;
use terrane_options::{Options, to_map};
use terrane_raster::Inputs;
use terrane_simplify::LineOptions;
use terrane_vector::{self as vector, VectorOpenOptions};
use terrane_verify::LineProof;

use super::Data;

/// Features in a file: points, lines and polygons. No features are held in memory.
pub struct Features {
    pub(super) path: PathBuf,
    pub(super) layer: Option<String>,
}

/// Opens a vector file: GeoJSON, FlatGeobuf, Shapefile, TopoJSON, GPX, CSV or WKT.
///
/// # Errors
/// A missing file, a damaged header, or an unknown format.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
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
        vector::open(
            &self.path,
            &VectorOpenOptions { layer: self.layer.clone(), ..Default::default() },
        )?;
        Ok(self)
    }

    /// Selects an object of a TopoJSON file, instead of the first.
    ///
    /// # Errors
    /// An unknown object.
    pub fn layer(self, name: impl Into<String>) -> Result<Self> {
        Self { layer: Some(name.into()), ..self }.checked()
    }

    /// Simplified lines and rings; heights, measures, ids and properties are kept.
    pub fn simplify(&self) -> Job<'_, LineOptions> {
        self.job()
    }

    pub(super) fn job<O: Options + HasGroup<FeatureInput> + HasGroup<Resources>>(
        &self,
    ) -> Job<'_, O> {
        Job::new(self.inputs(), self.options())
    }

    /// Input options of these features.
    fn options<O: Options + HasGroup<FeatureInput>>(&self) -> O {
        let mut options = O::default();
        *options.part_mut() = self.input();
        options
    }

    fn input(&self) -> FeatureInput {
        let mut input = FeatureInput::default();
        input.layer.clone_from(&self.layer);
        input
    }

    /// Verification of a file of simplified lines against these features.
    pub fn verify(&self, lines: impl AsRef<Path>) -> Job<'_, LineProof, WrittenOutput> {
        let (file, original) = (lines.as_ref().to_path_buf(), self.inputs());
        Job::new(WrittenOutput { file, original }, self.options())
    }
}

impl Data for Features {
    fn inputs(&self) -> Inputs {
        Inputs::from(self.path.clone())
    }

    fn reading(&self) -> Map<String, Json> {
        to_map(&self.input())
    }
}
