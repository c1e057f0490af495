//! The parts of a 3MF archive by name, and the elements of its model.

use crate::text::{self, push_u64};

/// Name of the format.
pub(super) const NAME: &str = "3MF";
pub(super) const CONTENT_TYPES: &str = "[Content_Types].xml";
pub(super) const RELATIONS: &str = "_rels/.rels";
pub(super) const MODEL: &str = "3D/3dmodel.model";
/// Prefix of metadata names.
pub(super) const PREFIX: &str = "terrane:";

/// A vertex as an element.
pub(super) fn push_vertex(position: [f32; 3], to: &mut Vec<u8>) {
    to.extend_from_slice(b"<vertex");
    for (name, value) in [" x=\"", " y=\"", " z=\""].iter().zip(position) {
        to.extend_from_slice(name.as_bytes());
        text::push_f32(value, to);
        to.push(b'"');
    }
    to.extend_from_slice(b"/>\n");
}

/// A triangle as an element.
pub(super) fn push_triangle(ids: [u64; 3], to: &mut Vec<u8>) {
    to.extend_from_slice(b"<triangle");
    for (name, id) in [" v1=\"", " v2=\"", " v3=\""].iter().zip(ids) {
        to.extend_from_slice(name.as_bytes());
        push_u64(id, to);
        to.push(b'"');
    }
    to.extend_from_slice(b"/>\n");
}
