//! Bad files told from good ones before the work: each is opened by itself.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Resources;
use super::input::workers;
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, PointSource};
use terrane_files::{path_of, shown};
use terrane_raster::{self as raster, GridOpenOptions};
use terrane_vector as vector;

/// A file that is left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Skipped {
    /// Its name.
    pub file: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Files that can be opened, in their order, and those that cannot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadableFiles {
    /// Names of the good ones.
    pub names: Vec<String>,
    /// The others.
    pub skipped: Vec<Skipped>,
}

/// Of files of grids.
///
/// # Errors
/// Those of all files, where none can be opened; failures that are no file's, such as a band that
/// there is not.
pub fn grids(
    names: &[String],
    options: &GridOpenOptions,
    resources: &Resources,
) -> Result<ReadableFiles> {
    let alone = GridOpenOptions { threads: 1, ..options.clone() };
    check_file(names, resources, |name| raster::open(name, &alone).map(drop))
}

/// Of files of clouds.
///
/// # Errors
/// As [`grids`].
pub fn clouds(
    names: &[String],
    options: &cloud::CloudOpenOptions,
    resources: &Resources,
) -> Result<ReadableFiles> {
    let alone = cloud::CloudOpenOptions { threads: 1, ..options.clone() };
    check_file(names, resources, |name| cloud::open(&[name.to_owned()], &alone).map(drop))
}

/// Of files of features, which are read to their ends: their headers say little.
///
/// # Errors
/// As [`grids`].
pub fn features(
    names: &[String],
    options: &vector::VectorOpenOptions,
    resources: &Resources,
) -> Result<ReadableFiles> {
    check_file(names, resources, |name| {
        let mut source = vector::open(&path_of(name), options)?;
        while source.next()?.is_some() {}
        Ok(())
    })
}

impl Skipped {
    /// The file `name`, left out because of `error`. The reason names the file only where it is another
    /// one, such as a source of a VRT.
    pub fn new(name: &str, error: &Error) -> Self {
        let (file, told) = (shown(name), error.to_string());
        let reason = told.strip_prefix(&format!("{file}: ")).unwrap_or(&told).to_owned();
        Self { file, reason }
    }
}

/// Files that damage was passed over in, each with the points that are lost.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LostPoints(BTreeMap<String, u64>);

impl LostPoints {
    /// Of a cloud, as far as it was read.
    pub fn of(cloud: &dyn PointSource) -> Self {
        Self(cloud.losses().into_iter().collect())
    }

    /// Adds those of the same cloud when more or less of it was read.
    pub fn add(&mut self, other: &Self) {
        for (file, points) in &other.0 {
            let most = self.0.entry(file.clone()).or_default();
            *most = (*most).max(*points);
        }
    }

    /// True where nothing was lost.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A line for each file.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(file, points)| format!("{file} is damaged: {points} points are lost"))
    }
}

fn check_file(
    names: &[String],
    resources: &Resources,
    look: impl Fn(&str) -> Result<()> + Sync,
) -> Result<ReadableFiles> {
    let looked: Vec<Result<()>> = workers(resources)?.install(|| {
        names.par_iter().map(|name| look(name).map_err(|e| e.in_file(&path_of(name)))).collect()
    });
    let (mut names_left, mut bad) = (Vec::new(), Vec::new());
    for (name, looked) in names.iter().zip(looked) {
        match looked {
            Ok(()) => names_left.push(name.clone()),
            Err(error) if error.is_about_a_file() => bad.push((name, error)),
            Err(error) => return Err(error),
        }
    }
    if names_left.is_empty() && !bad.is_empty() {
        return Err(Error::several(bad.into_iter().map(|(_, error)| error).collect(), names.len()));
    }
    let skip = |(name, error): (&String, Error)| Skipped::new(name, &error);
    Ok(ReadableFiles { names: names_left, skipped: bad.into_iter().map(skip).collect() })
}
