//! ESRI shapefiles (technical description of July 1998): `.shp` with shapes, `.shx` with their offsets,
//! `.dbf` with their properties, `.prj` with the CRS, `.cpg` with the text encoding.

mod read;
mod shape;
mod write;

use self::read::{MAGIC, VERSION};
use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "Shapefile",
    extensions: &["shp"],
    about: "ESRI shapefile with .shx, .dbf, .prj and .cpg; one geometry type per file",
    holds: VectorCapabilities {
        kinds: &[
            GeometryType::Null,
            GeometryType::Point,
            GeometryType::MultiPoint,
            GeometryType::LineString,
            GeometryType::MultiLineString,
            GeometryType::Polygon,
            GeometryType::MultiPolygon,
        ],
        mixed: false,
        z: true,
        m: true,
        properties: true,
        values: PropertySupport::Dbase,
        ids: false,
        ordered: true,
    },
    open: read::open,
    create: Some(write::create),
    sniff: |head| head.starts_with(&MAGIC) && head.get(28..32) == Some(&VERSION),
};
