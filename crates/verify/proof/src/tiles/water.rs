//! Masks of water: pixels whose middle is clearly within a polygon have to be water, those clearly outside land.
//!
//! Each column of pixels lies on a meridian. Where sides of polygons cross it tells what is within, polygon by polygon
//! (even-odd); what is as near to a side as its place is known is not judged.

use super::tiling::ProofTileId;

/// Pixels along a side of a mask.
const SIDE: usize = 256;
/// Parts of a pixel that a middle may be near a side and is not judged.
pub const UNCLEAR: f64 = 1.0 / 16.0;
/// What a pixel of water is, and one of land.
const KINDS: [u8; 2] = [255, 0];
/// Most strips of sides, and how many of them a side is in on average, at most.
const STRIPS: [f64; 2] = [65_536.0, 4.0];

/// A side of a polygon, in longitudes and latitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaterBank {
    /// The western one first.
    ends: [[f64; 2]; 2],
    polygon: u32,
}

impl WaterBank {
    /// Bytes that one takes, with the strips it is in.
    pub const BYTES: u64 = (size_of::<Self>() + 2 * 6 * size_of::<u32>()) as u64;

    /// From one place to another, of a polygon by its number.
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

/// What was seen of the pixels of masks.
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

    /// Adds what was seen elsewhere.
    pub fn merge(&mut self, other: &Self) {
        self.judged += other.judged;
        self.unclear += other.unclear;
        self.wrong += other.wrong;
    }
}

impl WaterShore {
    /// Of all sides of all polygons, each of whose rings is closed.
    pub fn new(banks: Vec<WaterBank>) -> Self {
        let ends = banks.iter().flat_map(|bank| bank.ends.map(|end| end[0]));
        let [west, east] = ends
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        let across: f64 = banks.iter().map(|bank| bank.ends[1][0] - bank.ends[0][0]).sum();
        let fewest = across / (STRIPS[1] * banks.len().max(1) as f64);
        let width = ((east - west) / STRIPS[0]).max(fewest).max(f64::MIN_POSITIVE);
        let mut shore = Self { banks, west, width, strips: Vec::new() };
        let count = if shore.banks.is_empty() { 0 } else { shore.strip(east) + 1 };
        shore.strips.resize(count, Vec::new());
        for (number, bank) in (0..).zip(&shore.banks) {
            let [from, to] = bank.ends.map(|end| ((end[0] - west) / width) as usize);
            shore.strips[from..=to.min(count - 1)].iter_mut().for_each(|strip| strip.push(number));
        }
        shore
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        self.banks.len() as u64 * WaterBank::BYTES
            + self.strips.len() as u64 * size_of::<Vec<u32>>() as u64
    }

    fn strip(&self, x: f64) -> usize {
        // Rounds to nearest and saturates.
        ((x - self.west) / self.width) as usize
    }

    /// Looks at the mask of a tile: a byte for each pixel, row by row from the north, or one for all.
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
                    None if pixel.is_some_and(|pixel| KINDS.contains(pixel)) => pixels.unclear += 1,
                    None => pixels.judge(false),
                }
            }
        }
        pixels
    }

    /// The numbers of all sides that may meet meridians between two.
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

    /// What the pixels of a column have to be; `None` where that is not clear.
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
        let rows = |[south, to]: [f64; 2]| {
            // Of middles of pixels; what is beyond the column saturates.
            let row = |y: f64| ((north - y) / step + 0.5) as usize;
            row(to).min(SIDE)..row(south).min(SIDE)
        };
        let mut expected = [Some(KINDS[1]); SIDE];
        for pair in crossings.chunks_exact(2) {
            expected[rows([pair[0].1, pair[1].1])].fill(Some(KINDS[0]));
        }
        unclear.into_iter().for_each(|range| expected[rows(range)].fill(None));
        expected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TILE: ProofTileId = ProofTileId { level: 9, y: 387, x: 532 };

    fn banks(polygons: &[Vec<[f64; 2]>]) -> Vec<WaterBank> {
        let around = |(number, ring): (u32, &Vec<[f64; 2]>)| {
            let nexts: Vec<_> = ring.iter().skip(1).chain(ring.first()).copied().collect();
            let sides = ring.iter().copied().zip(nexts);
            sides.map(|(a, b)| WaterBank::new(a, b, number)).collect::<Vec<_>>()
        };
        (0..).zip(polygons).flat_map(around).collect()
    }

    /// Even-odd by the sides east of a place, each polygon by itself; and how near the nearest side is.
    fn is_in(polygons: &[Vec<[f64; 2]>], [x, y]: [f64; 2]) -> (bool, f64) {
        let (mut any, mut nearest) = (false, f64::INFINITY);
        for ring in polygons {
            let mut is_odd = false;
            for (a, b) in ring.iter().zip(ring.iter().skip(1).chain(ring.first())) {
                let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
                let part = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy).max(1e-300);
                let part = part.clamp(0.0, 1.0);
                nearest = nearest.min((a[0] + part * dx - x).hypot(a[1] + part * dy - y));
                let crosses = (a[1] > y) != (b[1] > y);
                is_odd ^= crosses && x < a[0] + (y - a[1]) / dy * dx;
            }
            any |= is_odd;
        }
        (any, nearest)
    }

    fn places() -> impl Strategy<Value = Vec<Vec<[f64; 2]>>> {
        let [west, south, east, north] = TILE.bounds();
        let by = east - west;
        let place = (-0.5..1.5, -0.5..1.5).prop_map(move |(u, v)| {
            // Some on the very meridians and parallels of middles of pixels.
            let on = |part: f64, from: f64| from + ((part * 512.0).round() / 512.0) * by;
            [on(u, west), if v > 1.0 { north } else { south + v * by }]
        });
        prop::collection::vec(prop::collection::vec(place, 3..9), 1..5)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn pixels_are_what_each_is_by_itself(polygons in places()) {
            let shore = WaterShore::new(banks(&polygons));
            let [west, _, east, north] = TILE.bounds();
            let step = (east - west) / SIDE as f64;
            let of = |i: usize| {
                let [col, row] = [i % SIDE, i / SIDE].map(|at| at as f64 + 0.5);
                is_in(&polygons, [west + col * step, north - row * step])
            };
            let mut mask: Vec<u8> = (0..SIDE * SIDE).map(|i| if of(i).0 { 255 } else { 0 }).collect();
            let seen = shore.check(TILE, &mask);
            prop_assert_eq!((seen.wrong, seen.judged + seen.unclear), (0, (SIDE * SIDE) as u64));
            let clear = (0..SIDE * SIDE).filter(|i| of(*i).1 > 2.0 * step * UNCLEAR).count();
            prop_assert!(seen.judged >= clear as u64 / 2);
            let at = (0..SIDE * SIDE).max_by(|a, b| of(*a).1.total_cmp(&of(*b).1)).unwrap();
            mask[at] = 255 - mask[at];
            prop_assert_eq!(shore.check(TILE, &mask).wrong, 1);
            mask[at] = 7;
            prop_assert_eq!(shore.check(TILE, &mask).wrong, 1);
        }
    }

    #[test]
    fn one_byte_stands_for_all_and_no_shore_is_land() {
        let shore = WaterShore::new(Vec::new());
        assert_eq!((shore.check(TILE, &[0]).wrong, shore.check(TILE, &[255]).wrong), (0, 65_536));
        let around = vec![[-10.0, -80.0], [170.0, -80.0], [170.0, 80.0], [-10.0, 80.0]];
        let shore = WaterShore::new(banks(&[around]));
        let seen = shore.check(TILE, &[255]);
        assert_eq!((seen.wrong, seen.unclear, seen.judged), (0, 0, 65_536));
    }
}
