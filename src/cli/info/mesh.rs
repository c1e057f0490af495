//! `terrane info` of meshes.

use serde::Serialize;

use crate::cli::info::{details, quality};
use crate::cli::shared::text;
use crate::geom::Point3;
use crate::jobs::verify::QualityReport;
use crate::mesh::MeshSource;

/// What is known of a mesh.
#[derive(Serialize)]
pub(crate) struct Facts {
    file: String,
    format: &'static str,
    vertices: u64,
    triangles: u64,
    crs: Option<String>,
    indexed: bool,
    single_precision: bool,
    origin: Point3,
    /// Stored units in one unit of each coordinate.
    scale: Point3,
    /// Smallest and largest coordinates; absent without vertices.
    bounds: Option<[Point3; 2]>,
    details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quality: Option<QualityReport>,
}

/// A mesh by its name, and its smallest and largest coordinates.
pub(crate) type Opened<'a> = (&'a str, &'a dyn MeshSource, Option<[Point3; 2]>);

impl Facts {
    pub(crate) fn new((file, mesh, bounds): Opened<'_>, quality: Option<QualityReport>) -> Self {
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
            details: details::of(&info.details),
            quality,
        }
    }

    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let corner = |p: Point3| p.map(text::position).join(", ");
        let sharing = if self.indexed { "shared by triangles" } else { "three to each triangle" };
        let stored = if self.single_precision { "32-bit" } else { "64-bit" };
        let mut rows = vec![
            ("format", self.format.to_owned()),
            ("vertices", format!("{}, {sharing}", text::count(self.vertices))),
            ("triangles", text::count(self.triangles)),
            ("crs", self.crs.clone().unwrap_or_else(|| "unknown".to_owned())),
            ("positions", format!("{stored}, origin {}", corner(self.origin))),
        ];
        if let Some([low, high]) = self.bounds {
            rows.push(("lowest corner", corner(low)));
            rows.push(("highest corner", corner(high)));
        }
        let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        rows.extend(details::rows(&self.details));
        rows.extend(self.quality.iter().flat_map(quality::rows));
        rows
    }
}
