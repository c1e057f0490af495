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

/// A mesh by its name, and its smallest and largest coordinates.
pub(super) type Opened<'a> = (&'a str, &'a dyn MeshSource, Option<[Point3; 2]>);

impl MeshInfoReport {
    pub(super) fn new((file, mesh, bounds): Opened<'_>, quality: Option<QualityReport>) -> Self {
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
            // Of facts with one name the last stays.
            details: info.details.iter().cloned().map(|(k, v)| (k, v.into())).collect(),
            quality,
        }
    }
}
