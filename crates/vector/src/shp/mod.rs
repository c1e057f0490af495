//! ESRI shapefiles (the technical description of July 1998): `.shp` with shapes, `.shx` with their
//! places, `.dbf` with their properties, `.prj` with the CRS, `.cpg` with the encoding of texts.

mod read;
mod shape;
mod write;

use super::{Holds, Kind, Values, VectorFormat};

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

/// The file code 9994.
const MAGIC: [u8; 4] = 9994_u32.to_be_bytes();
/// Version 1000.
const VERSION: [u8; 4] = 1000_u32.to_le_bytes();
/// Bytes of the header of a `.shp` and a `.shx`.
const HEADER_BYTES: u64 = 100;
/// Measures below this stand for none.
const NO_MEASURE: f64 = -1e38;
