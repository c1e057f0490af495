//! terrane's own grid store: an uncompressed tiled BigTIFF with page-aligned tiles, memory-mapped.

use std::path::Path;

use crate::error::Result;
use crate::raster::{GridSource, OpenOptions};

/// Placeholder of this branch.
pub(crate) fn try_open(
    _path: &Path,
    _options: &OpenOptions,
) -> Result<Option<Box<dyn GridSource>>> {
    Ok(None)
}
