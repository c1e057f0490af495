//! Reports: what became of a run, for programs.

use std::path::Path;

use serde::Serialize;

use crate::atomic::AtomicFile;
use crate::cli::shared::say;
use crate::error::{Error, Result};
use crate::jobs::sift::Skipped;

/// A report with the files that were left out.
#[derive(Serialize)]
pub(crate) struct WithSkipped<'a, R> {
    #[serde(flatten)]
    pub(crate) report: &'a R,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    pub(crate) skipped: &'a [Skipped],
}

/// Writes a report as a JSON file, whole or not at all.
pub(crate) fn write(path: &Path, overwrite: bool, report: &impl Serialize) -> Result<()> {
    use std::io::Write;
    let mut file = AtomicFile::create(path, overwrite)?;
    file.write_all(say::pretty(report)?.as_bytes()).map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}
