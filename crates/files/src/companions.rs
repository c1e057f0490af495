//! Sidecar files of all formats, among them the `.prj` with the CRS as text.

use std::path::{Path, PathBuf};

use super::RawFile;
use terrane_base::error::Result;
use terrane_base::limits;

/// The text of the `.prj` sidecar of `path`; empty if there is none.
pub fn prj(path: &Path) -> Result<String> {
    let places = ["prj", "PRJ"].map(|ending| path.with_extension(ending));
    let Some(sidecar) = places.iter().find(|place| place.is_file()) else {
        return Ok(String::new());
    };
    let file = RawFile::open(sidecar)?;
    limits::check("size of the .prj file in bytes", file.size(), limits::MAX_HEADER_BYTES)
        .map_err(|e| e.in_file(sidecar))?;
    let bytes = file.head(limits::MAX_HEADER_BYTES)?;
    Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
}

/// Extensions of sidecars of grids that replace the grid's own, except `.prj`.
const BESIDE_GRIDS: [&str; 16] = [
    "hdr", "stx", "tfw", "tifw", "tiffw", "pgw", "pngw", "wld", "npyw", "blw", "bpw", "bqw",
    "bilw", "bipw", "bsqw", "flw",
];
/// Extensions of sidecars of grids that are appended to the whole file name.
const BEHIND_GRIDS: [&str; 5] = [".aux.xml", ".msk", ".MSK", ".hdr", ".HDR"];
/// Extensions of sidecars of vector files, read by this program or by others.
const BESIDE_FEATURES: [&str; 8] = ["shx", "dbf", "cpg", "cst", "sbn", "sbx", "qix", "csvt"];
/// Extensions of compressed grids: the sidecars of the grid inside are read, too.
const PACKED: [&str; 2] = ["gz", "zip"];

/// Possible names of sidecars of the grid at `path`, except `.prj`.
pub fn beside_grid(path: &Path) -> Vec<PathBuf> {
    let mut all = with_endings(path, &BESIDE_GRIDS);
    all.extend(BEHIND_GRIDS.map(|ending| behind(path, ending)));
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if PACKED.contains(&&*ending) {
        all.extend(beside_grid(&path.with_extension("")));
    }
    all
}

/// Possible names of sidecars of the file at `path`, of any format.
pub fn companions(path: &Path) -> Vec<PathBuf> {
    let mut all = beside_grid(path);
    all.extend(with_endings(path, &["prj"]));
    all.extend(with_endings(path, &BESIDE_FEATURES));
    // Overviews of other programs.
    all.push(behind(path, ".ovr"));
    all
}

/// `path` with each of the extensions in place of its own, in lower and upper case.
fn with_endings(path: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let endings = endings.iter().flat_map(|ending| [(*ending).to_owned(), ending.to_uppercase()]);
    endings.map(|ending| path.with_extension(ending)).collect()
}

fn behind(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}
