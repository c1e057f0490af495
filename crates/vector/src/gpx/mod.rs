//! GPX 1.0 and 1.1: waypoints are Points, routes LineStrings, tracks MultiLineStrings, as in GDAL. Elevations
//! are heights, times are measures: seconds since 1970-01-01.

mod read;
mod time;
mod write;

use self::write::{LINE_TEXTS, POINT_TEXTS};
use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "GPX",
    extensions: &["gpx"],
    about: "waypoints, routes (LineString) and tracks (MultiLineString) of GPS receivers",
    holds: VectorCapabilities {
        kinds: &[GeometryType::Point, GeometryType::LineString, GeometryType::MultiLineString],
        mixed: true,
        z: true,
        m: false,
        properties: false,
        values: PropertySupport::Named([POINT_TEXTS, LINE_TEXTS]),
        ids: false,
        ordered: false,
    },
    open: read::open,
    create: Some(write::create),
    sniff: |head| head.windows(4).any(|some| some == b"<gpx"),
};
