//! `.prj` files beside a grid: well-known text to a coordinate reference system.

use std::path::Path;

use crate::error::{Error, Result};
use crate::geom::Crs;
use crate::limits;
use crate::raster::file::RawFile;

/// Reads the `.prj` beside `path`; unknown when there is none.
pub(super) fn beside(path: &Path) -> Result<Crs> {
    for extension in ["prj", "PRJ"] {
        let sidecar = path.with_extension(extension);
        if sidecar.is_file() {
            return read(&sidecar);
        }
    }
    Ok(Crs::default())
}

fn read(path: &Path) -> Result<Crs> {
    let file = RawFile::open(path)?;
    limits::check("bytes of a .prj file", file.len(), limits::MAX_HEADER_BYTES)
        .map_err(|e: Error| e.in_file(path))?;
    let bytes = file.head(limits::MAX_HEADER_BYTES)?;
    Ok(from_text(String::from_utf8_lossy(&bytes).trim()))
}

/// From well-known text; other text (the old "Projection UTM" form) becomes the name alone.
pub(super) fn from_text(text: &str) -> Crs {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim().to_uppercase();
    let geographic = match keyword.as_str() {
        "GEOGCS" | "GEOGCRS" | "GEODCRS" => true,
        "PROJCS" | "PROJCRS" => false,
        // A compound system is what its first, horizontal part is.
        "COMPD_CS" | "COMPOUNDCRS" => !text.to_uppercase().contains("PROJC"),
        _ => {
            let name = text.lines().next().map(|line| line.trim().chars().take(80).collect());
            return Crs { citation: name, ..Crs::default() };
        }
    };
    let name = text.split('"').nth(1).unwrap_or_default();
    Crs {
        epsg: outermost_code(text).or_else(|| esri_code(name)),
        citation: Some(name.to_owned()),
        wkt: Some(text.to_owned()),
        geographic: Some(geographic),
        ..Crs::default()
    }
}

/// From well-known text, or from a name such as "EPSG:4326"; unknown where the text is empty.
pub(super) fn of_srs(text: &str) -> Crs {
    let text = text.trim();
    let code = text.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("EPSG"));
    match code.and_then(|(_, code)| code.trim().parse().ok()) {
        Some(code) => of_code(code),
        None if text.is_empty() => Crs::default(),
        None => from_text(text),
    }
}

/// The system of a code, with what is known of it.
fn of_code(code: u32) -> Crs {
    let known = u16::try_from(code).ok().and_then(crs_definitions::from_code);
    let crs = known.map_or_else(Crs::default, |system| from_text(system.wkt));
    Crs { epsg: Some(code), ..crs }
}

/// The EPSG code of the system itself: the last `AUTHORITY["EPSG","n"]` or `ID["EPSG",n]`, one
/// bracket deep.
fn outermost_code(text: &str) -> Option<u32> {
    let mut depth = 0;
    let mut code = None;
    let mut quoted = false;
    for (i, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '(' if !quoted => {
                if depth == 1 {
                    code = authority(&text[..i], &text[i..]).or(code);
                }
                depth += 1;
            }
            ']' | ')' if !quoted => depth -= 1,
            _ => {}
        }
    }
    code
}

/// The code in `body` (from its bracket on) when the text before ends in AUTHORITY or ID.
fn authority(before: &str, body: &str) -> Option<u32> {
    let keyword = before.rsplit(|c: char| !c.is_ascii_alphanumeric()).next()?;
    if !keyword.eq_ignore_ascii_case("AUTHORITY") && !keyword.eq_ignore_ascii_case("ID") {
        return None;
    }
    let body = body.get(1..)?.split([']', ')']).next()?;
    let (name, code) = body.split_once(',')?;
    let is_epsg = name.trim().trim_matches('"').eq_ignore_ascii_case("EPSG");
    is_epsg.then(|| code.split(',').next()?.trim().trim_matches('"').parse().ok())?
}

/// Codes of the names ESRI writes without a code.
fn esri_code(name: &str) -> Option<u32> {
    match name {
        "GCS_WGS_1984" => return Some(4326),
        "GCS_North_American_1927" => return Some(4267),
        "GCS_North_American_1983" => return Some(4269),
        "GCS_ETRS_1989" => return Some(4258),
        "WGS_1984_Web_Mercator_Auxiliary_Sphere" => return Some(3857),
        _ => {}
    }
    let (system, zone) = name.split_once("_UTM_Zone_")?;
    let north = zone.ends_with('N');
    let zone: u32 = zone.trim_end_matches(['N', 'S']).parse().ok()?;
    match (system, north, zone) {
        ("WGS_1984", true, 1..=60) => Some(32600 + zone),
        ("WGS_1984", false, 1..=60) => Some(32700 + zone),
        ("NAD_1927", true, 1..=22) => Some(26700 + zone),
        ("NAD_1983", true, 1..=23) => Some(26900 + zone),
        ("ETRS_1989", true, 28..=38) => Some(25800 + zone),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outermost_code_counts() {
        let wkt = r#"PROJCS["WGS 84 / UTM zone 11N (a]b)",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","32611"]]"#;
        let crs = from_text(wkt);
        assert_eq!((crs.epsg, crs.geographic), (Some(32611), Some(false)));
        assert_eq!(crs.citation.as_deref(), Some("WGS 84 / UTM zone 11N (a]b)"));
        assert_eq!(crs.wkt.as_deref(), Some(wkt));
        let wkt2 = r#"GEOGCRS["NAD83",ID["EPSG",4269]]"#;
        assert_eq!(from_text(wkt2).epsg, Some(4269));
        let without = r#"PROJCS["mine",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]]"#;
        assert_eq!(from_text(without).epsg, None);
    }

    #[test]
    fn esri_names_and_other_text() {
        assert_eq!(from_text(r#"PROJCS["WGS_1984_UTM_Zone_33S",X[]]"#).epsg, Some(32733));
        assert_eq!(from_text(r#"GEOGCS["GCS_WGS_1984",X[]]"#).epsg, Some(4326));
        let old = from_text("Projection    UTM\nZone 11");
        assert_eq!((old.citation.as_deref(), old.wkt), (Some("Projection    UTM"), None));
        for damaged in ["", "[", "PROJCS", "PROJCS[", "]]]]", "GEOGCS[\"a\",ID[", "é[é"] {
            let _ = from_text(damaged);
        }
    }
}
