//! Datum shifts to WGS 84: EPSG operations with area of use and accuracy. `tools/make_shifts.py` writes the table.

use super::area::AreaOfUse;

const SHIFTS: &str = include_str!("shifts.tsv");

/// EPSG code of the WGS 84 datum.
pub(crate) const WGS84: u32 = 6326;

/// Accuracy in metres up to which EPSG's null shift to WGS 84 is preferred, even over shifts with a better stated
/// accuracy, so that datums of one family stay together.
const SAME: f64 = 4.0;

/// A datum shift to WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KnownDatumShift {
    /// EPSG code of the operation.
    pub(crate) code: u32,
    pub(crate) name: &'static str,
    /// Accuracy in metres.
    pub(crate) accuracy: f64,
    pub(crate) area: AreaOfUse,
    /// Parameters: metres, arc-seconds, parts per million.
    pub(crate) numbers: [f64; 7],
}

impl KnownDatumShift {
    /// True if positions are unchanged.
    pub(crate) fn is_null(&self) -> bool {
        self.numbers == [0.0; 7]
    }

    fn of_line(line: &'static str) -> Option<(u32, Self)> {
        let fields: Vec<&str> = line.split('\t').collect();
        let [datum, code, accuracy, area, parameters, name] = fields[..].try_into().ok()?;
        let [west, south, east, north] = all_numbers(area)?[..] else { return None };
        let area = AreaOfUse { west, south, east, north };
        let mut numbers = [0.0; 7];
        for (place, number) in numbers.iter_mut().zip(all_numbers(parameters)?) {
            *place = number;
        }
        let (code, accuracy) = (code.parse().ok()?, accuracy.parse().ok()?);
        Some((datum.parse().ok()?, Self { code, name, accuracy, area, numbers }))
    }

    /// True if the datum is taken for WGS 84.
    fn is_preferred(&self) -> bool {
        self.is_null() && self.accuracy <= SAME
    }
}

/// The shifts of a datum, the preferred one first: null shifts, then by accuracy, smaller area and newer code.
pub(crate) fn shifts(datum: u32) -> Vec<KnownDatumShift> {
    let all = SHIFTS.lines().filter_map(KnownDatumShift::of_line);
    let mut shifts: Vec<KnownDatumShift> =
        all.filter(|(of, _)| *of == datum).map(|(_, known)| known).collect();
    shifts.sort_by(|a, b| {
        (b.is_preferred().cmp(&a.is_preferred()))
            .then(a.accuracy.total_cmp(&b.accuracy))
            .then(a.area.size().total_cmp(&b.area.size()))
            .then(b.code.cmp(&a.code))
    });
    shifts
}

fn all_numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|number| number.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_says_a_shift() {
        for line in SHIFTS.lines() {
            let (_, known) = KnownDatumShift::of_line(line).unwrap_or_else(|| panic!("{line}"));
            assert!((0.0..=50.0).contains(&known.accuracy) && known.area.size() > 0.0, "{line}");
            assert!(known.numbers[..3].iter().all(|by| by.abs() < 3000.0), "{line}");
            assert!(known.numbers[3..].iter().all(|by| by.abs() < 300.0), "{line}");
        }
        assert!(SHIFTS.lines().count() > 700);
    }

    #[test]
    fn datums_that_stand_for_wgs_84_do_so_first() {
        for datum in [6258, 6269, 6283, 1168, 6167, 1128, 6152, 1116] {
            let first = shifts(datum)[0];
            assert!(first.is_null() && first.accuracy <= SAME, "{datum} {first:?}");
        }
        assert_eq!(shifts(6314)[0].code, 15869);
        assert!(shifts(1).is_empty());
    }
}
