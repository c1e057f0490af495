//! Layout of binary glTF: its chunks, codes of types and modes, and axes.

use terrane_base::geom::Point3;

/// The names of the formats.
pub(super) const NAME: &str = "GLB";
pub(super) const PACKED_NAME: &str = "GLB-meshopt";

/// Storage of vertices and triangles in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GltfCompression {
    None,
    Meshopt,
}

pub(super) const MAGIC: &[u8; 4] = b"glTF";
pub(super) const VERSION: u32 = 2;
pub(super) const JSON_CHUNK: &[u8; 4] = b"JSON";
pub(super) const BIN_CHUNK: &[u8; 4] = b"BIN\0";
/// Component types and primitive modes of glTF.
pub(super) const FLOAT: u32 = 5126;
pub(super) const UNSIGNED_INT: u32 = 5125;
pub(super) const TRIANGLES: u32 = 4;
pub(super) const POINTS: u32 = 0;

/// World axes (x east, y north, z up) to those of glTF (x east, y up, z south).
pub(super) fn to_y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, z, 0.0 - y]
}

/// glTF axes to world axes.
pub(super) fn to_z_up([x, y, z]: [f64; 3]) -> Point3 {
    [x, -z, y]
}
