//! Files of features that are read beside a grid: polygons to clip it to, points to keep.

use std::path::{Path, PathBuf};

use crate::Resources;
use crate::memory::{PROGRAM, short};
use terrane_base::error::{Error, Result};
use terrane_files::{is_in_memory, name_of, path_of};
use terrane_raster::Inputs;
use terrane_vector::{self as vector, Feature, FeatureSource};

/// MiB that are enough for the job beside such a file: the program may have half of the memory with its workers.
const BESIDE: u64 = 2 * (PROGRAM >> 20) + 40;

/// Such a file, open.
pub struct AuxiliaryFeatures {
    /// Where it is.
    pub path: PathBuf,
    /// What is in it.
    pub source: Box<dyn FeatureSource>,
    /// Bytes that a vertex takes, and what to do where there are too many.
    bytes_each: u64,
    remedy: &'static str,
}

impl AuxiliaryFeatures {
    /// Opens a file of `what`. Of TopoJSON the first object is read.
    pub fn open(name: &str, what: &str, bytes_each: u64, remedy: &'static str) -> Result<Self> {
        let path = path_of(name).into_owned();
        if vector::synthetic(&path).is_none() && !path.exists() {
            return Err(Error::missing(&path).or(&format!("name a file of {what}")));
        }
        let source = vector::open(&path, &vector::VectorOpenOptions::default())?;
        Ok(Self { path, source, bytes_each, remedy })
    }

    /// Hands all features to `add` and returns how many vertices they have; fails where these take more than
    /// `share` bytes of the memory, and then hands on no more.
    pub fn each(
        &mut self,
        (share, resources): (u64, &Resources),
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
        let mib = |bytes: u64| bytes.div_ceil(1 << 20);
        let (needed, allowed) = (mib(self.bytes(vertices)), resources.memory >> 20);
        let message =
            format!("{vertices} vertices need {needed} MiB; the memory limit is {allowed} MiB");
        let enough = (4 * needed + BESIDE) << 20;
        short(message, enough).or(self.remedy).in_file(&self.path)
    }
}

/// [`label`] of a file as an option names it.
pub fn label_of(name: &str) -> String {
    label(&path_of(name))
}

/// The name of the same file wherever the process works.
pub fn absolute(name: &str) -> Result<String> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Ok(name.to_owned());
    }
    name_of(std::path::absolute(&path).map_err(|e| Error::read(&path, e))?)
}

/// The file, and what else is read with it.
pub fn files(name: &str) -> Vec<PathBuf> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Vec::new();
    }
    let is_shape = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("shp"));
    let beside = ["shx", "SHX", "dbf", "DBF"].map(|ending| path.with_extension(ending));
    let beside = beside.into_iter().filter(|path| is_shape && path.is_file());
    std::iter::once(path.clone().into_owned()).chain(beside).collect()
}

/// The files of a cloud by their names alone: the order in which they are given leaves no trace, nor do their folders.
pub fn in_order(files: &[String]) -> Inputs {
    let mut files = files.to_vec();
    files.sort_by_cached_key(|name| label(&path_of(name)));
    Inputs::from(files)
}

/// What a file says that it is made of: names without folders.
pub fn source(input: &Inputs) -> String {
    let name = input.to_string();
    if is_in_memory(&name) { "points".to_owned() } else { label(Path::new(&name)) }
}

/// The same input called what a file says that it is made of: folders that lead to it leave no trace.
pub fn noted(input: &Inputs) -> Inputs {
    input.called(source(input))
}

/// The last part of a name, for what a mesh is told of it: plans know the whole path, which is no part of the
/// mesh.
pub fn label(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.display().to_string())
}
