//! Systems by their EPSG codes, from the definitions that come with terrane.

use super::definition::{Geographic, Horizontal, Named, Vertical};
use super::node::Node;
use super::unit::Unit;
use super::wkt;

/// All vertical systems of the EPSG dataset: code, code of the unit, direction, code of the datum,
/// name, and name of the datum.
const VERTICAL: &str = include_str!("vertical.tsv");

/// Codes of geographic systems, old and new.
const GEOGRAPHIC: [std::ops::RangeInclusive<u16>; 3] = [4001..=4999, 6310..=9999, 20_000..=20_050];

/// The text of a code, as it is kept: mostly of the first kind.
pub(super) fn text(code: u32) -> Option<&'static str> {
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt)
}

/// Whether the system of an EPSG code is of latitude and longitude; `None` where the code is unknown.
pub fn is_geographic(code: u32) -> Option<bool> {
    // The text may be bound to another system, which comes after its own.
    Some(wkt::from_text(text(code)?).geographic == Some(true))
}

/// The horizontal system of a code.
pub(super) fn horizontal(code: u32) -> Option<Horizontal> {
    let nodes = Node::all(text(code)?)?;
    let found = wkt::horizontal(nodes.first()?)?;
    Some(match found {
        Horizontal::Geographic(own) => {
            Horizontal::Geographic(Geographic { code: Some(code), ..own })
        }
        other => other,
    })
}

/// The geographic system of a code.
pub(super) fn geographic(code: u32) -> Option<Geographic> {
    match horizontal(code)? {
        Horizontal::Geographic(own) => Some(own),
        _ => None,
    }
}

/// A geographic system that `is` is true of; the one with the lowest code.
pub(super) fn geographic_with(is: impl Fn(&Geographic) -> bool) -> Option<Geographic> {
    let mut all = GEOGRAPHIC.into_iter().flatten().filter_map(|code| {
        let text = crs_definitions::from_code(code)?.wkt;
        text.starts_with("GEOGCS").then(|| geographic(code.into()))?
    });
    all.find(is)
}

/// The vertical system of a code.
pub(super) fn vertical(code: u32) -> Option<Vertical> {
    let number = code.to_string();
    let mut rows = VERTICAL.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let row = rows.find(|row| row[0] == number)?;
    let [_, unit, direction, datum_code, name, datum] = row[..] else { return None };
    Some(Vertical {
        name: name.to_owned(),
        code: Some(code),
        datum: Named { name: datum.to_owned(), code: datum_code.parse().ok() },
        unit: Unit::of_code(unit.parse().ok()?)?,
        is_down: direction == "down",
    })
}

/// The code of a vertical datum that is called so.
pub(super) fn vertical_datum(name: &str) -> Option<u32> {
    let named = super::unit::plain(name);
    let mut rows = VERTICAL.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let row = rows.find(|row| row.get(5).is_some_and(|own| super::unit::plain(own) == named))?;
    row[3].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertical_code_has_a_unit() {
        for line in VERTICAL.lines() {
            let code = line.split('\t').next().unwrap().parse().unwrap();
            assert!(vertical(code).is_some(), "{line}");
        }
        for (code, unit) in [
            (5703, "metre"),
            (6360, "US survey foot"),
            (8228, "foot"),
            (5773, "metre"),
            (3855, "metre"),
            (5702, "US survey foot"),
            (5714, "metre"),
            (8357, "metre"),
        ] {
            assert_eq!(vertical(code).unwrap().unit.name, unit, "{code}");
        }
        assert_eq!((vertical(0), vertical(4326)), (None, None));
    }
}
