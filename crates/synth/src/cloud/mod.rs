//! Airborne-like point clouds from a seed: flight lines over a landscape whose ground is known. Pure.
//!
//! A survey is flown in parallel lines with overlapping swaths, scan line by scan line, over a smooth
//! ground with forest, buildings and water. Its points come in parts, in the order of flight; a part
//! is a pure function of the survey's parameters and its index, so any part can be made on its own.
//! Only additions, multiplications, divisions and square roots are used, which IEEE 754 defines to the
//! last bit, so the points are the same on every machine.
//!
//! Ground truth: [`LidarSurvey::ground`] is the height of the ground at any position. A return of class
//! [`GROUND`] that is not withheld lies on it at its own recorded x and y, except for range noise (a bell curve that
//! ends at 3.5 standard deviations) and half a step of z.

mod building;
mod flight;
mod landscape;
mod name;
mod pulse;
mod random;
mod spline;
mod survey;

pub use name::PARAMETERS;
pub use pulse::{BUILDING, GROUND, HIGH_NOISE, LOW_NOISE, SimulatedReturn};
pub use survey::LidarSurvey;

use flight::Flight;
use landscape::LandscapeWindow;

impl LidarSurvey {
    /// Number of parts.
    pub fn parts(&self) -> usize {
        Flight::new(self).parts()
    }

    /// Maximum number of points of a part.
    pub fn most(&self, part: usize) -> u64 {
        Flight::new(self).leg(part).pulses() * u64::from(pulse::MAX_RETURNS)
    }

    /// Extent of a part: x min, y min, x max, y max.
    ///
    /// # Panics
    /// If the part does not exist.
    pub fn area(&self, part: usize) -> [f64; 4] {
        let [west, south, east, north] = Flight::new(self).leg(part).area();
        [west - pulse::LEAN, south, east + pulse::LEAN, north]
    }

    /// Replaces `echoes` with the points of a part, in the order of flight.
    ///
    /// # Panics
    /// If the part does not exist.
    pub fn fill(&self, part: usize, echoes: &mut Vec<SimulatedReturn>) {
        echoes.clear();
        let flight = Flight::new(self);
        let leg = flight.leg(part);
        let land = LandscapeWindow::new(self, leg.area());
        leg.each_pulse(|shot| pulse::echoes(self, &land, &shot, echoes));
    }

    /// Height of the ground in metres at a position of the survey: a uniform bicubic B-spline over the
    /// samples of a rough terrain a fixed number of metres apart, twice continuously differentiable.
    /// For many positions use [`ground_rows`](Self::ground_rows): this costs some microseconds.
    pub fn ground(&self, x: f64, y: f64) -> f64 {
        landscape::ground(self, [x, y, x, y]).at(x, y)
    }

    /// Heights of the ground at the crossings of `xs` and `ys`, row by row: the same numbers as from
    /// [`ground`](Self::ground). Memory is that of the samples under the rectangle they span.
    pub fn ground_rows(&self, xs: &[f64], ys: &[f64]) -> Vec<f64> {
        if xs.is_empty() || ys.is_empty() {
            return Vec::new();
        }
        let ([x0, x1], [y0, y1]) = (span(xs), span(ys));
        let ground = landscape::ground(self, [x0, y0, x1, y1]);
        ys.iter().flat_map(|y| xs.iter().map(|x| ground.at(*x, *y))).collect()
    }
}

/// The smallest and the largest of non-negative values.
fn span(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::MAX, 0.0], |[low, high], v| [low.min(*v), high.max(*v)])
}
