//! Summary of `terrane info` for meshes.

use crate::cli::info::{details, quality};
use crate::cli::shared::text;
use terrane_base::geom::Point3;
use terrane_viewer::info::MeshInfoReport;

/// Names and values.
pub(crate) fn rows(mesh: &MeshInfoReport) -> Vec<(String, String)> {
    let sharing = if mesh.indexed { "shared by triangles" } else { "three per triangle" };
    let stored = if mesh.single_precision { "32-bit" } else { "64-bit" };
    let mut rows = vec![
        ("format", mesh.format.to_owned()),
        ("vertices", format!("{}, {sharing}", text::count(mesh.vertices))),
        ("triangles", text::count(mesh.triangles)),
        ("crs", mesh.crs.clone().unwrap_or_else(|| "unknown".to_owned())),
        ("positions", format!("{stored}, origin {}", position(mesh.origin))),
    ];
    if let Some([low, high]) = mesh.bounds {
        rows.push(("lowest corner", position(low)));
        rows.push(("highest corner", position(high)));
    }
    let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
    rows.extend(details::rows(&mesh.details));
    rows.extend(mesh.quality.iter().flat_map(quality::rows));
    rows
}

fn position(point: Point3) -> String {
    point.map(text::position).join(", ")
}
