//! Well-known text of coordinate reference systems: which system it is, and its units.

use super::Crs;

/// Keywords of horizontal systems.
const HORIZONTAL: [&str; 5] = ["PROJCS", "PROJCRS", "GEOGCS", "GEOGCRS", "GEODCRS"];
/// Keywords of vertical systems.
const VERTICAL: [&str; 3] = ["VERT_CS", "VERTCRS", "VERTICALCRS"];

/// From well-known text; other text (the old "Projection UTM" form) becomes the name alone.
pub fn from_text(text: &str) -> Crs {
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
    let horizontal = part(text, &HORIZONTAL).unwrap_or(text);
    let vertical = part(text, &VERTICAL);
    Crs {
        epsg: outermost_code(horizontal)
            .or_else(|| outermost_code(text))
            .or_else(|| esri_code(name)),
        vertical_epsg: vertical.and_then(outermost_code),
        citation: Some(name.to_owned()),
        wkt: Some(text.to_owned()),
        geographic: Some(geographic),
        vertical_unit: vertical.and_then(last_unit).map(str::to_owned),
        ..Crs::default()
    }
}

/// Unit of the axes of the horizontal system, by its usual name.
pub(super) fn horizontal_unit(text: &str) -> Option<&'static str> {
    last_unit(part(text, &HORIZONTAL).unwrap_or(text))
}

/// The last unit named in a system's text is that of its axes.
fn last_unit(text: &str) -> Option<&'static str> {
    let unit = text.rsplit("UNIT[\"").next()?.split('"').next()?.to_lowercase();
    match unit.as_str() {
        "metre" | "meter" | "m" => Some("metre"),
        "degree" => Some("degree"),
        "us survey foot" | "foot_us" | "us_survey_foot" | "u.s. survey foot" => {
            Some("US survey foot")
        }
        "foot" | "ft" | "international foot" | "foot_international" => Some("foot"),
        _ => None,
    }
}

/// The first part of `text` that begins with one of `keywords`, to its closing bracket.
fn part<'a>(text: &'a str, keywords: &[&str]) -> Option<&'a str> {
    let mut quoted = false;
    let mut word = 0;
    for (i, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '(' if !quoted => {
                let keyword = text[word..i].trim();
                if keywords.iter().any(|known| keyword.eq_ignore_ascii_case(known)) {
                    return Some(&text[word..word + closed(&text[word..])?]);
                }
                word = i + 1;
            }
            ',' if !quoted => word = i + 1,
            _ => {}
        }
    }
    None
}

/// Bytes up to the bracket that closes the first one.
fn closed(text: &str) -> Option<usize> {
    let (mut depth, mut quoted) = (0_u32, false);
    for (i, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '(' if !quoted => depth += 1,
            ']' | ')' if !quoted => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(i + 1);
                }
            }
            _ => {}
        }
    }
    None
}

/// From well-known text, or from a name such as "EPSG:4326"; unknown where the text is empty.
pub fn of_srs(text: &str) -> Crs {
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
    // A compound code stands for both.
    Crs { epsg: Some(code), vertical_epsg: None, ..crs }
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
    fn a_compound_system_has_two_codes_and_two_units() {
        let wkt = r#"COMPD_CS["both",PROJCS["a",GEOGCS["b",UNIT["degree",0.017]],UNIT["metre",1],AUTHORITY["EPSG","2154"]],VERT_CS["c",VERT_DATUM["d",2005],UNIT["US survey foot",0.3048],AUTHORITY["EPSG","6360"]]]"#;
        let crs = from_text(wkt);
        assert_eq!((crs.epsg, crs.vertical_epsg), (Some(2154), Some(6360)));
        assert_eq!(crs.horizontal_unit(), "metre");
        assert_eq!(crs.vertical_unit.as_deref(), Some("US survey foot"));
        assert_eq!(part("A[PROJCS[\"[\",B[1]],C]", &HORIZONTAL), Some("PROJCS[\"[\",B[1]]"));
        assert_eq!(part("A[PROJCS[", &HORIZONTAL), None);
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
