//! The `.prj` file beside a mesh: its coordinate reference system as well-known text.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::geom::Crs;

/// Where the sidecar of the mesh at `mesh_path` lies: `a.ply` has `a.prj`.
pub fn prj_path(mesh_path: &Path) -> PathBuf {
    mesh_path.with_extension("prj")
}

/// The text of the sidecar: the WKT that came with the input, or else the definition of its EPSG
/// code (WKT 1 wherever the EPSG system can be put that way). `None` when neither is known.
pub fn prj_sidecar(crs: &Crs) -> Option<&str> {
    let given = crs.wkt.as_deref().map(str::trim).filter(|wkt| !wkt.is_empty());
    given.or_else(|| {
        let code = u16::try_from(crs.epsg?).ok()?;
        Some(crs_definitions::from_code(code)?.wkt)
    })
}

/// Writes the sidecar of the mesh at `mesh_path`, whole or not at all, and returns its path; `None`
/// when there is nothing to say (see [`prj_sidecar`]). Fails when it exists and `overwrite` is
/// false: [`refuse_existing`](crate::atomic::refuse_existing) on [`prj_path`] tells beforehand.
pub fn write_prj(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<Option<PathBuf>> {
    let Some(text) = prj_sidecar(crs) else { return Ok(None) };
    let path = prj_path(mesh_path);
    let mut file = AtomicFile::create(&path, overwrite)?;
    writeln!(file, "{text}").map_err(|e| Error::write(&path, e))?;
    file.commit()?;
    Ok(Some(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    fn epsg(code: u32) -> Crs {
        Crs { epsg: Some(code), ..Crs::default() }
    }

    #[test]
    fn comes_from_the_input_or_from_the_code() {
        let utm = epsg(32611);
        let wkt = prj_sidecar(&utm).unwrap();
        assert!(wkt.starts_with("PROJCS[\"WGS 84 / UTM zone 11N\",GEOGCS["), "{wkt}");
        let own = Crs { wkt: Some("GEOGCS[\"own\"]\n".into()), ..epsg(32611) };
        assert_eq!(prj_sidecar(&own), Some("GEOGCS[\"own\"]"));
        for unknown in [Crs::default(), epsg(1), epsg(4_000_000)] {
            assert_eq!(prj_sidecar(&unknown), None);
        }
    }

    #[test]
    fn never_replaces_a_file_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("a.b.ply");
        assert_eq!(write_prj(&mesh, &Crs::default(), false).unwrap(), None);
        let path = write_prj(&mesh, &epsg(4326), false).unwrap().unwrap();
        assert_eq!(path, folder.path().join("a.b.prj"));
        let refused = write_prj(&mesh, &epsg(4326), false).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::Usage);
        write_prj(&mesh, &epsg(32611), true).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("PROJCS"));
    }
}
