//! Vertical CRSs and their datums by EPSG code.

use super::definition::{EpsgName, VerticalCrs};
use super::unit::{LengthUnit, plain};

/// All vertical CRSs of the EPSG dataset: code, code of the unit, direction, code of the datum, name, and name of the
/// datum.
const VERTICAL: &str = include_str!("vertical.tsv");

/// The vertical CRS of a code.
pub(super) fn by_code(code: u32) -> Option<VerticalCrs> {
    let number = code.to_string();
    let mut rows = VERTICAL.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let row = rows.find(|row| row[0] == number)?;
    let [_, unit, direction, datum_code, name, datum] = row[..] else { return None };
    Some(VerticalCrs {
        name: name.to_owned(),
        code: Some(code),
        datum: EpsgName { name: datum.to_owned(), code: datum_code.parse().ok() },
        unit: LengthUnit::of_code(unit.parse().ok()?)?,
        is_down: direction == "down",
    })
}

/// The code of the vertical datum with this name.
pub(super) fn datum_code(name: &str) -> Option<u32> {
    let named = plain(name);
    let mut rows = VERTICAL.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let row = rows.find(|row| row.get(5).is_some_and(|own| plain(own) == named))?;
    row[3].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertical_code_has_a_unit() {
        for line in VERTICAL.lines() {
            let code = line.split('\t').next().unwrap().parse().unwrap();
            assert!(by_code(code).is_some(), "{line}");
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
            assert_eq!(by_code(code).unwrap().unit.name, unit, "{code}");
        }
        assert_eq!((by_code(0), by_code(4326)), (None, None));
    }
}
