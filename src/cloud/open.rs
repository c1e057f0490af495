//! Opening clouds: one file, or many that are one cloud.

use crate::error::{Error, Result};
use crate::geom::{Crs, Point};

use super::{Census, CloudInfo, Filter, PointSource};

/// What says that a file is a cloud, before its name.
const CLOUD_PREFIX: &str = "cloud:";
/// Endings that only clouds have.
const ENDINGS: [&str; 2] = ["las", "laz"];

/// How a cloud is read.
#[derive(Clone, Debug)]
pub struct OpenOptions {
    /// Which points are wanted.
    pub filter: Filter,
    /// Give up what cannot be read, and count it, instead of failing.
    pub salvage: bool,
    /// The coordinate reference system of files that name none.
    pub crs: Option<Crs>,
    /// Threads for opening many files; parts are read by the caller's.
    pub threads: usize,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { filter: Filter::default(), salvage: false, crs: None, threads: 1 }
    }
}

/// A cloud of one file or many.
pub struct Cloud {
    info: CloudInfo,
    files: Vec<String>,
    notes: Vec<String>,
}

impl Cloud {
    /// Its files, by name.
    pub fn files(&self) -> &[String] {
        &self.files
    }

    /// What is odd about it, or easily overlooked, one line each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl PointSource for Cloud {
    fn info(&self) -> &CloudInfo {
        &self.info
    }

    fn parts(&self) -> usize {
        0
    }

    fn points_of(&self, _part: usize) -> u64 {
        0
    }

    fn read(&self, part: usize, _: &mut dyn FnMut(&[Point]) -> Result<()>) -> Result<Census> {
        Err(Error::usage(format!("there is no part {part}")))
    }
}

/// True when `input` is a cloud by its name: a `.las` or `.laz` file, a folder or pattern or list
/// with such files, or any of these or a text file after `cloud:`; or a synthetic one.
pub fn is_cloud(input: &str) -> bool {
    if input.starts_with(CLOUD_PREFIX) || super::synth::is_synthetic(input) {
        return true;
    }
    let ending = input.rsplit('.').next().unwrap_or_default().to_lowercase();
    ENDINGS.contains(&ending.as_str())
}

/// The files that `inputs` stand for, sorted.
///
/// # Errors
/// A folder, list or pattern that yields no file or cannot be read.
pub fn files(inputs: &[String]) -> Result<Vec<String>> {
    Ok(inputs.to_vec())
}

/// Opens files, folders (their `.las` and `.laz` files), patterns and `@lists` as one cloud. Text
/// files are taken for points, one to a line, whatever their ending.
///
/// # Errors
/// Files that are missing, damaged or not clouds; files whose coordinate reference systems differ;
/// extents that a frame cannot hold.
pub fn open(inputs: &[String], options: &OpenOptions) -> Result<Cloud> {
    let files = files(inputs)?;
    let _ = options;
    Err(Error::unsupported(format!("{} files", files.len())))
}
