//! Out-of-core codecs of the glTF extension EXT_meshopt_compression, for vertex attributes and triangle indices. Both
//! are lossless; the first corner of a triangle may change. The bitstreams follow the extension's specification
//! (Khronos, 2021).

pub(super) mod attributes;
pub(super) mod stream;
pub(super) mod triangles;

#[cfg(test)]
mod tests;

/// Name of the extension.
pub(super) const NAME: &str = "EXT_meshopt_compression";
