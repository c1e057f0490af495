//! The `.prj` file beside a mesh: its coordinate reference system as well-known text.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::atomic::{AtomicFile, refuse_existing};
use crate::error::{Error, Result};
use crate::geom::Crs;
use crate::limits::MAX_HEADER_BYTES;

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

/// Fails when [`write_prj`] would: a different sidecar exists and `overwrite` is false.
pub fn check_prj(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<()> {
    let path = prj_path(mesh_path);
    match prj_sidecar(crs) {
        Some(text) if !says(&path, text) => refuse_existing(&path, overwrite),
        _ => Ok(()),
    }
}

/// Writes the sidecar of the mesh at `mesh_path`, whole or not at all, and returns its path; `None`
/// when there is nothing to say (see [`prj_sidecar`]). One that says the same already is left alone:
/// it may be the input's, or another mesh's of the same name. Fails when it exists, says something
/// else, and `overwrite` is false.
pub fn write_prj(mesh_path: &Path, crs: &Crs, overwrite: bool) -> Result<Option<PathBuf>> {
    let Some(text) = prj_sidecar(crs) else { return Ok(None) };
    let path = prj_path(mesh_path);
    if !says(&path, text) {
        let mut file = AtomicFile::create(&path, overwrite)?;
        writeln!(file, "{text}").map_err(|e| Error::write(&path, e))?;
        file.commit()?;
    }
    Ok(Some(path))
}

/// True when the file at `path` holds `text`, white space around it aside.
fn says(path: &Path, text: &str) -> bool {
    let is_small = std::fs::metadata(path).is_ok_and(|meta| meta.len() <= MAX_HEADER_BYTES);
    is_small && std::fs::read_to_string(path).is_ok_and(|found| found.trim() == text.trim())
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
        assert_eq!(write_prj(&mesh, &epsg(4326), false).unwrap(), Some(path.clone()));
        for refused in [
            write_prj(&mesh, &epsg(32611), false).map(|_| ()).unwrap_err(),
            check_prj(&mesh, &epsg(32611), false).unwrap_err(),
        ] {
            assert_eq!(refused.kind(), ErrorKind::Usage);
        }
        write_prj(&mesh, &epsg(32611), true).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("PROJCS"));
    }
}
