//! Metadata and quality of a mesh.

use serde::Serialize;

use terrane_base::geom::Point3;
use terrane_mesh::MeshSource;
use terrane_verify::QualityReport;

/// Report on a mesh.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct MeshInfoReport {
    pub file: String,
    pub format: &'static str,
    pub vertices: u64,
    pub triangles: u64,
    pub crs: Option<String>,
    pub indexed: bool,
    pub single_precision: bool,
    pub origin: Point3,
    /// Stored units in one unit of each coordinate.
    pub scale: Point3,
    /// Smallest and largest coordinates; absent without vertices.
    pub bounds: Option<[Point3; 2]>,
    pub details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<QualityReport>,
}

impl MeshInfoReport {
    pub(super) fn new(
        file: &str,
        mesh: &dyn MeshSource,
        bounds: Option<[Point3; 2]>,
        quality: Option<QualityReport>,
    ) -> Self {
        let info = mesh.info();
        Self {
            file: file.to_owned(),
            format: info.format,
            vertices: info.vertices,
            triangles: info.triangles,
            crs: info.crs.clone(),
            indexed: info.indexed,
            single_precision: info.single_precision,
            origin: info.origin,
            scale: info.scale,
            bounds,
            // The last of several facts with one name remains.
            details: info.details.iter().cloned().map(|(k, v)| (k, v.into())).collect(),
            quality,
        }
    }
}
