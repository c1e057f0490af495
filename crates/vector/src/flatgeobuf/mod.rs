//! FlatGeobuf 3: a header, a packed tree of rectangles, and features, each a FlatBuffers table behind
//! its size (<https://flatgeobuf.org>, with the FlatBuffers internals of Google's documentation).
//! Why not by a library: "Libraries tried" in ARCHITECTURE.md.

mod build;
mod read;
mod schema;
mod value;
mod view;
mod write;

use self::schema::MAGIC;
use crate::format::{PropertySupport, VectorCapabilities, VectorFormat};
use crate::geometry::GeometryType;

/// The registry's entry.
pub(super) const FORMAT: VectorFormat = VectorFormat {
    name: "FlatGeobuf",
    extensions: &["fgb"],
    about: "binary format with typed properties and a spatial index",
    holds: VectorCapabilities {
        kinds: &GeometryType::ALL,
        mixed: true,
        z: true,
        m: true,
        properties: true,
        values: PropertySupport::Columns,
        ids: false,
        ordered: false,
    },
    open: read::open,
    create: Some(write::create),
    sniff: |head| head.starts_with(&MAGIC[..4]),
};
