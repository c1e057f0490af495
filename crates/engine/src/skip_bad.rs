//! Detects damaged files before the work by opening each of them.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Resources;
use super::input::workers;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud::{self as cloud, PointSource};
use terrane_files::{is_remote, path_of, shown};
use terrane_raster::{self as raster, GridOpenOptions};
use terrane_vector as vector;

/// A file that is left out of the input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Skipped {
    /// Its name.
    pub file: String,
    /// The reason.
    pub reason: String,
}

/// Readable files, in their order, and unreadable ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadableFiles {
    /// Names of the readable files.
    pub names: Vec<String>,
    /// The unreadable files.
    pub skipped: Vec<Skipped>,
}

/// Checks files of grids.
///
/// # Errors
/// The error of a file if none can be opened; errors that do not depend on a file, such as a missing band.
pub fn grids(
    names: &[String],
    options: &GridOpenOptions,
    resources: &Resources,
) -> Result<ReadableFiles> {
    let alone = GridOpenOptions { threads: 1, ..options.clone() };
    check_file(names, resources, |name| raster::open(name, &alone).map(drop))
}

/// Checks files of point clouds.
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

/// Checks files of features, which are read to their ends, as their headers are not sufficient.
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
    /// The file `name`, left out because of `error`. The reason names a file only if it differs from `name`, such as a
    /// source of a VRT.
    pub fn new(name: &str, error: &Error) -> Self {
        let (file, message) = (shown(name), error.to_string());
        let reason = message.strip_prefix(&format!("{file}: ")).unwrap_or(&message).to_owned();
        Self { file, reason }
    }
}

/// Damaged files that were salvaged, each with the number of lost points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LostPoints(BTreeMap<String, u64>);

impl LostPoints {
    /// The losses of a point cloud in the parts read so far.
    pub fn of(cloud: &dyn PointSource) -> Self {
        Self(cloud.losses().into_iter().collect())
    }

    /// Updates the losses after other parts of the same point cloud were read.
    pub fn add(&mut self, other: &Self) {
        for (file, points) in &other.0 {
            let max = self.0.entry(file.clone()).or_default();
            *max = (*max).max(*points);
        }
    }

    /// True if nothing was lost.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// One line per file.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(file, points)| format!("{file} is damaged: {points} points are lost"))
    }
}

fn check_file(
    names: &[String],
    resources: &Resources,
    check: impl Fn(&str) -> Result<()> + Sync,
) -> Result<ReadableFiles> {
    let checked: Vec<Result<()>> = workers(resources)?.install(|| {
        names.par_iter().map(|name| check(name).map_err(|e| e.in_file(&path_of(name)))).collect()
    });
    let (mut names_left, mut bad) = (Vec::new(), Vec::new());
    for (name, checked) in names.iter().zip(checked) {
        match checked {
            Ok(()) => names_left.push(name.clone()),
            // A server that fails is not a bad file.
            Err(error) if error.kind() == ErrorKind::Io && is_remote(&path_of(name)) => {
                return Err(error);
            }
            Err(error) if error.is_about_a_file() => bad.push((name, error)),
            Err(error) => return Err(error),
        }
    }
    if names_left.is_empty() && !bad.is_empty() {
        return Err(Error::several(bad.into_iter().map(|(_, error)| error).collect(), names.len()));
    }
    let skipped = bad.into_iter().map(|(name, error)| Skipped::new(name, &error)).collect();
    Ok(ReadableFiles { names: names_left, skipped })
}
