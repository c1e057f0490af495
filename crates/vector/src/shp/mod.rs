//! ESRI shapefiles (the technical description of July 1998): `.shp` with shapes, `.shx` with their
//! places, `.dbf` with their properties, `.prj` with the CRS, `.cpg` with the encoding of texts.

mod read;
mod shape;
mod write;

use self::read::{MAGIC, VERSION};
use crate::format::{Holds, Values, VectorFormat};
use crate::geometry::Kind;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "Shapefile",
    extensions: &["shp"],
    about: "an ESRI shapefile: .shp, .shx, .dbf, .prj and .cpg; one kind of geometry in a file",
    holds: Holds {
        kinds: &[
            Kind::Null,
            Kind::Point,
            Kind::MultiPoint,
            Kind::LineString,
            Kind::MultiLineString,
            Kind::Polygon,
            Kind::MultiPolygon,
        ],
        mixed: false,
        z: true,
        m: true,
        properties: true,
        values: Values::Dbase,
        ids: false,
        ordered: true,
    },
    open: read::open,
    create: Some(write::create),
    sniff: |head| head.starts_with(&MAGIC) && head.get(28..32) == Some(&VERSION),
};
