//! Meaning of WKT nodes, in any version.

use super::definition::{EpsgName, GeographicCrs, Horizontal, Projected, VerticalCrs, value_of};
use super::method::{ProjectionMethod, ProjectionParameter};
use super::node::CrsWktNode;
use super::unit::LengthUnit;
use super::vertical;

/// Keywords of geographic CRSs.
pub(super) const GEOGRAPHIC: [&str; 7] =
    ["GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS", "GEODETICCRS", "BASEGEOGCRS", "BASEGEODCRS"];
/// Keywords of projected CRSs.
pub(super) const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
/// Keywords of local (engineering) CRSs.
pub(super) const LOCAL: [&str; 3] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
/// Keywords of vertical CRSs.
pub(super) const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
const LENGTHS: [&str; 2] = ["UNIT", "LENGTHUNIT"];
const ANGLES: [&str; 2] = ["UNIT", "ANGLEUNIT"];
/// A degree in radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Unit of x and y.
pub(super) enum AxisUnit {
    Degrees,
    Length(LengthUnit),
}

/// The first node with one of these keywords, among these nodes and their descendants.
pub(super) fn find<'n, 'a>(
    nodes: &'n [CrsWktNode<'a>],
    keywords: &[&str],
) -> Option<&'n CrsWktNode<'a>> {
    nodes.iter().find_map(|node| node.find(keywords))
}

/// The node of the horizontal CRS.
pub(super) fn horizontal_in<'n, 'a>(nodes: &'n [CrsWktNode<'a>]) -> Option<&'n CrsWktNode<'a>> {
    find(nodes, &[&GEOGRAPHIC[..], &PROJECTED, &LOCAL].concat())
}

/// True for geocentric CRSs.
pub(super) fn is_geocentric(node: &CrsWktNode<'_>) -> bool {
    node.child(&["CS"]).is_some_and(|system| system.has_word("Cartesian"))
}

/// Horizontal and vertical CRS of a WKT, as far as known.
pub(super) fn parts(text: &str) -> (Option<Horizontal>, Option<VerticalCrs>) {
    let nodes = CrsWktNode::all(text).unwrap_or_default();
    (horizontal_in(&nodes).and_then(horizontal), find(&nodes, &VERTICAL).and_then(vertical))
}

/// True for WKT 1, which readers of `.prj` files expect.
pub(super) fn is_first_kind(text: &str) -> bool {
    let keyword = text.split(['[', '(']).next().unwrap_or_default().trim().to_uppercase();
    ["GEOGCS", "PROJCS", "LOCAL_CS", "COMPD_CS", "GEOCCS"].contains(&keyword.as_str())
}

/// Unit of x and y of a WKT.
pub(super) fn across(text: &str) -> Option<AxisUnit> {
    let nodes = CrsWktNode::all(text)?;
    let node = horizontal_in(&nodes)?;
    match node.is(&GEOGRAPHIC) {
        true => is_in_degrees(node).then_some(AxisUnit::Degrees),
        false => length(node).map(AxisUnit::Length),
    }
}

/// Meaning of the node of a horizontal CRS, or of a node that contains one.
pub(super) fn horizontal(node: &CrsWktNode<'_>) -> Option<Horizontal> {
    let node = horizontal_in(std::slice::from_ref(node))?;
    if node.is(&PROJECTED) {
        return projected(node).map(Horizontal::Projected);
    }
    if node.is(&LOCAL) {
        let unit = length(node).unwrap_or_else(LengthUnit::metre);
        return Some(Horizontal::Local { name: node.name().to_owned(), unit });
    }
    geographic(node).map(Horizontal::Geographic)
}

pub(super) fn geographic(node: &CrsWktNode<'_>) -> Option<GeographicCrs> {
    if is_geocentric(node) || !is_in_degrees(node) {
        return None;
    }
    let datum = node.child(&["DATUM", "ENSEMBLE", "TRF", "GEODETICDATUM"])?;
    let ellipsoid = datum.child(&["SPHEROID", "ELLIPSOID"])?;
    let meridian = node.child(&["PRIMEM", "PRIMEMERIDIAN"]);
    let system = node.child(&["CS"]);
    let axes = node.children().filter(|child| child.is(&["AXIS"])).count();
    Some(GeographicCrs {
        name: node.name().to_owned(),
        code: node.code(),
        datum: epsg_name(datum),
        ellipsoid: epsg_name(ellipsoid),
        axis: number(ellipsoid, 1.0)?,
        flattening: ellipsoid.number(1)?,
        meridian: meridian.map_or("Greenwich", CrsWktNode::name).to_owned(),
        from_greenwich: meridian.map_or(Some(0.0), |m| number(m, 1.0 / DEGREE))?,
        is_3d: node.child(&["LINUNIT"]).is_some()
            || axes == 3
            || system.is_some_and(|system| system.number(0) == Some(3.0)),
    })
}

/// True unless angles are in another unit, such as grads.
pub(super) fn is_in_degrees(node: &CrsWktNode<'_>) -> bool {
    let own = node.child(&ANGLES);
    let unit = own.or_else(|| node.child(&["AXIS"])?.child(&ANGLES));
    unit.and_then(|unit| unit.number(0)).is_none_or(|size| (size / DEGREE - 1.0).abs() < 1e-9)
}

/// The number of a node, times `scale` if the node has its own unit.
pub(super) fn number(node: &CrsWktNode<'_>, scale: f64) -> Option<f64> {
    let value = node.number(0)?;
    let unit = node.child(&["ANGLEUNIT", "LENGTHUNIT", "SCALEUNIT", "UNIT"]);
    let ratio = unit.and_then(|unit| unit.number(0)).map_or(1.0, |size| size * scale);
    // Sizes of units are rounded: for the same unit the number is unchanged.
    Some(if (ratio - 1.0).abs() < 1e-9 { value } else { value * ratio })
}

fn projected(node: &CrsWktNode<'_>) -> Option<Projected> {
    if node.child(&["EXTENSION"]).is_some() {
        return None;
    }
    let base = geographic(node.child(&GEOGRAPHIC)?)?;
    let unit = length(node)?;
    let conversion = node.child(&["CONVERSION"]).unwrap_or(node);
    let mut given = Vec::new();
    for parameter in conversion.children().filter(|child| child.is(&["PARAMETER"])) {
        let role = ProjectionParameter::of_name(parameter.name())?;
        let scale = match role {
            ProjectionParameter::Scale => 1.0,
            role if role.is_length() => 1.0 / unit.size,
            _ => 1.0 / DEGREE,
        };
        given.push((role, number(parameter, scale)?));
    }
    let method = conversion.child(&["PROJECTION", "METHOD"])?.name();
    let method = ProjectionMethod::of_name(method, |role| value_of(&given, role).is_some())?;
    Projected::new(epsg_name(node), base, method, |role| value_of(&given, role), unit)
}

fn epsg_name(node: &CrsWktNode<'_>) -> EpsgName {
    EpsgName { name: node.name().to_owned(), code: node.code() }
}

/// Length unit of a CRS: its own, or the unit of its first axis.
fn length(node: &CrsWktNode<'_>) -> Option<LengthUnit> {
    let unit = node.child(&LENGTHS).or_else(|| node.child(&["AXIS"])?.child(&LENGTHS))?;
    LengthUnit::of_node(unit)
}

/// Meaning of the node of a vertical CRS.
pub(super) fn vertical(node: &CrsWktNode<'_>) -> Option<VerticalCrs> {
    let known = node.code().and_then(vertical::by_code);
    let datum = ["VERT_DATUM", "VDATUM", "VRF", "VERTICALDATUM", "DATUM", "ENSEMBLE"];
    let datum = node.child(&datum);
    let axis = node.child(&["AXIS"]);
    let is_turned = node.children().any(|child| {
        child.is(&["PARAMETER"]) && child.name() == "Direction" && child.number(0) == Some(-1.0)
    });
    let unit = length(node).or(known.as_ref().map(|known| known.unit.clone()))?;
    let code = node.code().filter(|_| known.is_none_or(|known| known.unit.is(&unit)));
    Some(VerticalCrs {
        name: node.name().to_owned(),
        code,
        datum: datum.map(epsg_name).unwrap_or_default(),
        unit,
        is_down: is_turned || axis.is_some_and(|axis| axis.has_word("DOWN")),
    })
}
