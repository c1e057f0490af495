//! TopoJSON (specification 1.0): arcs that geometries share, read only. Arcs are decoded once, so
//! vertices that geometries share have the same bits.

mod arcs;
mod read;

use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "TopoJSON",
    extensions: &["topojson"],
    about: "geometries with shared arcs; one object is read",
    holds: VectorCapabilities {
        kinds: &GeometryType::ALL,
        mixed: true,
        z: false,
        m: false,
        properties: true,
        values: PropertySupport::Typed,
        ids: true,
        ordered: true,
    },
    open: read::open,
    create: None,
    sniff,
};

fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let says = |word: &[u8]| head.windows(word.len()).any(|some| some == word);
    head.starts_with(b"{")
        && !says(b"\"FeatureCollection\"")
        && (says(b"\"Topology\"") || (says(b"\"arcs\"") && !says(b"\"geometry\"")))
}
