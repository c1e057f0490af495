//! Small JSON files in the folder of a plan, and their paths.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::json;
use terrane_base::error::{Error, Result};
use terrane_files::atomic::AtomicFile;
use terrane_files::{absolute, folder_for};

/// The error for a file whose parent folder is missing.
pub(super) fn no_folder(path: &Path, error: io::Error) -> Error {
    Error::write(path, error)
        .remedy(format!("make {} first, or correct the name", folder_for(path, None).display()))
}

/// Writes a small file as JSON.
pub fn write_json<T: Serialize>(path: &Path, what: &T) -> Result<()> {
    let mut file = AtomicFile::create(path, true)?;
    let written = json::to_string_pretty(what).map_err(io::Error::from);
    written.and_then(|text| file.write_all(text.as_bytes())).map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}

/// The absolute path, as stored in JSON.
pub fn noted_path(output: &Path) -> Result<PathBuf> {
    absolute(output)
}
