//! CRSs from WKT and from names of codes.

use super::definition::Horizontal;
use super::node::CrsWktNode;
use super::read::{GEOGRAPHIC, LOCAL, PROJECTED, VERTICAL, find, horizontal_in, is_geocentric};
use super::system::Crs;
use super::{codes, read, vertical};

/// Keywords of compound, bound and other CRSs.
const OTHER: [&str; 4] = ["COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "GEOCCS"];

/// From WKT; other text (the old "Projection UTM" form) becomes the name only.
pub fn from_text(text: &str) -> Crs {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim();
    let mut known = GEOGRAPHIC.iter().chain(&PROJECTED).chain(&LOCAL).chain(&OTHER);
    if !known.any(|known| known.eq_ignore_ascii_case(keyword)) {
        let name = text.lines().next().map(|line| line.trim().chars().take(80).collect());
        return Crs { citation: name, ..Crs::default() };
    }
    let nodes = CrsWktNode::all(text).unwrap_or_default();
    let horizontal = horizontal_in(&nodes);
    let meaning = horizontal.and_then(read::horizontal);
    let vertical = find(&nodes, &VERTICAL);
    let height = vertical.and_then(read::vertical);
    let name = text.split('"').nth(1).unwrap_or_default();
    let own = horizontal.or(nodes.first());
    let epsg =
        own.and_then(CrsWktNode::code).or_else(|| esri_code(own.map_or(name, CrsWktNode::name)));
    let is_geographic = own.and_then(|node| match node {
        node if node.is(&LOCAL) => None,
        node => Some(node.is(&GEOGRAPHIC) && !is_geocentric(node)),
    });
    let ellipsoidal = match &meaning {
        Some(Horizontal::Geographic(own)) if own.is_3d => Some("metre".to_owned()),
        _ => None,
    };
    Crs {
        // Some programs write a code beside the definition of another CRS.
        epsg: epsg.filter(|code| match (&meaning, codes::horizontal(*code)) {
            (Some(stated), Some(known)) => !stated.contradicts(&known),
            _ => true,
        }),
        vertical_epsg: match &height {
            Some(own) => own.code,
            None => vertical.and_then(CrsWktNode::code),
        },
        citation: Some(name.to_owned()),
        wkt: Some(text.to_owned()),
        geographic: is_geographic,
        vertical_unit: height.map(|own| own.unit.name).or(ellipsoidal),
        ..Crs::default()
    }
}

/// From WKT, or from a name such as "EPSG:4326" or "EPSG:6339+6360"; unknown if the text is empty.
pub fn of_srs(text: &str) -> Crs {
    match codes_in(text) {
        Some((code, None)) => of_code(code),
        Some((code, Some(vertical))) => of_codes(code, vertical),
        None => from_text(text.trim()),
    }
}

/// The text of a system with its codes, if it is made of these, as EPSG writes them.
///
/// ```
/// use terrane_base::geom::wkt::with_codes;
/// assert_eq!(with_codes(" epsg:06339 + 6360"), "EPSG:6339+6360");
/// ```
pub fn with_codes(text: &str) -> String {
    match codes_in(text) {
        Some((code, None)) => format!("EPSG:{code}"),
        Some((code, Some(vertical))) => format!("EPSG:{code}+{vertical}"),
        None => text.to_owned(),
    }
}

/// Codes of the horizontal and the vertical CRS.
fn codes_in(text: &str) -> Option<(u32, Option<u32>)> {
    let (name, codes) = text.split_once(':')?;
    if !name.trim().eq_ignore_ascii_case("EPSG") {
        return None;
    }
    match codes.split_once('+') {
        Some((first, second)) => {
            Some((first.trim().parse().ok()?, Some(second.trim().parse().ok()?)))
        }
        None => Some((codes.trim().parse().ok()?, None)),
    }
}

/// The CRS of a code. A compound code stands for both parts.
pub(super) fn of_code(code: u32) -> Crs {
    let known = codes::text(code).map_or_else(Crs::default, from_text);
    match (known.epsg, known.vertical_epsg) {
        (Some(first), Some(second)) => of_codes(first, second),
        _ => Crs { epsg: Some(code), wkt: None, ..known },
    }
}

/// The compound CRS of a horizontal and a vertical code.
pub(super) fn of_codes(code: u32, vertical: u32) -> Crs {
    let unit = vertical::by_code(vertical).map(|known| known.unit.name);
    Crs { vertical_epsg: Some(vertical), vertical_unit: unit, ..of_code(code) }
}

/// Codes of the names that Esri writes without a code.
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
    utm_code(system, north, zone)
}

/// EPSG code of a UTM zone of a datum, which is named as in Esri's CRS names; `None` if it has none.
///
/// ```
/// use terrane_base::geom::wkt::utm_code;
/// assert_eq!(utm_code("NAD_1983", true, 13), Some(26913));
/// assert_eq!(utm_code("NAD_1983", true, 29), None);
/// ```
pub fn utm_code(datum: &str, north: bool, zone: u32) -> Option<u32> {
    match (datum, north, zone) {
        ("WGS_1984", true, 1..=60) => Some(32600 + zone),
        ("WGS_1984", false, 1..=60) => Some(32700 + zone),
        ("WGS_1972", true, 1..=60) => Some(32200 + zone),
        ("WGS_1972", false, 1..=60) => Some(32300 + zone),
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
    fn a_compound_system_has_two_codes_and_two_units() {
        let wkt = r#"COMPD_CS["both",PROJCS["a",GEOGCS["b",UNIT["degree",0.017]],UNIT["metre",1],AUTHORITY["EPSG","2154"]],VERT_CS["c",VERT_DATUM["d",2005],UNIT["US survey foot",0.3048],AUTHORITY["EPSG","6360"]]]"#;
        let crs = from_text(wkt);
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(2154), Some(6360)));
        assert_eq!(crs.horizontal_unit(), "metre");
        assert_eq!(crs.vertical_unit.as_deref(), Some("US survey foot"));
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
