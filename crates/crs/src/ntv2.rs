//! Datum shift grids: NTv2 files (`.gsb`), in either byte order.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Datum;
use terrane_base::limits;

use super::geoid::MAX_GRID_BYTES;

const RECORD: usize = 16;
/// Records of a header.
const HEADER: usize = 11;
/// Maximum number of subgrids.
const MAX_GRIDS: u64 = 65_536;
/// Maximum iterations of the inverse shift.
const STEPS: u32 = 20;
/// Remaining error of the inverse shift, in radians: a hundredth of a millimetre.
const LEFT: f64 = 1e-12;
/// Names of datums in files that share their ellipsoid with others, and EPSG codes of datums.
const NAMES: [(&str, u32); 8] = [
    ("GDA94", 6283),
    ("GDA2020", 1168),
    ("NAD83", 6269),
    ("ETRS89", 6258),
    ("WGS84", 6326),
    ("JGD2000", 6612),
    ("JGD2011", 1128),
    ("ED50", 6230),
];

/// A datum shift grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ShiftGrid {
    names: [String; 2],
    /// Semi-major axes of both ellipsoids.
    axes: [f64; 2],
    grids: Vec<Ntv2Grid>,
}

#[derive(Clone, Debug, PartialEq)]
struct Ntv2Grid {
    /// South, north, east and west limits in seconds of arc; longitudes are positive to the west.
    sides: [f64; 4],
    /// Steps of latitude and longitude.
    step: [f64; 2],
    columns: usize,
    /// Shifts of latitude and of longitude (positive west), in seconds, from the south-east, row by row to the north.
    shifts: Vec<[f32; 2]>,
}

/// Reads values in the byte order of a file.
struct Ntv2Reader<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

impl<'a> Ntv2Reader<'a> {
    fn value(&self, record: usize) -> Option<&'a [u8; 8]> {
        let at = record * RECORD + 8;
        self.bytes.get(at..at + 8)?.try_into().ok()
    }

    fn text(&self, record: usize) -> Option<String> {
        Some(String::from_utf8_lossy(self.value(record)?).trim_matches(['\0', ' ']).to_owned())
    }

    fn number(&self, record: usize) -> Option<f64> {
        let bytes = *self.value(record)?;
        let value = if self.is_big { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) };
        value.is_finite().then_some(value)
    }

    fn count(&self, record: usize) -> Option<u32> {
        let bytes = self.value(record)?[..4].try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn float(&self, bytes: &[u8]) -> f32 {
        let bytes = bytes.try_into().unwrap_or_default();
        if self.is_big { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
    }
}

impl ShiftGrid {
    /// From the bytes of an NTv2 file.
    ///
    /// # Errors
    /// Invalid or damaged files, and units other than seconds of arc.
    pub fn of_ntv2(bytes: &[u8]) -> Result<Self> {
        limits::check("size of the shift grid in bytes", bytes.len() as u64, MAX_GRID_BYTES)?;
        // The format has no mark for its order of bytes. The first number, that of header records, is 11.
        let is_big = match bytes.get(8..12) {
            Some([11, 0, 0, 0]) => false,
            Some([0, 0, 0, 11]) => true,
            _ => return Err(invalid_ntv2("the header does not have 11 records")),
        };
        let file = Ntv2Reader { bytes, is_big };
        let (Some(count), Some(unit)) = (file.count(2), file.text(3)) else {
            return Err(invalid_ntv2("the header is truncated"));
        };
        limits::check("number of subgrids", count.into(), MAX_GRIDS)?;
        if unit != "SECONDS" {
            return Err(Error::unsupported(format!("shifts in \"{unit}\" are not supported"))
                .remedy("use a file in seconds of arc"));
        }
        let (Some(from), Some(to), Some(from_axis), Some(to_axis)) =
            (file.text(5), file.text(6), file.number(7), file.number(9))
        else {
            return Err(invalid_ntv2("the header is truncated or not numeric"));
        };
        let mut rest =
            bytes.get(HEADER * RECORD..).ok_or_else(|| invalid_ntv2("the header is truncated"))?;
        let mut grids = Vec::new();
        for number in 1..=count {
            let (grid, length) =
                Ntv2Grid::read(&Ntv2Reader { bytes: rest, is_big }).ok_or_else(|| {
                    invalid_ntv2(&format!("subgrid {number} of {count} is truncated or invalid"))
                })?;
            grids.push(grid);
            rest = &rest[length..];
        }
        if grids.is_empty() {
            return Err(invalid_ntv2("it has no subgrids"));
        }
        Ok(Self { names: [from, to], axes: [from_axis, to_axis], grids })
    }

    /// Name of the shift in either direction.
    pub(crate) fn name(&self, is_back: bool) -> String {
        let [from, to] = &self.names;
        let [from, to] = if is_back { [to, from] } else { [from, to] };
        format!("shift grid from {from} to {to}")
    }

    /// True if it leads from the second datum to the first.
    ///
    /// # Errors
    /// The grid is for other datums, or does not state them.
    pub(crate) fn is_back(&self, datums: [&Datum; 2]) -> Result<bool> {
        let [from, to] = datums;
        let fits = [[from, to], [to, from]].map(|datums| {
            datums.iter().zip(self.axes).all(|(datum, axis)| (axis - datum.axis).abs() < 0.5)
        });
        match fits {
            [true, false] => Ok(false),
            [false, true] => Ok(true),
            [true, true] => self.is_back_by_name(datums),
            [false, false] => Err(self.foreign(datums)),
        }
    }

    fn is_back_by_name(&self, datums: [&Datum; 2]) -> Result<bool> {
        let codes = self.names.each_ref().map(|name| datum_code(name));
        let [from, to] = datums;
        let fits = [[from, to], [to, from]].map(|datums| {
            let mut pairs = datums.iter().zip(codes);
            pairs.all(|(datum, code)| code.is_none_or(|code| datum.code == Some(code)))
        });
        // Without a known name both directions fit.
        match fits {
            [true, false] => Ok(false),
            [false, true] => Ok(true),
            _ => Err(self.foreign(datums)),
        }
    }

    fn foreign(&self, datums: [&Datum; 2]) -> Error {
        let [from, to] = datums.map(|datum| datum.name.replace('_', " "));
        let [a, b] = &self.names;
        Error::bad_input(format!(
            "the shift grid from {a} to {b} does not match the datums {from} and {to}"
        ))
        .remedy("use the shift grid between these two datums")
    }

    /// Shifts a place, in radians, to the other datum.
    pub(crate) fn apply(&self, place: [f64; 2], is_back: bool) -> Result<[f64; 2]> {
        let moved = if is_back { self.undone(place) } else { self.shifted(place) };
        moved.ok_or_else(|| {
            let [longitude, latitude] = place.map(f64::to_degrees);
            Error::bad_input(format!(
                "the shift grid does not cover longitude {longitude:.4}, latitude {latitude:.4}"
            ))
            .remedy("use a shift grid that covers the whole area")
        })
    }

    fn shifted(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let [longitude, latitude] = place.map(|angle| angle.to_degrees() * 3600.0);
        let [up, west] = self.shift([latitude, -longitude])?;
        Some([longitude - west, latitude + up].map(|seconds| (seconds / 3600.0).to_radians()))
    }

    /// The inverse shift.
    fn undone(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let mut origin = place;
        for _ in 0..STEPS {
            let there = self.shifted(origin)?;
            // A shift hardly changes over its own length, so each round leaves a small share of what was left.
            let left = [place[0] - there[0], place[1] - there[1]];
            origin = [origin[0] + left[0], origin[1] + left[1]];
            if left[0].abs().max(left[1].abs()) < LEFT {
                return Some(origin);
            }
        }
        None
    }

    /// The shift of the finest subgrid that contains a place.
    fn shift(&self, [latitude, west]: [f64; 2]) -> Option<[f64; 2]> {
        let once = 360.0 * 3600.0;
        // Grids may count longitudes past 180 degrees on either side.
        [west, west - once, west + once].into_iter().find_map(|west| {
            let grids = self.grids.iter().filter(|grid| grid.holds([latitude, west]));
            // A grid within another has the smaller step, so names of parents need not be followed.
            let finest = grids.min_by(|a, b| a.step[0].total_cmp(&b.step[0]));
            finest?.shift([latitude, west])
        })
    }
}

impl Ntv2Grid {
    /// Reads the next subgrid, and its length in bytes.
    fn read(file: &Ntv2Reader<'_>) -> Option<(Self, usize)> {
        let sides = [file.number(4)?, file.number(5)?, file.number(6)?, file.number(7)?];
        let step = [file.number(8)?, file.number(9)?];
        let count = usize::try_from(file.count(10)?).ok()?;
        let rows = lines(sides[0], sides[1], step[0])?;
        let columns = lines(sides[2], sides[3], step[1])?;
        let start = HEADER * RECORD;
        let length = start + rows.checked_mul(columns).filter(|all| *all == count)? * RECORD;
        let nodes = file.bytes.get(start..length)?.chunks_exact(RECORD);
        let shifts = nodes.map(|node| [file.float(&node[..4]), file.float(&node[4..8])]).collect();
        Some((Self { sides, step, columns, shifts }, length))
    }

    fn holds(&self, [latitude, west]: [f64; 2]) -> bool {
        // Seconds of arc, 0.03 mm: conversions of degrees put a place on the side beyond it by less.
        let hair = 1e-6;
        let [south, north, east, far] = self.sides;
        (south - hair..=north + hair).contains(&latitude)
            && (east - hair..=far + hair).contains(&west)
    }

    /// Bilinear interpolation.
    fn shift(&self, [latitude, west]: [f64; 2]) -> Option<[f64; 2]> {
        let rows = self.shifts.len() / self.columns;
        let (row, up) = cell((latitude - self.sides[0]) / self.step[0], rows);
        let (column, across) = cell((west - self.sides[2]) / self.step[1], self.columns);
        let corners = [[0, 0], [0, 1], [1, 0], [1, 1]]
            .map(|[r, c]| self.shifts[(row + r) * self.columns + column + c].map(f64::from));
        let weights =
            [(1.0 - up) * (1.0 - across), (1.0 - up) * across, up * (1.0 - across), up * across];
        let shift = [0, 1].map(|axis: usize| {
            let terms = corners.iter().zip(weights).map(|(corner, weight)| corner[axis] * weight);
            terms.sum::<f64>()
        });
        // Shifts of a degree or more are damage.
        shift.iter().all(|seconds| seconds.abs() < 3600.0).then_some(shift)
    }
}

/// Number of rows or columns of a subgrid.
fn lines(low: f64, high: f64, step: f64) -> Option<usize> {
    let lines = ((high - low) / step).round() + 1.0;
    (step > 0.0 && (2.0..1e6).contains(&lines)).then_some(lines as usize)
}

/// First of the two nodes around a coordinate in steps, and the fraction between them.
fn cell(at: f64, count: usize) -> (usize, f64) {
    let low = at.floor().clamp(0.0, (count - 2) as f64);
    (low as usize, (at - low).clamp(0.0, 1.0))
}

/// EPSG code of a datum by its name in a file.
fn datum_code(name: &str) -> Option<u32> {
    NAMES.iter().find(|(known, _)| *known == name.to_uppercase()).map(|(_, code)| *code)
}

fn invalid_ntv2(what: &str) -> Error {
    Error::bad_input(format!("is not a valid NTv2 file: {what}")).remedy("download the file again")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes numbers in one order of bytes.
    struct Pen {
        out: Vec<u8>,
        is_big: bool,
    }

    impl Pen {
        fn record(&mut self, key: &str, value: &[u8]) {
            self.out.extend(format!("{key:8}").as_bytes());
            self.out.extend(value);
            self.out.resize(self.out.len().next_multiple_of(RECORD), 0);
        }

        fn text(&mut self, key: &str, text: &str) {
            self.record(key, format!("{text:8}").as_bytes());
        }

        fn count(&mut self, key: &str, value: u32) {
            let bytes = if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() };
            self.record(key, &bytes);
        }

        fn number(&mut self, key: &str, value: f64) {
            let bytes = if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() };
            self.record(key, &bytes);
        }

        fn float(&mut self, value: f32) {
            self.out.extend(if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() });
        }

        /// A grid whose shifts are a plane: 0.5 seconds to the north by row, 0.25 to the west by column.
        fn grid(&mut self, name: &str, [south, north, east, west]: [f64; 4], step: f64, up: f32) {
            for (key, text) in
                [("SUB_NAME", name), ("PARENT", "NONE"), ("CREATED", ""), ("UPDATED", "")]
            {
                self.text(key, text);
            }
            let keys = ["S_LAT", "N_LAT", "E_LONG", "W_LONG", "LAT_INC", "LONG_INC"];
            for (key, value) in keys.into_iter().zip([south, north, east, west, step, step]) {
                self.number(key, value * 3600.0);
            }
            let [rows, columns] = [(north - south) / step + 1.0, (west - east) / step + 1.0];
            self.count("GS_COUNT", (rows * columns) as u32);
            for r in 0..rows as u32 {
                for c in 0..columns as u32 {
                    for value in [up + 0.5 * r as f32, 3.0 + 0.25 * c as f32, 0.1, 0.1] {
                        self.float(value);
                    }
                }
            }
        }
    }

    /// A coarse grid and a finer one in it, from 8 to 11 degrees east and 50 to 52 north.
    fn file(is_big: bool) -> Vec<u8> {
        let mut pen = Pen { out: Vec::new(), is_big };
        for (key, count) in [("NUM_OREC", 11), ("NUM_SREC", 11), ("NUM_FILE", 2)] {
            pen.count(key, count);
        }
        for (key, text) in [
            ("GS_TYPE", "SECONDS"),
            ("VERSION", "NTv2.0"),
            ("SYSTEM_F", "DHDN90"),
            ("SYSTEM_T", "ETRS89"),
        ] {
            pen.text(key, text);
        }
        for (key, axis) in [
            ("MAJOR_F", 6_377_397.155),
            ("MINOR_F", 6_356_078.963),
            ("MAJOR_T", 6_378_137.0),
            ("MINOR_T", 6_356_752.314),
        ] {
            pen.number(key, axis);
        }
        pen.grid("COARSE", [50.0, 52.0, -11.0, -8.0], 1.0, -4.0);
        pen.grid("FINE", [50.0, 51.0, -10.0, -9.0], 0.5, -5.0);
        pen.text("END", "");
        pen.out
    }

    fn place(longitude: f64, latitude: f64) -> [f64; 2] {
        [longitude.to_radians(), latitude.to_radians()]
    }

    #[test]
    fn shifts_are_bilinear_by_the_finest_grid_in_either_order_of_bytes() {
        for is_big in [false, true] {
            let grid = ShiftGrid::of_ntv2(&file(is_big)).unwrap();
            for (at, [up, west]) in [
                // On the border of both, where the finer one counts.
                ([9.0, 51.0], [-4.0, 3.5]),
                ([10.5, 51.5], [-3.25, 3.125]),
                ([8.0, 52.0], [-3.0, 3.75]),
                // In the finer one.
                ([9.75, 50.25], [-4.75, 3.125]),
            ] {
                let moved = grid
                    .apply(place(at[0], at[1]), false)
                    .unwrap()
                    .map(|a| a.to_degrees() * 3600.0);
                let wanted = [at[0] * 3600.0 - west, at[1] * 3600.0 + up];
                assert!(
                    (moved[0] - wanted[0]).abs() < 1e-6 && (moved[1] - wanted[1]).abs() < 1e-6,
                    "{at:?} {moved:?} {wanted:?}"
                );
            }
        }
    }

    #[test]
    fn a_shift_is_undone_and_places_beyond_are_refused() {
        let grid = ShiftGrid::of_ntv2(&file(false)).unwrap();
        for at in [place(9.3, 50.4), place(10.6, 51.7), place(8.2, 50.1)] {
            let there = grid.apply(at, false).unwrap();
            let back = grid.apply(there, true).unwrap();
            assert!((back[0] - at[0]).abs() < 1e-12 && (back[1] - at[1]).abs() < 1e-12);
        }
        let told = grid.apply(place(7.0, 51.0), false).unwrap_err().to_string();
        assert!(told.contains("does not cover longitude 7.0000, latitude 51.0000"), "{told}");
    }

    #[test]
    fn the_ellipsoids_tell_which_way_it_goes() {
        let grid = ShiftGrid::of_ntv2(&file(false)).unwrap();
        let datum = |name: &str, code, axis| Datum {
            name: name.to_owned(),
            code: Some(code),
            axis,
            flattening: 299.0,
        };
        let dhdn = datum("DHDN", 6314, 6_377_397.155);
        let etrs = datum("ETRS89", 6258, 6_378_137.0);
        assert!(!grid.is_back([&dhdn, &etrs]).unwrap() && grid.is_back([&etrs, &dhdn]).unwrap());
        let told = grid.is_back([&etrs, &etrs]).unwrap_err().to_string();
        assert!(told.contains("from DHDN90 to ETRS89"), "{told}");
        let names = |from: &str, to: &str| ShiftGrid {
            names: [from.to_owned(), to.to_owned()],
            axes: [6_378_137.0; 2],
            grids: Vec::new(),
        };
        let [old, new] = [datum("GDA94", 6283, 6_378_137.0), datum("GDA2020", 1168, 6_378_137.0)];
        let australian = names("GDA94", "GDA2020");
        assert!(
            !australian.is_back([&old, &new]).unwrap() && australian.is_back([&new, &old]).unwrap()
        );
        assert!(names("X", "Y").is_back([&old, &new]).is_err());
    }

    #[test]
    fn damage_is_an_error_and_no_panic() {
        let sound = file(true);
        let whole = ShiftGrid::of_ntv2(&sound).unwrap();
        for length in 0..sound.len() - RECORD {
            assert!(ShiftGrid::of_ntv2(&sound[..length]).is_err(), "{length}");
        }
        for at in 0..3 * HEADER * RECORD {
            for value in [0, 0x7F, 0x80, 0xFF] {
                let mut bytes = sound.clone();
                bytes[at] = value;
                if let Ok(grid) = ShiftGrid::of_ntv2(&bytes) {
                    let _ = grid.apply(place(9.3, 50.4), true);
                }
            }
        }
        assert_eq!(whole.grids.len(), 2);
    }
}
