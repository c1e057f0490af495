//! CRS definitions by EPSG code, from the built-in dataset.

use super::definition::{GeographicCrs, Horizontal};
use super::node::CrsWktNode;
use super::read;

/// EPSG codes of geographic CRSs, old and new.
const GEOGRAPHIC: [std::ops::RangeInclusive<u16>; 3] = [4001..=4999, 6310..=9999, 20_000..=20_050];

/// The stored WKT of a code, mostly WKT 1.
pub(super) fn text(code: u32) -> Option<&'static str> {
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt)
}

/// The horizontal CRS of a code.
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

/// The geographic CRS of a code.
pub(super) fn geographic(code: u32) -> Option<GeographicCrs> {
    match horizontal(code)? {
        Horizontal::Geographic(own) => Some(own),
        _ => None,
    }
}

/// The geographic CRS with the lowest code for which `is` holds.
pub(super) fn geographic_with(is: impl Fn(&GeographicCrs) -> bool) -> Option<GeographicCrs> {
    let mut all = GEOGRAPHIC.into_iter().flatten().filter_map(|code| {
        let text = crs_definitions::from_code(code)?.wkt;
        text.starts_with("GEOGCS").then(|| geographic(code.into()))?
    });
    all.find(is)
}
