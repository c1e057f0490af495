//! TopoJSON (specification 1.0), read-only. Arcs are decoded once, so shared vertices are bit-identical.

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
    head.starts_with(b"{")
        && !contains(head, b"\"FeatureCollection\"")
        && (contains(head, b"\"Topology\"")
            || (contains(head, b"\"arcs\"") && !contains(head, b"\"geometry\"")))
}

fn contains(text: &[u8], word: &[u8]) -> bool {
    text.windows(word.len()).any(|window| window == word)
}
