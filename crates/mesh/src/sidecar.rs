//! The `.prj` sidecar of a mesh with its CRS as WKT.

use std::path::{Path, PathBuf};

use terrane_base::error::Result;
use terrane_base::geom::Crs;
use terrane_files::atomic::Sidecar;

/// Path of the sidecar of the mesh at `mesh_path`: `a.prj` for `a.ply`.
pub fn prj_path(mesh_path: &Path) -> PathBuf {
    mesh_path.with_extension("prj")
}

/// Fails if [`write_prj`] would: a sidecar with another CRS exists, and `overwrite` is false.
pub fn check_prj(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<()> {
    sidecar(mesh_path, crs, overwrite).map(drop)
}

/// Writes the sidecar of the mesh at `mesh_path` atomically and returns its path; `None` without a CRS, and then the
/// sidecar of an earlier mesh is removed. A sidecar with the same CRS is kept: it may belong to the input or to
/// another mesh of the same name. Fails if a sidecar with another CRS exists, and `overwrite` is false.
pub fn write_prj(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<Option<PathBuf>> {
    let sidecar = sidecar(mesh_path, crs, overwrite)?;
    sidecar.commit()?;
    Ok(sidecar.place().map(|(path, _)| path))
}

fn sidecar(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<Sidecar> {
    let text = crs.to_wkt().map(|text| text + "\n");
    Sidecar::new(prj_path(mesh_path), text, |found| crs.is_said_by(found), overwrite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;
    use terrane_base::geom::wkt;

    #[test]
    fn never_replaces_a_file_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("a.b.ply");
        let epsg = |code: u32| wkt::of_srs(&format!("EPSG:{code}"));
        assert_eq!(write_prj(&mesh, &Crs::default(), false).unwrap(), None);
        let path = write_prj(&mesh, &epsg(4326), false).unwrap().unwrap();
        assert_eq!(path, folder.path().join("a.b.prj"));
        assert_eq!(write_prj(&mesh, &epsg(4326), false).unwrap(), Some(path.clone()));
        for other in [epsg(32611), Crs::default()] {
            for refused in [
                write_prj(&mesh, &other, false).map(|_| ()).unwrap_err(),
                check_prj(&mesh, &other, false).unwrap_err(),
            ] {
                assert_eq!(refused.kind(), ErrorKind::Usage);
            }
        }
        write_prj(&mesh, &epsg(32611), true).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("PROJCS"));
        assert_eq!(write_prj(&mesh, &Crs::default(), true).unwrap(), None);
        assert!(!path.exists());
    }
}
