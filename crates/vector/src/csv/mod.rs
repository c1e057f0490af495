//! CSV tables with one vertex per row.

mod read;
mod write;

use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "CSV",
    extensions: &["csv", "tsv", "txt", "xy"],
    about: "one vertex per line: x, y and optional z, m, id and part; CRS in .prj; from zonal one polygon per line, without its geometry",
    holds: VectorCapabilities {
        kinds: &[GeometryType::Point, GeometryType::LineString, GeometryType::MultiLineString],
        mixed: true,
        z: true,
        m: true,
        properties: false,
        values: PropertySupport::Cells,
        ids: true,
        ordered: true,
    },
    open: read::open,
    create: Some(write::create),
    // Any text could be a table, so detection is by name only.
    sniff: |_| false,
};
