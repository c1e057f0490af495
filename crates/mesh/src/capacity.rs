//! What a format can hold, checked before the work starts where the size is known, and with every
//! batch.

use crate::{FORMATS, MeshCapacity, MeshFormat};
use terrane_base::error::{Error, ErrorKind, Result};

impl MeshFormat {
    /// Fails with [`ErrorKind::CannotWrite`] when a mesh of this size does not fit into the format;
    /// the error names the limit and the formats that would do.
    pub fn check_capacity(&self, vertices: u64, triangles: u64) -> Result<()> {
        check(self.name, &(self.most)(), 0, vertices, triangles)
    }
}

impl MeshCapacity {
    /// True when `vertices` and `triangles` fit.
    pub fn holds(&self, vertices: u64, triangles: u64) -> bool {
        self.exceeded(0, vertices, triangles).is_none()
    }

    /// Bytes of a file with a mesh of this size, about.
    pub fn file_bytes(&self, vertices: u64, triangles: u64) -> u64 {
        vertices
            .saturating_mul(self.vertex_bytes)
            .saturating_add(triangles.saturating_mul(self.triangle_bytes))
    }

    /// The limit that a mesh of this size, with a header of `header` bytes, is beyond.
    fn exceeded(&self, header: u64, vertices: u64, triangles: u64) -> Option<String> {
        let bytes = self.file_bytes(vertices, triangles).saturating_add(header);
        [
            (vertices, self.vertices, "vertices"),
            (triangles, self.triangles, "triangles"),
            (bytes, self.bytes, "bytes"),
        ]
        .into_iter()
        .find(|(found, most, _)| found > most)
        .map(|(_, most, what)| format!("{most} {what}"))
    }
}

/// Fails when a mesh of this size and a header of `header` bytes are beyond `most`, the capacity of
/// the format called `name`.
pub(super) fn check(
    name: &str,
    most: &MeshCapacity,
    header: u64,
    vertices: u64,
    triangles: u64,
) -> Result<()> {
    most.exceeded(header, vertices, triangles)
        .map_or(Ok(()), |limit| Err(too_much(name, &limit, vertices, triangles)))
}

/// The error of a format whose `limit` ("4294967295 bytes") does not suffice.
pub(super) fn too_much(name: &str, limit: &str, vertices: u64, triangles: u64) -> Error {
    let mesh = format!("{vertices} vertices and {triangles} triangles");
    let message = format!("{name} holds at most {limit}; a mesh of {mesh} or more does not fit");
    let error = Error::new(ErrorKind::CannotWrite, message);
    let others: Vec<&str> = FORMATS
        .iter()
        .filter(|f| f.name != name && (f.most)().holds(vertices, triangles))
        .map(|f| f.name)
        .collect();
    if others.is_empty() { error } else { error.remedy(format!("write {}", others.join(" or "))) }
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
