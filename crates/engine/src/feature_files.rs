//! Feature files that are read beside a grid: clip polygons, required points.

use std::path::{Path, PathBuf};

use crate::Resources;
use crate::memory::{PROGRAM, short};
use terrane_base::error::{Error, Result};
use terrane_files::{is_in_memory, is_there, name_of, path_of, without_query};
use terrane_raster::Inputs;
use terrane_vector::{self as vector, Feature, FeatureSource};

/// Memory limit in MiB that suffices for the job beside such a file: the program and its workers may use half of it.
const BESIDE: u64 = 2 * (PROGRAM >> 20) + 40;

/// An opened feature file.
pub struct AuxiliaryFeatures {
    /// Its path.
    pub path: PathBuf,
    /// Its features.
    pub source: Box<dyn FeatureSource>,
    /// Bytes per vertex, and the remedy if there are too many.
    bytes_each: u64,
    remedy: &'static str,
}

impl AuxiliaryFeatures {
    /// Opens a file of `what`. Reads the first object of TopoJSON.
    pub fn open(name: &str, what: &str, bytes_each: u64, remedy: &'static str) -> Result<Self> {
        let path = path_of(name).into_owned();
        if vector::synthetic(&path).is_none() && !is_there(&path) {
            return Err(Error::missing(&path).or(&format!("name a file of {what}")));
        }
        let source = vector::open(&path, &vector::VectorOpenOptions::default())?;
        Ok(Self { path, source, bytes_each, remedy })
    }

    /// Passes all features to `add` and returns the number of their vertices. Fails, and stops, if these take more than
    /// `share` bytes of the memory.
    pub fn each(
        &mut self,
        share: u64,
        resources: &Resources,
        mut add: impl FnMut(&Feature) -> Result<()>,
    ) -> Result<u64> {
        let mut vertices = 0_u64;
        while let Some(feature) = self.source.next()? {
            vertices += feature.geometry.vertices() as u64;
            // Those beyond are counted all the same, to tell how much is enough.
            if self.bytes(vertices) <= share {
                add(&feature).map_err(|e| e.at(self.source.location()).in_file(&self.path))?;
            }
        }
        if self.bytes(vertices) > share {
            return Err(self.too_many(vertices, resources));
        }
        Ok(vertices)
    }

    fn bytes(&self, vertices: u64) -> u64 {
        vertices.saturating_mul(self.bytes_each)
    }

    fn too_many(&self, vertices: u64, resources: &Resources) -> Error {
        let (needed, allowed) = (self.bytes(vertices).div_ceil(1 << 20), resources.memory >> 20);
        let message =
            format!("{vertices} vertices need {needed} MiB; the memory limit is {allowed} MiB");
        let enough = (4 * needed + BESIDE) << 20;
        short(message, enough).or(self.remedy).in_file(&self.path)
    }
}

/// The [`label`] of a file by its option value.
pub fn label_of(name: &str) -> String {
    label(&path_of(name))
}

/// The absolute path of a file name.
pub fn absolute(name: &str) -> Result<String> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Ok(name.to_owned());
    }
    name_of(terrane_files::absolute(&path)?)
}

/// The file and its companion files.
pub fn files(name: &str) -> Vec<PathBuf> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Vec::new();
    }
    let is_shape = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("shp"));
    let companions = ["shx", "SHX", "dbf", "DBF"].map(|ending| path.with_extension(ending));
    let companions = companions.into_iter().filter(|path| is_shape && path.is_file());
    std::iter::once(path.clone().into_owned()).chain(companions).collect()
}

/// The files of a point cloud sorted by name: the result does not depend on their order or their folders.
pub fn in_order(files: &[String]) -> Inputs {
    let mut files = files.to_vec();
    files.sort_by_cached_key(|name| label(&path_of(name)));
    Inputs::from(files)
}

/// The source as stored in output files: names without folders.
pub fn source(input: &Inputs) -> String {
    let name = input.to_string();
    if is_in_memory(&name) { "points".to_owned() } else { label(Path::new(&name)) }
}

/// The same input under the name that is stored in output files: without folders.
pub fn noted(input: &Inputs) -> Inputs {
    input.called(source(input))
}

/// The last part of a path, for the metadata of a mesh. Plans store the whole path, which is not part of the mesh.
pub fn label(path: &Path) -> String {
    without_query(path).file_name().map_or_else(String::new, |name| name.display().to_string())
}
