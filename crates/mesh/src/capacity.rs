//! Capacity limits of formats, checked in advance where the size is known, and with every batch.

use crate::channels::{VertexCapabilities, VertexChannel};
use crate::format::MeshFormat;
use crate::registry::FORMATS;
use terrane_base::error::{Error, ErrorKind, Result};

/// Capacity limits of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshCapacity {
    /// Maximum vertices.
    pub vertices: u64,
    /// Maximum triangles.
    pub triangles: u64,
    /// Maximum bytes of a file.
    pub bytes: u64,
    /// Bytes of one vertex.
    pub vertex_bytes: u64,
    /// Bytes of one triangle.
    pub triangle_bytes: u64,
}

impl MeshCapacity {
    /// Maximum vertices, triangles and bytes; bytes of a vertex and of a triangle.
    pub(super) const fn new(limits: [u64; 3], vertex_bytes: u64, triangle_bytes: u64) -> Self {
        let [vertices, triangles, bytes] = limits;
        Self { vertices, triangles, bytes, vertex_bytes, triangle_bytes }
    }

    /// True when `vertices` and `triangles` fit.
    pub fn holds(&self, vertices: u64, triangles: u64) -> bool {
        self.exceeded(0, vertices, triangles).is_none()
    }

    /// Approximate file size of a mesh of this size.
    pub fn file_bytes(&self, vertices: u64, triangles: u64) -> u64 {
        vertices
            .saturating_mul(self.vertex_bytes)
            .saturating_add(triangles.saturating_mul(self.triangle_bytes))
    }

    /// The limit that a mesh of this size, with a header of `header` bytes, exceeds.
    fn exceeded(&self, header: u64, vertices: u64, triangles: u64) -> Option<String> {
        let bytes = self.file_bytes(vertices, triangles).saturating_add(header);
        [
            (vertices, self.vertices, "vertices"),
            (triangles, self.triangles, "triangles"),
            (bytes, self.bytes, "bytes"),
        ]
        .into_iter()
        .find(|(count, limit, _)| count > limit)
        .map(|(_, limit, what)| format!("{limit} {what}"))
    }
}

/// Fails if a mesh of this size with a header of `header` bytes exceeds the capacity of the format called `name`.
pub(super) fn check(
    name: &str,
    capacity: &MeshCapacity,
    header: u64,
    vertices: u64,
    triangles: u64,
) -> Result<()> {
    capacity
        .exceeded(header, vertices, triangles)
        .map_or(Ok(()), |limit| Err(too_much(name, &limit, vertices, triangles)))
}

/// The error for a mesh that exceeds the `limit` ("4294967295 bytes") of a format.
pub(super) fn too_much(name: &str, limit: &str, vertices: u64, triangles: u64) -> Error {
    let mesh = format!("{vertices} vertices and {triangles} triangles");
    let message = format!("{name} holds at most {limit}; the mesh has at least {mesh}");
    let error = Error::new(ErrorKind::CannotWrite, message);
    match others(|f| f.name != name && (f.capacity)().holds(vertices, triangles)) {
        names if names.is_empty() => error,
        names => error.remedy(format!("write {names}")),
    }
}

/// Fails if the format called `name` does not support these vertex channels.
pub(super) fn check_channels(
    name: &str,
    carries: VertexCapabilities,
    channels: &[VertexChannel],
) -> Result<()> {
    if carries.holds(channels) {
        return Ok(());
    }
    let what = match carries {
        VertexCapabilities::Colours => "only vertex colours (three or four bands of 8 bits)",
        _ => "no vertex channels",
    };
    let others = others(|f| f.carries.holds(channels));
    Err(Error::usage(format!("{name} supports {what}")).remedy(format!("write {others}")))
}

/// Names of suitable formats.
fn others(would_do: impl Fn(&MeshFormat) -> bool) -> String {
    let names = FORMATS.iter().filter(|format| would_do(format)).map(|format| format.name);
    names.collect::<Vec<_>>().join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_limit_and_what_would_do() {
        let format = |name| FORMATS.iter().find(|f| f.name == name).unwrap();
        assert!(format("GLB").check_capacity(1 << 20, 1 << 21).is_ok());
        let error = format("GLB").check_capacity(1 << 28, 1 << 29).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::CannotWrite);
        let text = error.to_string();
        assert!(text.contains("at most 4294967295 bytes"), "{text}");
        assert!(text.contains("write PLY or OBJ or STL"), "{text}");
        let text = format("PLY").check_capacity(1 << 33, 1 << 34).unwrap_err().to_string();
        assert!(text.contains("4294967296 vertices") && text.contains("write OBJ"), "{text}");
        let text = format("OBJ").check_capacity(u64::MAX, u64::MAX).unwrap_err().to_string();
        assert!(!text.contains("write"), "{text}");
    }

    #[test]
    fn sizes_beyond_u64_saturate() {
        let most = MeshCapacity {
            vertices: u64::MAX,
            triangles: u64::MAX,
            bytes: u64::MAX - 1,
            vertex_bytes: 24,
            triangle_bytes: 13,
        };
        assert!(most.holds(1 << 50, 1 << 50));
        assert!(!most.holds(1 << 63, 1 << 63));
    }
}
