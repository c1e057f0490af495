//! CRS from the `.prj` sidecar of a grid.

use std::path::Path;

use terrane_base::error::Result;
use terrane_base::geom::{Crs, wkt};

/// Reads the `.prj` sidecar of `path`; unknown if there is none.
pub(super) fn sidecar_crs(path: &Path) -> Result<Crs> {
    Ok(wkt::of_srs(&terrane_files::prj(path)?))
}
