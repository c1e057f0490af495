//! Parameters of a survey, and numbers derived from them.

use crate::hash::mix64;
use crate::{CHARACTERS, Terrain};

/// Parameters of a survey; [`fill`](LidarSurvey::fill) makes its points. Lengths are in metres, from the
/// south-west corner.
#[derive(Clone, Debug, PartialEq)]
pub struct LidarSurvey {
    /// West to east.
    pub width: f64,
    /// South to north.
    pub height: f64,
    /// Approximate points per square metre, including all returns and overlaps.
    pub density: f64,
    /// Random seed.
    pub seed: u64,
    /// Standard deviation of the range noise.
    pub noise: f64,
    /// A step of the coordinates, on each axis.
    pub scale: f64,
    /// Approximate height range.
    pub relief: f64,
    /// Number of round gaps of 15 to 60 m across, with centres on multiples of `tile`.
    pub voids: u32,
    /// Distance of the lines on which voids lie.
    pub tile: f64,
    /// Share of pulses that return noise or withheld points.
    pub outliers: f64,
    /// True for forest, buildings and water; false for bare ground.
    pub cover: bool,
    /// True for zigzag scan lines, false for parallel ones.
    pub zigzag: bool,
}

impl LidarSurvey {
    /// Width and height in whole steps: coordinates are from 0 to one less.
    pub fn steps(&self) -> [i32; 2] {
        [self.width, self.height].map(|side| (side / self.scale).ceil() as i32)
    }

    /// Lowest and highest z in steps that a point may have.
    pub fn heights(&self) -> [i32; 2] {
        let noise = 10.0 + 4.0 * self.noise;
        let (low, high) = (-3.0 * self.relief - 40.0 - noise, 4.5 * self.relief + 400.0 + noise);
        [low, high].map(|z| (z / self.scale) as i32)
    }

    /// Approximate number of points, including voids and water, with the mean number of returns.
    pub fn expected(&self) -> u64 {
        (self.width * self.height * self.density).ceil() as u64
    }

    /// The terrain under the ground.
    pub(super) fn terrain(&self) -> Terrain {
        let terrain = Terrain::new(&CHARACTERS[0]);
        Terrain { seed: self.seed, relief: self.relief, ..terrain }
    }

    /// The seed of one use of random numbers.
    pub(super) fn key(&self, name: u64) -> u64 {
        mix64(self.seed ^ mix64(name))
    }
}
