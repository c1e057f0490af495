//! The codecs of the glTF extension EXT_meshopt_compression, written and read out of core: attributes of
//! vertices, and corners of triangles. Both are exact; a triangle may begin with another of its corners.
//! The bitstreams are those of the extension's specification (Khronos, 2021).

pub(super) mod attributes;
pub(super) mod stream;
pub(super) mod triangles;

#[cfg(test)]
mod tests;

/// The extension's name.
pub(super) const NAME: &str = "EXT_meshopt_compression";
