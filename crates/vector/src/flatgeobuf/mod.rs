//! FlatGeobuf 3: a header, a packed tree of rectangles, and features, each a FlatBuffers table behind
//! its size (<https://flatgeobuf.org>, with the FlatBuffers internals of Google's documentation).
//! Why not by a library: "Libraries tried" in ARCHITECTURE.md.

mod build;
mod read;
mod value;
mod view;
mod write;

use super::{Holds, Kind, Values, VectorFormat};

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "FlatGeobuf",
    extensions: &["fgb"],
    about: "a binary file with typed properties and a spatial index",
    holds: Holds {
        kinds: &Kind::ALL,
        mixed: true,
        z: true,
        m: true,
        properties: true,
        values: Values::Columns,
        ids: false,
        ordered: false,
    },
    open: read::open,
    create: Some(write::create),
    sniff: |head| head.starts_with(&MAGIC[..4]),
};

/// The first bytes; the last one is the patch level.
const MAGIC: [u8; 8] = *b"fgb\x03fgb\x00";

/// Numbers of the kinds; 0 stands for any or none.
const KINDS: [(u8, Kind); 7] = [
    (1, Kind::Point),
    (2, Kind::LineString),
    (3, Kind::Polygon),
    (4, Kind::MultiPoint),
    (5, Kind::MultiLineString),
    (6, Kind::MultiPolygon),
    (7, Kind::Collection),
];

/// Slots of the tables' fields.
mod slot {
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
}
