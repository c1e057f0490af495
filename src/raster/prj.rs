//! `.prj` files beside a grid: well-known text to a coordinate reference system.

use std::path::Path;

use crate::error::{Error, Result};
use crate::geom::Crs;
use crate::geom::wkt::from_text;
use crate::limits;
use crate::raster::file::RawFile;

/// Reads the `.prj` beside `path`; unknown when there is none.
pub(super) fn beside(path: &Path) -> Result<Crs> {
    for extension in ["prj", "PRJ"] {
        let sidecar = path.with_extension(extension);
        if sidecar.is_file() {
            return read(&sidecar);
        }
    }
    Ok(Crs::default())
}

fn read(path: &Path) -> Result<Crs> {
    let file = RawFile::open(path)?;
    limits::check("bytes of a .prj file", file.len(), limits::MAX_HEADER_BYTES)
        .map_err(|e: Error| e.in_file(path))?;
    let bytes = file.head(limits::MAX_HEADER_BYTES)?;
    Ok(from_text(String::from_utf8_lossy(&bytes).trim()))
}
