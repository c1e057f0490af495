//! Coordinate reference systems of files of features: `.prj` files, and what GeoJSON says.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::atomic::{AtomicFile, refuse_existing};
use crate::error::{Error, Result};
use crate::files::RawFile;
use crate::geom::{Crs, wkt};
use crate::limits;

/// Longitude and latitude on WGS 84: what GeoJSON and GPX are in.
pub(super) fn wgs84() -> Crs {
    wkt::of_srs("EPSG:4326")
}

/// True where coordinates need no word in a format that is longitude and latitude on WGS 84.
pub(super) fn is_wgs84(crs: &Crs) -> bool {
    crs.epsg == Some(4326) || crs.is_unknown()
}

/// The system that the `.prj` file beside `path` names; unknown where there is none.
pub(super) fn beside(path: &Path) -> Result<Crs> {
    for extension in ["prj", "PRJ"] {
        let sidecar = path.with_extension(extension);
        if sidecar.is_file() {
            let file = RawFile::open(&sidecar)?;
            limits::check("bytes of a .prj file", file.len(), limits::MAX_HEADER_BYTES)
                .map_err(|e| e.in_file(&sidecar))?;
            let bytes = file.head(limits::MAX_HEADER_BYTES)?;
            return Ok(wkt::from_text(String::from_utf8_lossy(&bytes).trim()));
        }
    }
    Ok(Crs::default())
}

/// The well-known text of a system: as it came, or else by its EPSG code.
pub(super) fn text(crs: &Crs) -> Option<&str> {
    let given = crs.wkt.as_deref().map(str::trim).filter(|wkt| !wkt.is_empty());
    given.or_else(|| Some(crs_definitions::from_code(u16::try_from(crs.epsg?).ok()?)?.wkt))
}

/// A `.prj` file in the making.
pub(super) struct Prj {
    path: PathBuf,
    text: String,
    overwrite: bool,
    /// True where it says the same already.
    is_there: bool,
}

impl Prj {
    /// Of the file at `path`; `None` where nothing is known of `crs`. Fails where another `.prj` is
    /// there and is not to be replaced.
    pub(super) fn new(path: &Path, crs: &Crs, overwrite: bool) -> Result<Option<Self>> {
        let Some(text) = text(crs) else { return Ok(None) };
        let path = path.with_extension("prj");
        let is_small = std::fs::metadata(&path).is_ok_and(|m| m.len() <= limits::MAX_HEADER_BYTES);
        let found = is_small.then(|| std::fs::read_to_string(&path).ok()).flatten();
        let is_there = found.is_some_and(|found| found.trim() == text);
        if !is_there {
            refuse_existing(&path, overwrite)?;
        }
        Ok(Some(Self { path, text: text.to_owned(), overwrite, is_there }))
    }

    /// Writes it, whole or not at all; its path and size.
    pub(super) fn finish(self) -> Result<(PathBuf, u64)> {
        let bytes = self.text.len() as u64 + 1;
        if !self.is_there {
            let mut file = AtomicFile::create(&self.path, self.overwrite)?;
            writeln!(file, "{}", self.text).map_err(|e| Error::write(&self.path, e))?;
            file.commit()?;
        }
        Ok((self.path, bytes))
    }
}

/// The system of a GeoJSON "crs" member (of 2008, before RFC 7946): by name, as a URN or a code.
pub(super) fn of_member(json: &str) -> Crs {
    let member: serde_json::Value = serde_json::from_str(json).unwrap_or_default();
    let properties = &member["properties"];
    if let Some(code) = properties["code"].as_u64() {
        return wkt::of_srs(&format!("EPSG:{code}"));
    }
    let Some(name) = properties["name"].as_str() else { return Crs::default() };
    let upper = name.to_ascii_uppercase();
    if upper.ends_with("CRS84") || upper.ends_with("CRS:84") {
        return wgs84();
    }
    match upper.split_once("EPSG").map(|(_, rest)| rest.rsplit(':').next().unwrap_or_default()) {
        Some(code) if code.parse::<u32>().is_ok() => wkt::of_srs(&format!("EPSG:{code}")),
        _ => wkt::of_srs(name),
    }
}

/// The "crs" member for a system other than WGS 84, as GDAL writes it; `None` without an EPSG code.
pub(super) fn member(crs: &Crs) -> Option<String> {
    let code = crs.epsg.filter(|_| !is_wgs84(crs))?;
    let name = format!("urn:ogc:def:crs:EPSG::{code}");
    Some(format!("{{\"type\":\"name\",\"properties\":{{\"name\":\"{name}\"}}}}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_read_in_all_their_forms_and_come_back() {
        let name = |name: &str| format!(r#"{{"type":"name","properties":{{"name":"{name}"}}}}"#);
        for (json, code) in [
            (name("urn:ogc:def:crs:EPSG::28992"), Some(28992)),
            (name("urn:ogc:def:crs:EPSG:6.9:3857"), Some(3857)),
            (name("EPSG:32633"), Some(32633)),
            (name("urn:ogc:def:crs:OGC:1.3:CRS84"), Some(4326)),
            (name("http://www.opengis.net/def/crs/OGC/1.3/CRS84"), Some(4326)),
            (r#"{"type":"EPSG","properties":{"code":2154}}"#.to_owned(), Some(2154)),
            ("null".to_owned(), None),
            ("[1]".to_owned(), None),
        ] {
            assert_eq!(of_member(&json).epsg, code, "{json}");
        }
        let crs = wkt::of_srs("EPSG:28992");
        assert_eq!(of_member(&member(&crs).unwrap()).epsg, Some(28992));
        assert_eq!((member(&wgs84()), member(&Crs::default())), (None, None));
    }

    #[test]
    fn a_prj_is_written_once_and_never_replaced_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.wkt");
        assert!(Prj::new(&path, &Crs::default(), false).unwrap().is_none());
        Prj::new(&path, &wgs84(), false).unwrap().unwrap().finish().unwrap();
        assert_eq!(beside(&path).unwrap().epsg, Some(4326));
        Prj::new(&path, &wgs84(), false).unwrap().unwrap().finish().unwrap();
        let other = wkt::of_srs("EPSG:2154");
        assert!(Prj::new(&path, &other, false).is_err());
        Prj::new(&path, &other, true).unwrap().unwrap().finish().unwrap();
        assert_eq!(beside(&path).unwrap().epsg, Some(2154));
    }
}
