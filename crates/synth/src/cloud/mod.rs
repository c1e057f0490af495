//! Airborne-like point clouds from a seed: flight lines over a landscape whose ground is known. Pure.
//!
//! A survey is flown in parallel lines with overlapping swaths, scan line by scan line, over a smooth
//! ground with forest, buildings and water. Its points come in parts, in the order of flight; a part
//! is a pure function of the survey's parameters and its index, so any part can be made on its own.
//! Only additions, multiplications, divisions and square roots are used, which IEEE 754 defines to the
//! last bit, so the points are the same on every machine.
//!
//! The truth: [`Survey::ground`] is the ground at any place. A return of class [`GROUND`] that is not
//! withheld lies on it at its own recorded x and y, but for the noise of ranging (a bell curve that
//! ends at 3.5 times its deviation) and half a step of z.

mod building;
mod flight;
mod land;
mod name;
mod pulse;
mod spline;

pub use name::PARAMETERS;

use super::hash::mix64;
use super::{CHARACTERS, Terrain};
use flight::Flight;
use land::Land;
use terrane_base::geom::Point;

/// Class of the ground.
pub const GROUND: u8 = 2;
/// Class of roofs.
pub const BUILDING: u8 = 6;
/// Class of returns from below the ground.
pub const LOW_NOISE: u8 = 7;
/// Class of returns from the air.
pub const HIGH_NOISE: u8 = 18;

/// A survey: what [`fill`](Survey::fill) makes parts of. Lengths are metres; x and y count from the
/// south-west corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// West to east.
    pub width: f64,
    /// South to north.
    pub height: f64,
    /// Points by square metre, about, all returns and overlaps counted.
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

/// A return of a pulse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Echo {
    /// Steps of [`Survey::scale`] east and north of the south-west corner, and up from zero.
    pub point: Point,
    /// Seconds, growing along a line and from line to line.
    pub time: f64,
    /// Strength, by what was hit.
    pub intensity: u16,
    /// Number of the flight line, from 1.
    pub source: u16,
    /// Angle of the beam in steps of 0.006 degrees, positive to the east.
    pub angle: i16,
    /// Which return of the pulse, from 1, the highest first.
    pub number: u8,
    /// How many returns the pulse has.
    pub of: u8,
    /// Class, with the numbers of the ASPRS.
    pub class: u8,
    /// True for a point that is known to be wrong.
    pub withheld: bool,
    /// True beyond the middle of the overlap with the neighbouring line.
    pub overlap: bool,
    /// True when the scanner moved to the east.
    pub eastward: bool,
    /// True for the ends of a scan line.
    pub edge: bool,
}

impl Survey {
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

    /// How many parts there are.
    pub fn parts(&self) -> usize {
        Flight::new(self).parts()
    }

    /// Points of a part, at most.
    pub fn most(&self, part: usize) -> u64 {
        Flight::new(self).leg(part).pulses() * u64::from(pulse::MOST_RETURNS)
    }

    /// Where the points of a part lie: x min, y min, x max, y max.
    ///
    /// # Panics
    /// When there is no such part.
    pub fn area(&self, part: usize) -> [f64; 4] {
        let [west, south, east, north] = Flight::new(self).leg(part).area();
        [west - pulse::LEAN, south, east + pulse::LEAN, north]
    }

    /// Makes the points of a part, in the order of flight, in place of what `echoes` holds.
    ///
    /// # Panics
    /// When there is no such part.
    pub fn fill(&self, part: usize, echoes: &mut Vec<Echo>) {
        echoes.clear();
        let flight = Flight::new(self);
        let leg = flight.leg(part);
        let land = Land::new(self, leg.area());
        leg.each_pulse(|shot| pulse::echoes(self, &land, &shot, echoes));
    }

    /// Height of the ground in metres at a place of the survey: a uniform bicubic B-spline over the
    /// samples of a rough terrain a fixed number of metres apart, twice continuously differentiable.
    /// For many places use [`ground_rows`](Self::ground_rows): this costs some microseconds.
    pub fn ground(&self, x: f64, y: f64) -> f64 {
        land::ground(self, [x, y, x, y]).at(x, y)
    }

    /// Heights of the ground at the crossings of `xs` and `ys`, row by row: the same numbers as from
    /// [`ground`](Self::ground). Memory is that of the samples under the rectangle they span.
    pub fn ground_rows(&self, xs: &[f64], ys: &[f64]) -> Vec<f64> {
        let span = |all: &[f64]| {
            all.iter().fold([f64::MAX, 0.0], |[low, high]: [f64; 2], v| [low.min(*v), high.max(*v)])
        };
        if xs.is_empty() || ys.is_empty() {
            return Vec::new();
        }
        let ([x0, x1], [y0, y1]) = (span(xs), span(ys));
        let ground = land::ground(self, [x0, y0, x1, y1]);
        ys.iter().flat_map(|y| xs.iter().map(|x| ground.at(*x, *y))).collect()
    }

    /// Centres and radii of the voids, as [x, y, radius].
    pub fn void_places(&self) -> impl Iterator<Item = [f64; 3]> + use<'_> {
        (0..self.voids).map(|k| land::void(self, k))
    }

    /// The terrain under the ground.
    fn terrain(&self) -> Terrain {
        let terrain = Terrain::new(&CHARACTERS[0]);
        Terrain { seed: self.seed, relief: self.relief, ..terrain }
    }

    /// A seed for one use of chance.
    fn key(&self, name: u64) -> u64 {
        mix64(self.seed ^ mix64(name))
    }
}

/// A source of chance that is a pure function of its start.
#[derive(Clone, Copy)]
struct Dice(u64);

impl Dice {
    #[inline(always)]
    fn bits(&mut self) -> u64 {
        self.0 = mix64(self.0);
        self.0
    }

    /// Four numbers from 0 up to 1, of 16 bits each.
    #[inline(always)]
    fn four(&mut self) -> [f64; 4] {
        let bits = self.bits();
        [0, 16, 32, 48].map(|at| f64::from((bits >> at) as u16) * (1.0 / 65_536.0))
    }

    /// A byte out of the bits drawn last, which need not be drawn for it.
    #[inline(always)]
    fn byte(self) -> u8 {
        (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
    }

    /// A number of mean 0 and deviation 1: four even numbers added, so it ends at 3.5.
    #[inline(always)]
    fn bell(&mut self) -> f64 {
        let [a, b, c, d] = self.four();
        (a + b + c + d - 2.0) * 1.732_050_807_568_877_2
    }
}
