//! What all tiles of a level have in common: the error that is allowed, the lattice of heights, and how finely
//! the ground is looked at.

use crate::globe::EQUATOR;
use crate::surface::nearest;
use crate::tiling;
use terrane_base::error::{Error, Result};

/// Samples that a tile has along a side when it is first made, at least, where there are as many.
const FINENESS: f64 = 256.0;
/// Steps of heights in the error of a level, at least.
const STEPS_OF_ERROR: f64 = 32.0;
/// Units that the kernel counts in, in a step of heights.
const UNITS: f64 = 64.0;
/// Part of a level's error that a triangle may be off by because it is flat and the earth is not, where nothing
/// is known that could tell.
const SAG: f64 = 0.25;
/// Part of a level's error that borders of tiles may take, as what is beside them adds to it.
const OF_BORDERS: f64 = 0.75;
/// Part of a level's error that goes into rounding positions to steps.
const OF_ROUNDING: f64 = 0.01;
/// Whole numbers that single precision holds, less what rounding and the rounded centre of a tile take.
const SINGLE: f64 = ((1_u32 << 24) - 4) as f64;
/// Steps of positions in the error of a level, at least.
const STEPS_OF_POSITION: f64 = 32.0;
/// Steps of heights up or down, so that single precision holds the lowest and the highest of each tile.
const MOST_STEPS: f64 = 8_000_000.0;

/// A level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Its number.
    pub level: u8,
    /// Metres that no sample may be further from the surface; what clients assume.
    pub tolerance: f64,
    /// Metres of a step of heights: a power of two. All heights of the level are whole numbers of it.
    pub step: f64,
    /// Every how manieth sample, of columns and of rows, a tile is first made of.
    pub stride: u32,
    /// Parts that the sides of each tile are divided into, so that triangles follow the bend of the earth.
    pub posts: u32,
    /// Degrees across which slopes are told.
    pub slope: f64,
    /// Metres that all earth-centred coordinates of vertices are whole numbers of, where clients decode such: a power
    /// of two.
    pub lattice: Option<f64>,
    /// Steps of heights that skirts hang down, where tiles have such.
    pub skirt: i32,
}

impl Level {
    /// Level `level` of a ground whose samples are so many degrees apart, and whose heights reach so many metres
    /// up or down.
    ///
    /// # Errors
    /// A level too deep for heights that large.
    pub fn new(level: u8, spacing: f64, reach: f64) -> Result<Self> {
        let tolerance = tiling::level_error(level);
        let step = power_below(tolerance / STEPS_OF_ERROR);
        if reach / step > MOST_STEPS {
            let what = format!("heights of {reach:e} m are more than can be told apart");
            return Err(Error::usage(format!("{what} at level {level}")).remedy(shallower(level)));
        }
        let across = tiling::degrees(level) / spacing;
        let stride = power_below(across / FINENESS).max(1.0) as u32;
        // A chord of length L is L^2 / 8 R below an arc.
        let chord = (8.0 * EQUATOR * SAG * tolerance).sqrt();
        let arc = tiling::degrees(level).to_radians() * EQUATOR;
        let posts = power_above(arc / chord).max(1.0) as u32;
        let slope = spacing * f64::from(stride);
        Ok(Self { level, tolerance, step, stride, posts, slope, lattice: None, skirt: 0 })
    }

    /// The same level with skirts as deep as its error and that of the next coarser level together, which borders of
    /// the two differ by at the most.
    #[must_use]
    pub fn with_skirts(self) -> Self {
        let coarser = self.level.checked_sub(1).map_or(0.0, tiling::level_error);
        Self { skirt: ((self.tolerance + coarser) / self.step).ceil() as i32, ..self }
    }

    /// Metres that skirts hang down.
    pub fn skirt_depth(&self) -> f64 {
        f64::from(self.skirt) * self.step
    }

    /// The same level for clients that decode earth-centred coordinates, of heights in a range: on the finest lattice
    /// on which those of a tile, counted from its middle, are exact in single precision. Vertices of two tiles that
    /// are at one place are then decoded to one point, bit by bit.
    ///
    /// # Errors
    /// A level too deep for heights that far apart.
    pub fn on_lattice(self, range: [f64; 2]) -> Result<Self> {
        let [low, high] = [range[0] - self.skirt_depth(), range[1]];
        let earth = EQUATOR + high.max(0.0);
        // A tile lies within a square as wide as it is at the equator, and within the earth.
        let arc = tiling::degrees(self.level).to_radians() * earth;
        let across = (arc * 2_f64.sqrt()).min(2.0 * earth) + (high - low) + 2.0 * self.step;
        let lattice = power_above(across / 2.0 / SINGLE);
        if lattice > self.tolerance / STEPS_OF_POSITION {
            let message = format!(
                "heights from {low} to {high} m are too far apart for level {}",
                self.level
            );
            return Err(Error::usage(message).remedy("pass a smaller --max-level"));
        }
        Ok(Self { lattice: Some(lattice), ..self })
    }

    /// Metres that the kernel counts in.
    pub(crate) fn unit(&self) -> f64 {
        self.step / UNITS
    }

    /// Metres that the kernel may be off by, so that what it makes is within the tolerance once it is rounded.
    pub(crate) fn goal(&self) -> f64 {
        self.tolerance * (1.0 - OF_ROUNDING) - self.step / 2.0
    }

    /// The same along borders.
    pub(crate) fn border_goal(&self) -> f64 {
        self.goal() * OF_BORDERS
    }

    /// A height in steps.
    pub(crate) fn steps(&self, height: f64) -> i32 {
        nearest(height / self.step)
    }
}

/// The deepest level that shows more than a coarser one would: where a tile has no more than 64 samples, so many
/// degrees apart, along a side.
pub fn deepest_for(spacing: f64) -> u8 {
    let is_fine = |level: &u8| tiling::degrees(*level) <= 64.0 * spacing * (1.0 + 1e-9);
    (0..tiling::DEEPEST).find(is_fine).unwrap_or(tiling::DEEPEST)
}

/// What may help where a level is too deep for the heights.
pub(crate) fn shallower(level: u8) -> String {
    match level.checked_sub(1) {
        Some(before) => format!("pass --max-level {before}"),
        None => "check the nodata value and the unit of the heights".to_owned(),
    }
}

fn power_below(value: f64) -> f64 {
    value.log2().floor().exp2()
}

fn power_above(value: f64) -> f64 {
    if value > 0.0 { value.log2().ceil().exp2() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_a_second_of_arc() {
        let second = 1.0 / 3600.0;
        assert_eq!(deepest_for(second), 14);
        let level = |level| Level::new(level, second, 4000.0).unwrap();
        assert_eq!((level(14).stride, level(14).posts, level(14).step), (1, 1, 0.125));
        assert_eq!((level(9).stride, level(9).slope), (4, 4.0 * second));
        assert_eq!((level(0).posts, level(0).stride), (32, 2048));
    }

    #[test]
    fn rounding_takes_a_small_part_of_the_error() {
        for level in 0..=tiling::DEEPEST {
            let level = Level::new(level, 1e-6, 9000.0).unwrap();
            assert!(level.goal() > 0.97 * level.tolerance && level.border_goal() < level.goal());
        }
        let told = |level: u8, reach: f64| Level::new(level, 1e-6, reach).unwrap_err().to_string();
        assert!(told(tiling::DEEPEST, 20_000.0).contains("pass --max-level 19"));
        assert!(told(0, 1e30).contains("1e30 m") && told(0, 1e30).contains("nodata"));
    }

    #[test]
    fn skirts_reach_across_the_errors_of_two_levels() {
        for number in 0..=tiling::DEEPEST {
            let level = Level::new(number, 1e-6, 9000.0).unwrap().with_skirts();
            let coarser = if number == 0 { 0.0 } else { tiling::level_error(number - 1) };
            let [least, depth] = [level.tolerance + coarser, level.skirt_depth()];
            assert!((least..least + level.step).contains(&depth), "{level:?}");
        }
    }

    #[test]
    fn lattices_of_positions_are_fine_and_reach_across_a_tile() {
        for level in 0..=tiling::DEEPEST {
            let level =
                Level::new(level, 1e-6, 9000.0).unwrap().on_lattice([-400.0, 9000.0]).unwrap();
            let lattice = level.lattice.unwrap();
            assert!(lattice <= level.tolerance / 32.0 && lattice.log2().fract() == 0.0);
            let half =
                (tiling::degrees(level.level).to_radians() * EQUATOR * 0.7).min(EQUATOR) + 4700.0;
            assert!(half / lattice < 16_777_216.0, "{level:?}");
        }
        let deepest = Level::new(tiling::DEEPEST, 1e-6, 9000.0).unwrap();
        assert!(deepest.on_lattice([-80_000.0, 9000.0]).is_err());
    }
}
