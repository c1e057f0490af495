//! GeoKeys of a directory. GeoTIFF 1.1 (OGC 19-008r4) section 7.1.2.

use terrane_base::error::Result;
use terrane_base::geom::GeoKeys;

use super::ifd::GeoTiffDirectory;
use super::tags;

/// Reads the three tags; absent ones are empty. Invalid keys are skipped, since they do not affect heights.
pub(super) fn read(directory: &GeoTiffDirectory<'_>) -> Result<GeoKeys> {
    let raw = directory.ints(tags::GEO_KEY_DIRECTORY)?.unwrap_or_default();
    Ok(GeoKeys::new(
        raw.into_iter().map(|v| u16::try_from(v).unwrap_or(u16::MAX)).collect(),
        directory.doubles(tags::GEO_DOUBLE_PARAMS)?.unwrap_or_default(),
        directory.text(tags::GEO_ASCII_PARAMS)?.unwrap_or_default(),
    ))
}
