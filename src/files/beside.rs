//! The `.prj` file beside another file: its coordinate reference system as text.

use std::path::Path;

use super::RawFile;
use crate::error::Result;
use crate::limits;

/// The text of the `.prj` beside `path`; empty where there is none.
pub(crate) fn prj(path: &Path) -> Result<String> {
    let places = ["prj", "PRJ"].map(|ending| path.with_extension(ending));
    let Some(sidecar) = places.iter().find(|place| place.is_file()) else {
        return Ok(String::new());
    };
    let file = RawFile::open(sidecar)?;
    limits::check("bytes of a .prj file", file.len(), limits::MAX_HEADER_BYTES)
        .map_err(|e| e.in_file(sidecar))?;
    let bytes = file.head(limits::MAX_HEADER_BYTES)?;
    Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
}
