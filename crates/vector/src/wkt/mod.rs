//! Well-known text of geometries (OGC 06-103r4) with the optional SRID prefix of PostGIS. Geometries are
//! separated by any white space.

mod read;
mod write;

use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "WKT",
    extensions: &["wkt", "ewkt"],
    about: "well-known text, one geometry per line; CRS in .prj",
    holds: VectorCapabilities {
        kinds: &[
            GeometryType::Point,
            GeometryType::MultiPoint,
            GeometryType::LineString,
            GeometryType::MultiLineString,
            GeometryType::Polygon,
            GeometryType::MultiPolygon,
            GeometryType::Collection,
        ],
        mixed: true,
        z: true,
        m: true,
        properties: false,
        values: PropertySupport::None,
        ids: false,
        ordered: true,
    },
    open: read::open,
    create: Some(write::create),
    sniff,
};

fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let end = head.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let word = String::from_utf8_lossy(&head[..end]);
    let rest = head[end..].trim_ascii_start();
    let is_srid = word.eq_ignore_ascii_case("SRID") && rest.starts_with(b"=");
    is_srid || read::keyword(&word).is_some()
}
