//! Codes of the FlatGeobuf schema: geometry types, and field slots of tables.

use crate::geometry::GeometryType;

/// Magic bytes; the last one is the patch level.
pub(super) const MAGIC: [u8; 8] = *b"fgb\x03fgb\x00";

/// Codes of the geometry types; 0 means unknown.
pub(super) const KINDS: [(u8, GeometryType); 7] = [
    (1, GeometryType::Point),
    (2, GeometryType::LineString),
    (3, GeometryType::Polygon),
    (4, GeometryType::MultiPoint),
    (5, GeometryType::MultiLineString),
    (6, GeometryType::MultiPolygon),
    (7, GeometryType::Collection),
];

pub(super) const HEADER_NAME: usize = 0;
pub(super) const HEADER_ENVELOPE: usize = 1;
pub(super) const HEADER_KIND: usize = 2;
pub(super) const HEADER_COLUMNS: usize = 7;
pub(super) const HEADER_COUNT: usize = 8;
pub(super) const HEADER_NODE: usize = 9;
pub(super) const HEADER_CRS: usize = 10;
pub(super) const COLUMN_NAME: usize = 0;
pub(super) const COLUMN_TYPE: usize = 1;
pub(super) const COLUMN_WIDTH: usize = 4;
pub(super) const COLUMN_SCALE: usize = 6;
pub(super) const CRS_ORG: usize = 0;
pub(super) const CRS_CODE: usize = 1;
pub(super) const CRS_NAME: usize = 2;
pub(super) const CRS_WKT: usize = 4;
pub(super) const GEOMETRY_ENDS: usize = 0;
pub(super) const GEOMETRY_XY: usize = 1;
pub(super) const GEOMETRY_Z: usize = 2;
pub(super) const GEOMETRY_M: usize = 3;
pub(super) const GEOMETRY_KIND: usize = 6;
pub(super) const GEOMETRY_PARTS: usize = 7;
pub(super) const FEATURE_GEOMETRY: usize = 0;
pub(super) const FEATURE_PROPERTIES: usize = 1;
pub(super) const FEATURE_COLUMNS: usize = 2;
