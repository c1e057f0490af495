//! Files that lie beside another and are read with it, of all formats; and the one that all have, the
//! `.prj` file with a coordinate reference system as text.

use std::path::{Path, PathBuf};

use super::RawFile;
use terrane_base::error::Result;
use terrane_base::limits;

/// The text of the `.prj` beside `path`; empty where there is none.
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

/// Endings, in place of its own, of files that are read with a grid, but for its `.prj`.
const BESIDE_GRIDS: [&str; 16] = [
    "hdr", "stx", "tfw", "tifw", "tiffw", "pgw", "pngw", "wld", "npyw", "blw", "bpw", "bqw",
    "bilw", "bipw", "bsqw", "flw",
];
/// Endings that are put after the grid's whole name.
const BEHIND_GRIDS: [&str; 5] = [".aux.xml", ".msk", ".MSK", ".hdr", ".HDR"];
/// Endings, in place of its own, of files that are read with features, here or by others.
const BESIDE_FEATURES: [&str; 8] = ["shx", "dbf", "cpg", "cst", "sbn", "sbx", "qix", "csvt"];
/// Endings of packed grids: what lies beside the grid that is in one is read, too.
const PACKED: [&str; 2] = ["gz", "zip"];

/// The names that files read with the grid at `path` may have, but for its `.prj`.
pub fn beside_grid(path: &Path) -> Vec<PathBuf> {
    let mut all = with_endings(path, &BESIDE_GRIDS);
    all.extend(BEHIND_GRIDS.map(|ending| behind(path, ending)));
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if PACKED.contains(&&*ending) {
        all.extend(beside_grid(&path.with_extension("")));
    }
    all
}

/// The names that files may have which come with the one at `path`, whatever its format: they are
/// written together with it, or would be read with it if they were there.
pub fn companions(path: &Path) -> Vec<PathBuf> {
    let mut all = beside_grid(path);
    all.extend(with_endings(path, &["prj"]));
    all.extend(with_endings(path, &BESIDE_FEATURES));
    // Coarser copies of a grid, as other programs keep them.
    all.push(behind(path, ".ovr"));
    all
}

/// `path` with each of the endings in place of its own, in small and in capital letters.
fn with_endings(path: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let both =
        |ending: &&str| [path.with_extension(ending), path.with_extension(ending.to_uppercase())];
    endings.iter().flat_map(both).collect()
}

fn behind(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}
