//! Water masks: a pixel must be water if its centre is clearly inside a polygon, and land if it is clearly outside.
//!
//! Each column of pixels is on a meridian; its crossings with the sides of polygons decide, polygon by polygon (even-odd).
//! Centres within the accuracy of a side are not judged.

use std::ops::Range;

use super::tiling::ProofTileId;

/// Pixels along a side of a mask.
const SIDE: usize = 256;
/// Distance between the centre of a pixel and a side, in pixels, up to which the pixel is not judged.
pub const UNCLEAR: f64 = 1.0 / 16.0;
const WATER: u8 = 255;
const LAND: u8 = 0;
/// Limit of the number of strips.
const MAX_STRIPS: f64 = 65_536.0;
/// Limit of the average number of strips of a side.
const STRIPS_OF_SIDE: f64 = 4.0;

/// A side of a polygon, in longitudes and latitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaterBank {
    /// Western end first.
    ends: [[f64; 2]; 2],
    polygon: u32,
}

impl WaterBank {
    /// Size in bytes, with its entries in strips.
    pub const BYTES: u64 = (size_of::<Self>() + 2 * 6 * size_of::<u32>()) as u64;

    /// A side between two positions, of a polygon by its number.
    pub fn new(a: [f64; 2], b: [f64; 2], polygon: u32) -> Self {
        Self { ends: if a[0] <= b[0] { [a, b] } else { [b, a] }, polygon }
    }

    /// The latitude at a longitude between its ends.
    fn at(&self, x: f64) -> f64 {
        let [[x0, y0], [x1, y1]] = self.ends;
        if x1 > x0 { y0 + (x - x0) / (x1 - x0) * (y1 - y0) } else { y0 }
    }
}

/// All sides, by strips from west to east.
#[derive(Clone, Debug)]
pub struct WaterShore {
    banks: Vec<WaterBank>,
    west: f64,
    width: f64,
    strips: Vec<Vec<u32>>,
}

/// Counts of pixels of water masks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct MaskPixels {
    pub judged: u64,
    pub unclear: u64,
    pub wrong: u64,
}

impl MaskPixels {
    fn judge(&mut self, is_right: bool) {
        self.judged += 1;
        self.wrong += u64::from(!is_right);
    }

    /// Adds other counts.
    pub fn merge(&mut self, other: &Self) {
        self.judged += other.judged;
        self.unclear += other.unclear;
        self.wrong += other.wrong;
    }
}

impl WaterShore {
    /// Indexes all sides of all polygons. Rings must be closed.
    pub fn new(banks: Vec<WaterBank>) -> Self {
        let ends = banks.iter().flat_map(|bank| bank.ends.map(|end| end[0]));
        let [west, east] = ends
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        let across: f64 = banks.iter().map(|bank| bank.ends[1][0] - bank.ends[0][0]).sum();
        let min_width = across / (STRIPS_OF_SIDE * banks.len().max(1) as f64);
        let width = ((east - west) / MAX_STRIPS).max(min_width).max(f64::MIN_POSITIVE);
        let mut shore = Self { banks, west, width, strips: Vec::new() };
        let count = if shore.banks.is_empty() { 0 } else { shore.strip(east) + 1 };
        shore.strips.resize(count, Vec::new());
        for (number, bank) in (0..).zip(&shore.banks) {
            let [from, to] = bank.ends.map(|end| ((end[0] - west) / width) as usize);
            shore.strips[from..=to.min(count - 1)].iter_mut().for_each(|strip| strip.push(number));
        }
        shore
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.banks.len() as u64 * WaterBank::BYTES
            + self.strips.len() as u64 * size_of::<Vec<u32>>() as u64
    }

    fn strip(&self, x: f64) -> usize {
        // Saturates beyond both ends.
        ((x - self.west) / self.width) as usize
    }

    /// Checks the mask of a tile: a byte for each pixel, row by row from the north, or one byte for all.
    pub fn check(&self, id: ProofTileId, mask: &[u8]) -> MaskPixels {
        let [west, _, east, north] = id.bounds();
        let step = (east - west) / SIDE as f64;
        let (mut pixels, mut near) = (MaskPixels::default(), Vec::new());
        for col in 0..SIDE {
            let x = west + (col as f64 + 0.5) * step;
            self.near([x - step * UNCLEAR, x + step * UNCLEAR], &mut near);
            for (row, expected) in self.column(x, step, north, &near).into_iter().enumerate() {
                let pixel = mask.get(row * SIDE + col).or(mask.first());
                match expected {
                    Some(kind) => pixels.judge(pixel == Some(&kind)),
                    None if matches!(pixel, Some(&(WATER | LAND))) => pixels.unclear += 1,
                    None => pixels.judge(false),
                }
            }
        }
        pixels
    }

    /// Collects the numbers of all sides that may meet meridians of a range.
    fn near(&self, [from, to]: [f64; 2], near: &mut Vec<u32>) {
        near.clear();
        let last = self.strips.len();
        if last > 0 && to >= self.west {
            let strips = self.strip(from).min(last)..(self.strip(to) + 1).min(last);
            near.extend(self.strips[strips].iter().flatten());
        }
        near.sort_unstable();
        near.dedup();
    }

    /// Expected pixels of a column; `None` for pixels that are not judged.
    fn column(&self, x: f64, step: f64, north: f64, near: &[u32]) -> [Option<u8>; SIDE] {
        let off = step * UNCLEAR;
        let (mut crossings, mut unclear) = (Vec::new(), Vec::new());
        for bank in near.iter().map(|number| &self.banks[*number as usize]) {
            let [[x0, y0], [x1, y1]] = bank.ends;
            if x0 <= x && x < x1 {
                crossings.push((bank.polygon, bank.at(x)));
            }
            let [from, to] = [x0.max(x - off), x1.min(x + off)];
            if from <= to {
                let [a, b] = if x0 == x1 { [y0, y1] } else { [bank.at(from), bank.at(to)] };
                unclear.push([a.min(b) - off, a.max(b) + off]);
            }
        }
        crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut expected = [Some(LAND); SIDE];
        for pair in crossings.chunks_exact(2) {
            expected[rows([pair[0].1, pair[1].1], north, step)].fill(Some(WATER));
        }
        unclear.into_iter().for_each(|range| expected[rows(range, north, step)].fill(None));
        expected
    }
}

/// Rows of a column whose centres are in a range of latitudes.
fn rows(latitudes: [f64; 2], north: f64, step: f64) -> Range<usize> {
    // Saturates beyond both ends of the column.
    let [end, start] = latitudes.map(|y| (((north - y) / step + 0.5) as usize).min(SIDE));
    start..end
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TILE: ProofTileId = ProofTileId { level: 9, y: 387, x: 532 };

    fn banks(polygons: &[Vec<[f64; 2]>]) -> Vec<WaterBank> {
        let mut banks = Vec::new();
        for (number, ring) in (0..).zip(polygons) {
            let sides = ring.iter().zip(ring.iter().skip(1).chain(ring.first()));
            banks.extend(sides.map(|(a, b)| WaterBank::new(*a, *b, number)));
        }
        banks
    }

    /// Whether a position is in a polygon, by the sides east of it (even-odd), and the distance of the nearest side.
    fn is_in(polygons: &[Vec<[f64; 2]>], [x, y]: [f64; 2]) -> (bool, f64) {
        let (mut any, mut nearest) = (false, f64::INFINITY);
        for ring in polygons {
            let mut is_odd = false;
            for (a, b) in ring.iter().zip(ring.iter().skip(1).chain(ring.first())) {
                let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
                let share = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy).max(1e-300);
                let share = share.clamp(0.0, 1.0);
                nearest = nearest.min((a[0] + share * dx - x).hypot(a[1] + share * dy - y));
                let crosses = (a[1] > y) != (b[1] > y);
                is_odd ^= crosses && x < a[0] + (y - a[1]) / dy * dx;
            }
            any |= is_odd;
        }
        (any, nearest)
    }

    fn places() -> impl Strategy<Value = Vec<Vec<[f64; 2]>>> {
        let [west, south, east, north] = TILE.bounds();
        let width = east - west;
        let place = (-0.5..1.5_f64, -0.5..1.5).prop_map(move |(u, v)| {
            // Some longitudes are exactly those of centres of pixels.
            let u = (u * 512.0).round() / 512.0;
            [west + u * width, if v > 1.0 { north } else { south + v * width }]
        });
        prop::collection::vec(prop::collection::vec(place, 3..9), 1..5)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn pixels_agree_with_a_test_of_each(polygons in places()) {
            let shore = WaterShore::new(banks(&polygons));
            let [west, _, east, north] = TILE.bounds();
            let step = (east - west) / SIDE as f64;
            let expected: Vec<(bool, f64)> = (0..SIDE * SIDE).map(|i| {
                let [col, row] = [i % SIDE, i / SIDE].map(|at| at as f64 + 0.5);
                is_in(&polygons, [west + col * step, north - row * step])
            }).collect();
            let mut mask: Vec<u8> = expected.iter().map(|at| if at.0 { 255 } else { 0 }).collect();
            let pixels = shore.check(TILE, &mask);
            prop_assert_eq!((pixels.wrong, pixels.judged + pixels.unclear), (0, (SIDE * SIDE) as u64));
            let clear = expected.iter().filter(|at| at.1 > 2.0 * step * UNCLEAR).count();
            prop_assert!(pixels.judged >= clear as u64 / 2);
            let distances = expected.iter().map(|at| at.1).enumerate();
            let (at, _) = distances.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            mask[at] = 255 - mask[at];
            prop_assert_eq!(shore.check(TILE, &mask).wrong, 1);
            mask[at] = 7;
            prop_assert_eq!(shore.check(TILE, &mask).wrong, 1);
        }
    }

    #[test]
    fn single_bytes_stand_for_all_pixels_and_no_shore_is_land() {
        let shore = WaterShore::new(Vec::new());
        assert_eq!((shore.check(TILE, &[0]).wrong, shore.check(TILE, &[255]).wrong), (0, 65_536));
        let around = vec![[-10.0, -80.0], [170.0, -80.0], [170.0, 80.0], [-10.0, 80.0]];
        let shore = WaterShore::new(banks(&[around]));
        let pixels = shore.check(TILE, &[255]);
        assert_eq!((pixels.wrong, pixels.unclear, pixels.judged), (0, 0, 65_536));
    }
}
