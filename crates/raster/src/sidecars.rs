//! Sidecar files of a grid, by name.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use terrane_base::error::Result;
use terrane_base::limits;
use terrane_files::RawFile;

/// The sidecar of `path` with one of `endings` as its extension, in lower or upper case.
pub(super) fn sidecar(path: &Path, endings: &[&str]) -> Option<PathBuf> {
    let both = endings.iter().flat_map(|e| [(*e).to_owned(), e.to_uppercase()]);
    both.map(|ending| path.with_extension(ending)).find(|sidecar| sidecar.is_file())
}

/// The text of a small file.
pub(super) fn small_text(path: &Path, what: &str, most: u64) -> Result<String> {
    let file = RawFile::open(path)?;
    limits::check(what, file.size(), most).map_err(|e| e.in_file(path))?;
    Ok(String::from_utf8_lossy(&file.head(most)?).into_owned())
}

/// `path` with an extension appended.
pub(super) fn behind(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    PathBuf::from(name)
}

/// Path of the PAM sidecar of `path`.
pub(super) fn pam(path: &Path) -> PathBuf {
    behind(path, ".aux.xml")
}

/// The mask sidecar of `path`, if there is one: its name with ".msk" appended, as in GDAL.
pub(super) fn mask(path: &Path) -> Option<PathBuf> {
    [".msk", ".MSK"].map(|ending| behind(path, ending)).into_iter().find(|path| path.exists())
}
