//! Systems by their EPSG codes, from the definitions that come with terrane.

use super::definition::{GeographicCrs, Horizontal};
use super::node::CrsWktNode;
use super::read;

/// Codes of geographic systems, old and new.
const GEOGRAPHIC: [std::ops::RangeInclusive<u16>; 3] = [4001..=4999, 6310..=9999, 20_000..=20_050];

/// The text of a code, as it is kept: mostly of the first kind.
pub(super) fn text(code: u32) -> Option<&'static str> {
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt)
}

/// The horizontal system of a code.
pub(super) fn horizontal(code: u32) -> Option<Horizontal> {
    let nodes = CrsWktNode::all(text(code)?)?;
    let found = read::horizontal(nodes.first()?)?;
    Some(match found {
        Horizontal::Geographic(own) => {
            Horizontal::Geographic(GeographicCrs { code: Some(code), ..own })
        }
        other => other,
    })
}

/// The geographic system of a code.
pub(super) fn geographic(code: u32) -> Option<GeographicCrs> {
    match horizontal(code)? {
        Horizontal::Geographic(own) => Some(own),
        _ => None,
    }
}

/// A geographic system that `is` is true of; the one with the lowest code.
pub(super) fn geographic_with(is: impl Fn(&GeographicCrs) -> bool) -> Option<GeographicCrs> {
    let mut all = GEOGRAPHIC.into_iter().flatten().filter_map(|code| {
        let text = crs_definitions::from_code(code)?.wkt;
        text.starts_with("GEOGCS").then(|| geographic(code.into()))?
    });
    all.find(is)
}
