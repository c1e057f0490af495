//! The coordinate reference system that a `.prj` file beside a grid gives.

use std::path::Path;

use terrane_base::error::Result;
use terrane_base::geom::{Crs, wkt};

/// Reads the `.prj` beside `path`; unknown when there is none.
pub(super) fn beside(path: &Path) -> Result<Crs> {
    Ok(wkt::of_srs(&terrane_files::prj(path)?))
}
