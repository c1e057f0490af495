//! A survey by its parameters, and the numbers that follow from them alone.

use crate::hash::mix64;
use crate::{CHARACTERS, Terrain};

/// A survey: what [`fill`](LidarSurvey::fill) makes parts of. Lengths are metres; x and y count from the
/// south-west corner.
#[derive(Clone, Debug, PartialEq)]
pub struct LidarSurvey {
    /// West to east.
    pub width: f64,
    /// South to north.
    pub height: f64,
    /// Approximate points per square metre, including all returns and overlaps.
    pub density: f64,
    /// Chooses one survey among all of its kind.
    pub seed: u64,
    /// Standard deviation of the ranging noise.
    pub noise: f64,
    /// A step of the coordinates, on each axis.
    pub scale: f64,
    /// From low plains to high peaks, about.
    pub relief: f64,
    /// Round places of 15 to 60 m across without any point, their centres on multiples of `tile`.
    pub voids: u32,
    /// Distance of the lines on which voids lie.
    pub tile: f64,
    /// Share of pulses that come back as noise or withheld points.
    pub outliers: f64,
    /// True for forest, buildings and water; false for bare ground.
    pub cover: bool,
    /// True for scan lines to and fro, false for parallel ones.
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

    /// Points of the whole survey, about: voids and water are not taken off, and returns are counted
    /// by their mean.
    pub fn expected(&self) -> u64 {
        (self.width * self.height * self.density).ceil() as u64
    }

    /// The terrain under the ground.
    pub(super) fn terrain(&self) -> Terrain {
        let terrain = Terrain::new(&CHARACTERS[0]);
        Terrain { seed: self.seed, relief: self.relief, ..terrain }
    }

    /// A seed for one use of chance.
    pub(super) fn key(&self, name: u64) -> u64 {
        mix64(self.seed ^ mix64(name))
    }
}
