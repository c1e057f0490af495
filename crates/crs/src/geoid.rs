//! Geoid heights above the ellipsoid on a grid of longitudes and latitudes, from GTX files or arrays.

use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Maximum bytes of a shift grid or geoid, which is held in memory.
pub const MAX_GRID_BYTES: u64 = 512 << 20;

/// Nodata value of GTX.
const NO_VALUE: f32 = -88.8888;

/// Maximum geoid height in metres; larger values are damage.
const HIGHEST: f32 = 1000.0;

const HEADER: usize = 40;

/// A geoid.
#[derive(Clone, Debug, PartialEq)]
pub struct Geoid {
    /// Longitude and latitude of the south-western corner, in degrees.
    corner: [f64; 2],
    /// Degrees between columns and rows.
    step: [f64; 2],
    columns: usize,
    rows: usize,
    /// Heights in metres, row by row from the south.
    heights: Vec<f32>,
}

impl Geoid {
    /// From the bytes of a GTX file.
    ///
    /// # Errors
    /// Invalid or damaged files.
    pub fn of_gtx(bytes: &[u8]) -> Result<Self> {
        limits::check("size of the geoid in bytes", bytes.len() as u64, MAX_GRID_BYTES)?;
        let [south, west, up, across] = [0, 8, 16, 24].map(|at| number(bytes, at));
        let (Some(south), Some(west), Some(up), Some(across)) = (south, west, up, across) else {
            return Err(invalid_gtx("the header is truncated or not numeric"));
        };
        let (Some(rows), Some(columns)) = (count(bytes, 32), count(bytes, 36)) else {
            return Err(invalid_gtx("the number of rows or columns is invalid"));
        };
        let values = &bytes[HEADER.min(bytes.len())..];
        let expected = u64::from(rows) * u64::from(columns) * 4;
        if values.len() as u64 != expected {
            let found = values.len();
            return Err(invalid_gtx(&format!(
                "expected {expected} bytes of heights, found {found}"
            )));
        }
        let (values, _) = values.as_chunks::<4>();
        let heights = values.iter().map(|bytes| f32::from_be_bytes(*bytes)).collect();
        Self::new([west, south], [across, up], [columns, rows], heights)
    }

    /// From heights in metres, row by row from the south, each row from the west; NaN is nodata. `corner` is the
    /// position of the first height, `step` the distance of columns and rows, in degrees.
    ///
    /// # Errors
    /// Fewer than two columns or rows, an extent beyond the globe, or another number of heights.
    pub fn new(
        corner: [f64; 2],
        step: [f64; 2],
        [columns, rows]: [u32; 2],
        heights: Vec<f32>,
    ) -> Result<Self> {
        if columns < 2 || rows < 2 || heights.len() as u64 != u64::from(columns) * u64::from(rows) {
            return Err(
                Error::bad_input("the grid has too few heights").remedy("download the file again")
            );
        }
        let ([west, south], [across, up]) = (corner, step);
        let extent = [across * f64::from(columns - 1), up * f64::from(rows - 1)];
        let is_sound = up > 0.0
            && across > 0.0
            && (-90.001..=90.0).contains(&south)
            && south + extent[1] <= 90.001
            && (-360.0..=360.0).contains(&west)
            && extent[0] <= 360.001;
        if !is_sound {
            return Err(
                Error::bad_input("the extent exceeds the globe").remedy("download the file again")
            );
        }
        Ok(Self { corner, step, columns: columns as usize, rows: rows as usize, heights })
    }

    /// Geoid height above the ellipsoid in metres at a longitude and latitude in degrees, by bilinear interpolation.
    ///
    /// # Errors
    /// No value at this place.
    pub fn height(&self, [longitude, latitude]: [f64; 2]) -> Result<f64> {
        let east = (longitude - self.corner[0]).rem_euclid(360.0);
        // A position slightly west of the grid must not wrap to the east end.
        let east = if 360.0 - east < 1e-9 { 0.0 } else { east };
        let (column, across) = self.cell(east / self.step[0], self.columns, self.is_round());
        let (row, up) = self.cell((latitude - self.corner[1]) / self.step[1], self.rows, false);
        let (Some(column), Some(row)) = (column, row) else {
            return Err(no_value(longitude, latitude));
        };
        let (columns, rows) = ([1.0 - across, across], [1.0 - up, up]);
        let mut sum = 0.0;
        for (c, r) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = columns[c] * rows[r];
            // A neighbour without weight may be unknown, and 0 times NaN is NaN.
            if weight > 0.0 {
                let sample = self.sample(column + c, row + r);
                sum += weight * sample.ok_or_else(|| no_value(longitude, latitude))?;
            }
        }
        Ok(sum)
    }

    /// The height at a node; `None` for nodata.
    fn sample(&self, column: usize, row: usize) -> Option<f64> {
        // Where columns go all the way round, the first follows the last.
        let value = self.heights[row * self.columns + column % self.columns];
        let is_known = value.abs() <= HIGHEST && (value - NO_VALUE).abs() > 1e-3;
        is_known.then_some(f64::from(value))
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (self.heights.len() * size_of::<f32>()) as u64
    }

    /// True if the columns span all longitudes.
    fn is_round(&self) -> bool {
        (self.step[0] * self.columns as f64 - 360.0).abs() < self.step[0] * 1e-3
    }

    /// Cell of a coordinate in steps, and the fraction within it.
    fn cell(&self, at: f64, count: usize, is_round: bool) -> (Option<usize>, f64) {
        let last = if is_round { count as f64 } else { (count - 1) as f64 };
        let hair = 1e-9 * last;
        if !(-hair..=last + hair).contains(&at) {
            return (None, 0.0);
        }
        let at = at.clamp(0.0, last);
        let low = at.floor().min(last - 1.0);
        (Some(low as usize), at - low)
    }
}

/// A finite number of the header.
fn number(bytes: &[u8], at: usize) -> Option<f64> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    Some(f64::from_be_bytes(*bytes)).filter(|value| value.is_finite())
}

/// A number of rows or columns.
fn count(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_be_bytes(*bytes)).filter(|count| (2..1 << 20).contains(count))
}

fn invalid_gtx(what: &str) -> Error {
    Error::bad_input(format!("is not a valid GTX file: {what}")).remedy("download the file again")
}

fn no_value(longitude: f64, latitude: f64) -> Error {
    Error::bad_input(format!(
        "the geoid has no value at longitude {longitude:.4}, latitude {latitude:.4}"
    ))
    .remedy("use a geoid that covers the whole area")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane, which interpolation gives back.
    fn plane(corner: [f64; 2], step: f64, columns: u32, rows: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        for value in [corner[1], corner[0], step, step] {
            bytes.extend(value.to_be_bytes());
        }
        bytes.extend(rows.to_be_bytes());
        bytes.extend(columns.to_be_bytes());
        for r in 0..rows {
            for c in 0..columns {
                let height = 40.0 + 0.5 * c as f32 - 0.25 * r as f32;
                bytes.extend(height.to_be_bytes());
            }
        }
        bytes
    }

    #[test]
    fn heights_are_bilinear_between_samples_and_missing_outside() {
        let geoid = Geoid::of_gtx(&plane([5.0, 45.0], 0.25, 9, 5)).unwrap();
        for (place, height) in [
            ([5.0, 45.0], 40.0),
            ([7.0, 46.0], 43.0),
            ([5.125, 45.125], 40.125),
            ([365.125, 45.125], 40.125),
        ] {
            assert!((geoid.height(place).unwrap() - height).abs() < 1e-9, "{place:?}");
        }
        for place in [[4.9, 45.5], [7.1, 45.5], [6.0, 44.9], [6.0, 46.1]] {
            let told = geoid.height(place).unwrap_err().to_string();
            assert!(told.contains("geoid has no value at longitude"), "{told}");
        }
        let mut holed = geoid;
        holed.heights[0] = NO_VALUE;
        assert!(holed.height([5.1, 45.1]).is_err() && holed.height([5.25, 45.25]).is_ok());
    }

    #[test]
    fn a_geoid_of_the_globe_goes_round() {
        let geoid = Geoid::of_gtx(&plane([0.0, -90.0], 30.0, 12, 7)).unwrap();
        // Between 330 and 360 degrees, where the last column and the first are neighbours.
        assert!((geoid.height([345.0, -90.0]).unwrap() - (45.5 + 40.0) / 2.0).abs() < 1e-9);
        assert!((geoid.height([-15.0, -90.0]).unwrap() - (45.5 + 40.0) / 2.0).abs() < 1e-9);
        assert_eq!(geoid.height([-360.0, 90.0]).unwrap(), 40.0 - 1.5);
    }

    #[test]
    fn damage_is_an_error_and_no_panic() {
        let sound = plane([5.0, 45.0], 0.25, 9, 5);
        for length in 0..sound.len() {
            assert!(Geoid::of_gtx(&sound[..length]).is_err());
        }
        for at in 0..HEADER {
            for value in [0, 0x7F, 0x80, 0xFF] {
                let mut bytes = sound.clone();
                bytes[at] = value;
                if let Ok(geoid) = Geoid::of_gtx(&bytes) {
                    let _ = geoid.height([6.0, 45.5]);
                }
            }
        }
    }
}
