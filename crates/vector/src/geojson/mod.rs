//! GeoJSON (RFC 7946), as one collection, as a text sequence (RFC 8142), or newline-delimited. All are read
//! alike: as a sequence of collections, features and geometries.

mod feature;
mod read;
#[cfg(test)]
mod tests;
mod write;

use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

pub(super) use feature::{GeoJsonFeatureReader, check_depth, id, member, short};

/// Capabilities of both variants.
const HOLDS: VectorCapabilities = VectorCapabilities {
    kinds: &GeometryType::ALL,
    mixed: true,
    z: true,
    m: false,
    properties: true,
    values: PropertySupport::Typed,
    ids: true,
    ordered: true,
};

/// Registry entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "GeoJSON",
    extensions: &["geojson", "json"],
    about: "feature collection; longitude and latitude unless the file declares another CRS",
    holds: HOLDS,
    open: read::open,
    create: Some(write::create),
    sniff,
};

/// Registry entry of newline-delimited GeoJSON.
pub(super) const LINES: VectorFormat = VectorFormat {
    name: "GeoJSONSeq",
    extensions: &["geojsonl", "geojsons", "ndjson", "jsonl"],
    about: "one GeoJSON feature per line",
    holds: HOLDS,
    open: read::open,
    create: Some(write::create_lines),
    sniff: sniff_lines,
};

fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    head.starts_with(b"{") && head.contains(&b'"')
}

fn sniff_lines(head: &[u8]) -> bool {
    if head.starts_with(b"\x1e") {
        return true;
    }
    let mut lines = head.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    lines.next().is_some_and(|line| line.starts_with(b"{") && line.ends_with(b"}"))
        && lines.next().is_some_and(|next| next.starts_with(b"{"))
}
