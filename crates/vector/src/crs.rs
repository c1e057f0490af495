//! CRS of vector files: `.prj` sidecars and the "crs" member of GeoJSON.

use std::path::Path;

use terrane_base::error::Result;
use terrane_base::geom::{Crs, wkt};
use terrane_files::atomic::Sidecar;

/// WGS 84 longitude and latitude, the CRS of GeoJSON and GPX.
pub(super) fn wgs84() -> Crs {
    wkt::of_srs("EPSG:4326")
}

/// True if `crs` need not be declared in a format that implies WGS 84 longitude and latitude.
pub(super) fn is_wgs84(crs: &Crs) -> bool {
    (crs.epsg, crs.vertical_epsg) == (Some(4326), None) || !crs.is_named()
}

/// The CRS of the `.prj` sidecar of `path`; unknown if there is none.
pub(super) fn sidecar_crs(path: &Path) -> Result<Crs> {
    Ok(wkt::of_srs(&terrane_files::prj(path)?))
}

/// The pending `.prj` sidecar of the file at `path`: written, replaced, or removed if `crs` is unknown, when
/// the file is committed.
pub(super) fn prj(path: &Path, crs: &Crs, overwrite: bool) -> Result<Sidecar> {
    let text = crs.to_wkt().map(|text| text + "\n");
    let path = path.with_extension("prj");
    Sidecar::new(path, text, |found| crs.is_said_by(found), overwrite)
}

/// Notes on parts of `crs` that a `.prj` sidecar cannot store.
pub(super) fn notes(crs: &Crs) -> Vec<String> {
    crs.lost_in_wkt().into_iter().collect()
}

/// The CRS of a GeoJSON "crs" member (GeoJSON 2008, before RFC 7946): by name, as a URN or a code.
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
    // One code of a URN, or two of a compound one: "urn:ogc:def:crs,crs:EPSG::6339,crs:EPSG::6360".
    let is_name = !name.contains('[');
    let parts = upper.split(',').filter(|part| is_name && part.contains("EPSG"));
    let codes = parts.map(|part| part.rsplit([':', '/']).next()?.parse::<u32>().ok());
    match codes.collect::<Option<Vec<_>>>().as_deref() {
        Some([code]) => wkt::of_srs(&format!("EPSG:{code}")),
        Some([code, vertical]) => wkt::of_srs(&format!("EPSG:{code}+{vertical}")),
        _ => wkt::of_srs(name),
    }
}

/// The "crs" member for a CRS other than WGS 84, as GDAL writes it: by code, or as WKT, which GDAL reads as
/// well. `None` if neither is known.
pub(super) fn member(crs: &Crs) -> Option<String> {
    if is_wgs84(crs) {
        return None;
    }
    let name = match (crs.epsg, crs.vertical_epsg) {
        (Some(code), None) => format!("urn:ogc:def:crs:EPSG::{code}"),
        (Some(code), Some(up)) => format!("urn:ogc:def:crs,crs:EPSG::{code},crs:EPSG::{up}"),
        (None, _) => crs.to_wkt()?,
    };
    let name = serde_json::Value::String(name);
    Some(format!("{{\"type\":\"name\",\"properties\":{{\"name\":{name}}}}}"))
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
    fn a_member_holds_what_has_no_code_and_both_codes_of_a_compound_system() {
        let text = r#"LOCAL_CS["a ""b""",UNIT["metre",1]]"#;
        let own = wkt::from_text(text);
        assert_eq!(of_member(&member(&own).unwrap()).wkt.as_deref(), Some(text));
        let compound = wkt::of_srs("EPSG:6339+6360");
        assert!(of_member(&member(&compound).unwrap()).agrees(&compound));
        let high = wkt::of_srs("EPSG:4326+5773");
        assert_eq!(of_member(&member(&high).unwrap()).vertical_epsg, Some(5773));
    }

    #[test]
    fn a_prj_is_written_once_and_never_replaced_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.wkt");
        let write = |crs: &Crs, overwrite| prj(&path, crs, overwrite)?.commit();
        write(&Crs::default(), false).unwrap();
        assert!(sidecar_crs(&path).unwrap().is_unknown());
        write(&wgs84(), false).unwrap();
        assert_eq!(sidecar_crs(&path).unwrap().epsg, Some(4326));
        write(&wgs84(), false).unwrap();
        let other = wkt::of_srs("EPSG:2154");
        assert!(write(&other, false).is_err() && write(&Crs::default(), false).is_err());
        write(&other, true).unwrap();
        assert_eq!(sidecar_crs(&path).unwrap().epsg, Some(2154));
        write(&Crs::default(), true).unwrap();
        assert!(sidecar_crs(&path).unwrap().is_unknown());
    }
}
