//! The coordinate reference system that a `.prj` file beside a grid gives.

use std::path::Path;

use crate::error::Result;
use crate::files;
use crate::geom::{Crs, wkt};

/// Reads the `.prj` beside `path`; unknown when there is none.
pub(super) fn beside(path: &Path) -> Result<Crs> {
    Ok(wkt::of_srs(&files::prj(path)?))
}
