//! Buildings: at most one on each lot, turned, with a flat or gabled roof.

use super::random::PulseRandom;
use super::spline::Spline;

/// Side of a lot in metres.
const LOT: f64 = 48.0;
/// Directions of buildings: rational, so that rounding leaves them unit vectors.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [0.8, 0.6], [0.6, 0.8], [12.0 / 13.0, 5.0 / 13.0]];
/// Maximum height difference of the ground under a building in metres.
const STEEPEST: f64 = 4.0;

/// A building.
pub(super) struct Building {
    centre: [f64; 2],
    along: [f64; 2],
    /// Half of its length and of its width.
    half: [f64; 2],
    /// Height of the eaves.
    eaves: f64,
    /// Height of the ridge above the eaves; 0 for a flat roof.
    ridge: f64,
}

impl Building {
    /// Height of the roof at a position, if the building covers it.
    #[inline(always)]
    fn roof(&self, x: f64, y: f64) -> Option<f64> {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let u = (dx * self.along[0] + dy * self.along[1]).abs();
        let v = (dy * self.along[0] - dx * self.along[1]).abs();
        let inside = u <= self.half[0] && v <= self.half[1];
        inside.then(|| self.eaves + self.ridge * (1.0 - v / self.half[1]))
    }

    /// Height of the roof at a position of the building.
    pub(super) fn height(&self, x: f64, y: f64) -> f64 {
        self.roof(x, y).unwrap_or(self.eaves)
    }

    fn new(col: u64, row: u64, mut dice: PulseRandom, ground: &Spline) -> Option<Self> {
        let ([long, wide, right, up], [tall, steep, gable, turn]) = (dice.four(), dice.four());
        let centre = [(col, right), (row, up)]
            .map(|(lot, share)| (lot as f64 + 0.5) * LOT + 8.0 * (share - 0.5));
        let along = DIRECTIONS[(turn * 4.0) as usize];
        let half = [5.0 + 10.0 * long, 4.0 + 7.0 * wide];
        let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[s, t]| {
            let (u, v) = (s * half[0], t * half[1]);
            ground.at(
                centre[0] + u * along[0] - v * along[1],
                centre[1] + u * along[1] + v * along[0],
            )
        });
        let high = corners.iter().fold(f64::MIN, |a, b| a.max(*b));
        let low = corners.iter().fold(f64::MAX, |a, b| a.min(*b));
        let ridge = if gable < 0.6 { half[1] * (0.4 + 0.5 * steep) } else { 0.0 };
        let eaves = high + 2.8 + 9.0 * tall * tall;
        (high - low < STEEPEST).then_some(Self { centre, along, half, eaves, ridge })
    }
}

/// All buildings within a rectangle of lots.
pub(super) struct Town {
    first: [u64; 2],
    width: usize,
    lots: Vec<Option<Building>>,
}

impl Town {
    /// The buildings of `area`, which consists of whole lots, where `is_town` holds.
    pub(super) fn new(
        key: u64,
        [x0, y0, x1, y1]: [f64; 4],
        is_town: impl Fn(f64, f64) -> bool,
        ground: &Spline,
    ) -> Self {
        let [west, south, east, north] =
            [x0, y0, x1, y1].map(|place| (place * (1.0 / LOT)).round() as u64);
        let lots = (south..north).flat_map(|row| (west..east).map(move |col| (col, row)));
        let lots = lots.map(|(col, row)| {
            let (x, y) = ((col as f64 + 0.5) * LOT, (row as f64 + 0.5) * LOT);
            let dice = PulseRandom(key ^ (col << 32 | row));
            if is_town(x, y) { Building::new(col, row, dice, ground) } else { None }
        });
        Self { first: [west, south], width: (east - west) as usize, lots: lots.collect() }
    }

    /// The building at a position.
    #[inline(always)]
    pub(super) fn at(&self, x: f64, y: f64) -> Option<&Building> {
        let col = ((x * (1.0 / LOT)) as u64).checked_sub(self.first[0])? as usize;
        let row = ((y * (1.0 / LOT)) as u64).checked_sub(self.first[1])? as usize;
        let building = self.lots.get(row * self.width + col)?.as_ref()?;
        building.roof(x, y).is_some().then_some(building)
    }
}

/// The whole lots that a rectangle touches, as [x min, y min, x max, y max].
pub(super) fn whole_lots([x0, y0, x1, y1]: [f64; 4]) -> [f64; 4] {
    let [west, south] = [x0, y0].map(|place| (place * (1.0 / LOT)).floor() * LOT);
    let [east, north] = [x1, y1].map(|place| ((place * (1.0 / LOT)).floor() + 1.0) * LOT);
    [west, south, east, north]
}
