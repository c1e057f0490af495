//! Well-known text of coordinate reference systems, in any dialect: which system it is, and what it
//! means.

use super::conversion::Datum;
use super::definition::{Geographic, Horizontal, Named, Projected, Vertical};
use super::method::{Method, Role};
use super::node::Node;
use super::unit::Unit;
use super::{Across, Crs, codes};

/// Keywords of systems of longitude and latitude.
const GEOGRAPHIC: [&str; 7] =
    ["GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS", "GEODETICCRS", "BASEGEOGCRS", "BASEGEODCRS"];
/// Keywords of projected systems.
const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
/// Keywords of systems without a place on Earth.
const LOCAL: [&str; 3] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
/// Keywords of vertical systems.
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
/// Keywords of systems that hold others or are none of these.
const OTHER: [&str; 4] = ["COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "GEOCCS"];
const LENGTHS: [&str; 2] = ["UNIT", "LENGTHUNIT"];
const ANGLES: [&str; 2] = ["UNIT", "ANGLEUNIT"];
/// A degree in radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// From well-known text; other text (the old "Projection UTM" form) becomes the name alone.
pub fn from_text(text: &str) -> Crs {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim();
    let mut known = GEOGRAPHIC.iter().chain(&PROJECTED).chain(&LOCAL).chain(&OTHER);
    if !known.any(|known| known.eq_ignore_ascii_case(keyword)) {
        let name = text.lines().next().map(|line| line.trim().chars().take(80).collect());
        return Crs { citation: name, ..Crs::default() };
    }
    let nodes = Node::all(text).unwrap_or_default();
    let horizontal = find(&nodes, &[&GEOGRAPHIC[..], &PROJECTED, &LOCAL].concat());
    let meaning = horizontal.and_then(self::horizontal);
    let vertical = find(&nodes, &VERTICAL);
    let height = vertical.and_then(self::vertical);
    let name = text.split('"').nth(1).unwrap_or_default();
    let own = horizontal.or(nodes.first());
    let epsg = own.and_then(Node::code).or_else(|| esri_code(own.map_or(name, Node::name)));
    let is_geographic = own.and_then(|node| match node {
        node if node.is(&LOCAL) => None,
        node => Some(node.is(&GEOGRAPHIC) && !is_geocentric(node)),
    });
    let ellipsoidal = match &meaning {
        Some(Horizontal::Geographic(own)) if own.is_3d => Some("metre".to_owned()),
        _ => None,
    };
    let believed = |code: &u32| match (&meaning, codes::horizontal(*code)) {
        (Some(said), Some(known)) => !said.contradicts(&known),
        _ => true,
    };
    Crs {
        epsg: epsg.filter(believed),
        vertical_epsg: match &height {
            Some(own) => own.code,
            None => vertical.and_then(Node::code),
        },
        citation: Some(name.to_owned()),
        wkt: Some(text.to_owned()),
        geographic: is_geographic,
        vertical_unit: height.map(|own| own.unit.name).or(ellipsoidal),
        ..Crs::default()
    }
}

fn find<'n, 'a>(nodes: &'n [Node<'a>], keywords: &[&str]) -> Option<&'n Node<'a>> {
    nodes.iter().find_map(|node| node.find(keywords))
}

/// True for x, y and z from the centre of the Earth.
fn is_geocentric(node: &Node<'_>) -> bool {
    node.child(&["CS"]).is_some_and(|system| system.has_word("Cartesian"))
}

/// What a text says of x and y, and of z, as far as it can be told.
pub(super) fn parts(text: &str) -> (Option<Horizontal>, Option<Vertical>) {
    let nodes = Node::all(text).unwrap_or_default();
    let systems = [&GEOGRAPHIC[..], &PROJECTED, &LOCAL].concat();
    let horizontal = find(&nodes, &systems).and_then(horizontal);
    (horizontal, find(&nodes, &VERTICAL).and_then(vertical))
}

/// True for text of the first kind, which readers of `.prj` files know.
pub(super) fn is_first_kind(text: &str) -> bool {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim().to_uppercase();
    ["GEOGCS", "PROJCS", "LOCAL_CS", "COMPD_CS", "GEOCCS"].contains(&keyword.as_str())
}

/// What x and y of a text are counted in.
pub(super) fn across(text: &str) -> Option<Across> {
    let nodes = Node::all(text)?;
    let node = find(&nodes, &[&GEOGRAPHIC[..], &PROJECTED, &LOCAL].concat())?;
    match node.is(&GEOGRAPHIC) {
        true => is_in_degrees(node).then_some(Across::Degrees),
        false => length(node).map(Across::Length),
    }
}

/// What the node of a horizontal system, or of one that holds one, means.
pub(super) fn horizontal(node: &Node<'_>) -> Option<Horizontal> {
    let node = node.find(&[&GEOGRAPHIC[..], &PROJECTED, &LOCAL].concat())?;
    if node.is(&PROJECTED) {
        return projected(node).map(Horizontal::Projected);
    }
    if node.is(&LOCAL) {
        let unit = length(node).unwrap_or_else(Unit::metre);
        return Some(Horizontal::Local { name: node.name().to_owned(), unit });
    }
    geographic(node).map(Horizontal::Geographic)
}

fn geographic(node: &Node<'_>) -> Option<Geographic> {
    if is_geocentric(node) || !is_in_degrees(node) {
        return None;
    }
    let of = |node: &Node<'_>| Named { name: node.name().to_owned(), code: node.code() };
    let datum = node.child(&["DATUM", "ENSEMBLE", "TRF", "GEODETICDATUM"])?;
    let ellipsoid = datum.child(&["SPHEROID", "ELLIPSOID"])?;
    let meridian = node.child(&["PRIMEM", "PRIMEMERIDIAN"]);
    let system = node.child(&["CS"]);
    let axes = node.children().filter(|child| child.is(&["AXIS"])).count();
    Some(Geographic {
        name: node.name().to_owned(),
        code: node.code(),
        datum: of(datum),
        ellipsoid: of(ellipsoid),
        axis: number(ellipsoid, 1.0)?,
        flattening: ellipsoid.number(1)?,
        meridian: meridian.map_or("Greenwich", Node::name).to_owned(),
        from_greenwich: meridian.map_or(Some(0.0), |m| number(m, 1.0 / DEGREE))?,
        is_3d: node.child(&["LINUNIT"]).is_some()
            || axes == 3
            || system.is_some_and(|system| system.number(0) == Some(3.0)),
    })
}

/// The datum of the system of a text, and whether its angles are in degrees.
pub(super) fn datum(nodes: &[Node<'_>]) -> Option<(Datum, bool)> {
    let node = find(nodes, &GEOGRAPHIC)?;
    let datum = node.child(&["DATUM", "ENSEMBLE", "TRF", "GEODETICDATUM"])?;
    let ellipsoid = datum.child(&["SPHEROID", "ELLIPSOID"])?;
    let known = Datum {
        name: datum.name().to_owned(),
        code: datum.code(),
        axis: number(ellipsoid, 1.0)?,
        flattening: ellipsoid.number(1)?,
    };
    match geographic(node).filter(|_| known.code.is_none()) {
        Some(own) => Some((own.to_datum(), true)),
        None => Some((known, is_in_degrees(node))),
    }
}

/// True unless angles are in something else, such as grads.
fn is_in_degrees(node: &Node<'_>) -> bool {
    let own = node.child(&ANGLES);
    let unit = own.or_else(|| node.child(&["AXIS"])?.child(&ANGLES));
    unit.and_then(|unit| unit.number(0)).is_none_or(|size| (size / DEGREE - 1.0).abs() < 1e-9)
}

/// The number of a node, in its own unit where it has one: times `scale` then.
fn number(node: &Node<'_>, scale: f64) -> Option<f64> {
    let value = node.number(0)?;
    let unit = node.child(&["ANGLEUNIT", "LENGTHUNIT", "SCALEUNIT", "UNIT"]);
    let ratio = unit.and_then(|unit| unit.number(0)).map_or(1.0, |size| size * scale);
    // Units are rounded: of the same one the number is left alone.
    Some(if (ratio - 1.0).abs() < 1e-9 { value } else { value * ratio })
}

fn projected(node: &Node<'_>) -> Option<Projected> {
    if node.child(&["EXTENSION"]).is_some() {
        return None;
    }
    let base = geographic(node.child(&GEOGRAPHIC)?)?;
    let unit = length(node)?;
    let conversion = node.child(&["CONVERSION"]).unwrap_or(node);
    let mut given = Vec::new();
    for parameter in conversion.children().filter(|child| child.is(&["PARAMETER"])) {
        let role = Role::of_name(parameter.name())?;
        let scale = match role {
            Role::Scale => 1.0,
            role if role.is_length() => 1.0 / unit.size,
            _ => 1.0 / DEGREE,
        };
        given.push((role, number(parameter, scale)?));
    }
    let value = |role| given.iter().find(|(own, _)| *own == role).map(|(_, value)| *value);
    let method = conversion.child(&["PROJECTION", "METHOD"])?.name();
    let method = Method::of_name(method, |role| value(role).is_some())?;
    Projected::new((node.name().to_owned(), node.code()), base, method, value, unit)
}

/// The unit of lengths of a system: its own, or that of its first axis.
fn length(node: &Node<'_>) -> Option<Unit> {
    let unit = node.child(&LENGTHS).or_else(|| node.child(&["AXIS"])?.child(&LENGTHS))?;
    Unit::of_node(unit)
}

/// What the node of a vertical system means.
fn vertical(node: &Node<'_>) -> Option<Vertical> {
    let known = node.code().and_then(codes::vertical);
    let datum = ["VERT_DATUM", "VDATUM", "VRF", "VERTICALDATUM", "DATUM", "ENSEMBLE"];
    let datum = node.child(&datum);
    let axis = node.child(&["AXIS"]);
    let turned = |child: &Node<'_>| {
        child.is(&["PARAMETER"]) && child.name() == "Direction" && child.number(0) == Some(-1.0)
    };
    let unit = length(node).or(known.as_ref().map(|known| known.unit.clone()))?;
    let code = node.code().filter(|_| known.is_none_or(|known| known.unit.is(&unit)));
    Some(Vertical {
        name: node.name().to_owned(),
        code,
        datum: datum.map_or_else(Named::default, |datum| Named {
            name: datum.name().to_owned(),
            code: datum.code(),
        }),
        unit,
        is_down: axis.is_some_and(|axis| axis.has_word("DOWN")) || node.children().any(turned),
    })
}

/// From well-known text, or from a name such as "EPSG:4326" or "EPSG:6339+6360"; unknown where the
/// text is empty.
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

/// The codes of a system, of x and y and of z.
fn codes_in(text: &str) -> Option<(u32, Option<u32>)> {
    let (name, codes) = text.split_once(':')?;
    let code = |text: &str| text.trim().parse().ok();
    let (first, second) = codes.split_once('+').unzip();
    let is_epsg = name.trim().eq_ignore_ascii_case("EPSG");
    let codes = (code(first.unwrap_or(codes))?, second.map(code));
    match codes {
        _ if !is_epsg => None,
        (_, Some(None)) => None,
        (first, second) => Some((first, second.flatten())),
    }
}

/// The system of a code, with what is known of it. The code of a compound one stands for both.
pub(super) fn of_code(code: u32) -> Crs {
    let known = codes::text(code).map_or_else(Crs::default, from_text);
    match (known.epsg, known.vertical_epsg) {
        (Some(first), Some(second)) => of_codes(first, second),
        _ => Crs { epsg: Some(code), wkt: None, ..known },
    }
}

/// The systems of two codes, of x and y and of z.
pub(super) fn of_codes(code: u32, vertical: u32) -> Crs {
    let unit = codes::vertical(vertical).map(|known| known.unit.name);
    Crs { vertical_epsg: Some(vertical), vertical_unit: unit, ..of_code(code) }
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
