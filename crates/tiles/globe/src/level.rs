//! Properties of all tiles of a level: error bound, lattice of heights, and sampling of the ground.

use crate::globe::EQUATOR;
use crate::tiling;

/// Smallest number of samples along a side of a new tile, if available.
const FINENESS: f64 = 256.0;
/// Smallest number of height steps in the error of a level.
const STEPS_OF_ERROR: f64 = 32.0;
/// Kernel units per height step.
const UNITS: f64 = 64.0;
/// Share of a level's error for flat triangles on the curved earth, where no data constrain it.
const SAG: f64 = 0.25;
/// Share of a level's error for borders, because errors beside them add up.
const OF_BORDERS: f64 = 0.75;
/// Share of a level's error for the rounding of positions.
const OF_ROUNDING: f64 = 0.01;
/// Integers in single precision, minus the rounding of a tile and its centre.
const SINGLE: f64 = ((1_u32 << 24) - 4) as f64;
/// Smallest number of position steps in the error of a level.
const STEPS_OF_POSITION: f64 = 32.0;
/// Largest number of height steps up or down, so that single precision holds the range of each tile.
const MAX_STEPS: f64 = 8_000_000.0;
/// Slope in metres per metre above which the ground is steep.
const STEEP: f64 = 16.0;
/// Height steps of a tile, minus those of skirts.
const STEPS_OF_TILE: f64 = 32_000.0;

/// Requirements of the ground on a level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelRelief {
    /// Largest magnitude of a height in metres.
    pub reach: f64,
    /// Largest range of vertex heights of a tile in metres.
    pub range: f64,
    /// Error in metres below which tiles would have too many vertices.
    pub rough: f64,
    /// Error of sample positions in metres.
    pub doubt: f64,
    /// Largest height difference of neighbouring samples in metres.
    pub jump: f64,
}

/// A level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileLevel {
    /// Its number.
    pub level: u8,
    /// Geometric error in metres, as assumed by clients.
    pub assumed: f64,
    /// Error bound of samples in metres: the geometric error, or more where rough ground would need too many
    /// vertices, or where the height range needs larger steps.
    pub tolerance: f64,
    /// Height step in metres, a power of two. All heights of the level are multiples of it.
    pub step: f64,
    /// Stride of columns and rows for the first vertices of a tile.
    pub stride: u32,
    /// Subdivision of a tile's sides, to follow the curvature of the earth.
    pub posts: u32,
    /// Distance in degrees for slopes.
    pub slope: f64,
    /// Step in metres of earth-centred vertex coordinates, a power of two, for clients that decode them.
    /// of two.
    pub lattice: Option<f64>,
    /// Depth of skirts in height steps, if any.
    pub skirt: i32,
    /// Error of sample positions in metres: it adds to the vertical error on steep triangles.
    pub doubt: f64,
    /// The ground is so steep that adjacent positions may both be vertices.
    pub is_steep: bool,
}

impl TileLevel {
    /// Level `level` for a sample spacing in degrees.
    pub fn new(level: u8, spacing: f64, relief: &LevelRelief) -> Self {
        let assumed = tiling::level_error(level);
        let step = power_below(assumed / STEPS_OF_ERROR)
            .max(power_above(relief.range / STEPS_OF_TILE))
            .max(power_above(relief.reach / MAX_STEPS));
        let across = tiling::degrees(level) / spacing;
        let stride = power_below(across / FINENESS).max(1.0) as u32;
        // A chord of length L is L^2 / 8 R below an arc.
        let chord = (8.0 * EQUATOR * SAG * assumed).sqrt();
        let arc = tiling::degrees(level).to_radians() * EQUATOR;
        let posts = power_above(arc / chord).max(1.0) as u32;
        let slope = spacing * f64::from(stride);
        let tolerance = assumed.max(relief.rough).max(2.0 * step);
        // Neighbouring samples become vertices if they differ by a large share of the error, or if rounding of
        // positions changes heights by more than that.
        let samples = tiling::degrees(level) / f64::from(tiling::STEPS) / spacing;
        let is_high = relief.jump * (4.0 * samples).max(1.0) > assumed / 4.0;
        let is_steep = is_high && relief.jump > STEEP * spacing.to_radians() * EQUATOR;
        let (lattice, skirt, doubt) = (None, 0, relief.doubt);
        Self {
            level,
            assumed,
            tolerance,
            step,
            stride,
            posts,
            slope,
            lattice,
            skirt,
            doubt,
            is_steep,
        }
    }

    /// Largest difference in metres of a border from that of the next coarser level, without its own error.
    pub fn apart(&self) -> f64 {
        self.assumed.max(self.step)
    }

    /// The same level with skirts as deep as the largest difference from borders of the next coarser level.
    #[must_use]
    pub fn with_skirts(self, coarser: Option<&Self>) -> Self {
        let apart = self.apart() + coarser.map_or(0.0, Self::apart);
        Self { skirt: (apart / self.step).ceil() as i32, ..self }
    }

    /// Depth of skirts in metres.
    pub fn skirt_depth(&self) -> f64 {
        f64::from(self.skirt) * self.step
    }

    /// The same level for clients that decode earth-centred coordinates, for heights in a range: on the finest
    /// lattice that is exact in single precision relative to the centre of a tile. Identical vertices of two
    /// tiles then decode to identical points.
    ///
    /// A coarse lattice also makes height steps and tolerance coarse.
    #[must_use]
    pub fn on_lattice(self, range: [f64; 2]) -> Self {
        let [low, high] = [range[0] - self.skirt_depth(), range[1]];
        let earth = EQUATOR + high.max(0.0);
        // A tile fits in a square as wide as at the equator, and in the earth.
        let arc = tiling::degrees(self.level).to_radians() * earth;
        let across = (arc * 2_f64.sqrt()).min(2.0 * earth) + (high - low) + 2.0 * self.step;
        let lattice = power_above(across / 2.0 / SINGLE);
        let step = self.step.max(2.0 * lattice);
        let tolerance = self.tolerance.max(STEPS_OF_POSITION * lattice);
        let skirt = (self.skirt_depth() / step).ceil() as i32;
        Self { lattice: Some(lattice), step, tolerance, skirt, ..self }
    }

    /// Kernel unit in metres.
    pub(crate) fn unit(&self) -> f64 {
        self.step / UNITS
    }

    /// Tolerance of the kernel in metres, so that the rounded result is within the tolerance.
    pub(crate) fn goal(&self) -> f64 {
        self.off(self.tolerance)
    }

    /// The same along borders, at most the geometric error, so that they meet those of other levels.
    pub(crate) fn border_goal(&self) -> f64 {
        (self.off(self.assumed) * OF_BORDERS).max(0.0)
    }

    fn off(&self, tolerance: f64) -> f64 {
        tolerance * (1.0 - OF_ROUNDING) - self.step / 2.0
    }

    /// A height in steps.
    pub(crate) fn steps(&self, height: f64) -> i32 {
        nearest(height / self.step)
    }
}

/// Deepest level with more detail than a coarser one: tiles have at most 64 samples, this many degrees apart,
/// along a side.
pub fn deepest_for(spacing: f64) -> u8 {
    let fine = 64.0 * spacing * (1.0 + 1e-9);
    let deepest = (0..tiling::DEEPEST).find(|level| tiling::degrees(*level) <= fine);
    deepest.unwrap_or(tiling::DEEPEST)
}

/// Nearest integer, inlined on all processors.
pub(crate) fn nearest(value: f64) -> i32 {
    /// Makes all values positive that are in reach.
    const UP: f64 = (1_u64 << 31) as f64;
    ((value + UP + 0.5) as i64 - (1 << 31)) as i32
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

    fn relief(reach: f64) -> LevelRelief {
        LevelRelief { reach, range: 4000.0, ..LevelRelief::default() }
    }

    #[test]
    fn levels_of_a_second_of_arc() {
        let second = 1.0 / 3600.0;
        assert_eq!(deepest_for(second), 14);
        let level = |level| TileLevel::new(level, second, &relief(4000.0));
        assert_eq!((level(14).stride, level(14).posts, level(14).step), (1, 1, 0.125));
        assert_eq!((level(9).stride, level(9).slope), (4, 4.0 * second));
        assert_eq!((level(0).posts, level(0).stride), (32, 2048));
        assert!((0..=14).all(|number| level(number).tolerance == level(number).assumed));
    }

    /// However high and rough: steps reach across each tile, and the error is no less than steps allow.
    #[test]
    fn every_ground_has_levels() {
        for number in 0..=tiling::DEEPEST {
            for reach in [0.0, 1.0, 500.0, 9000.0, 1e6] {
                for range in [0.0, 0.3, 1.0, 2.0].map(|share| share * reach) {
                    for rough in [0.0, range] {
                        let level = TileLevel::new(
                            number,
                            1e-6,
                            &LevelRelief { reach, range, rough, ..LevelRelief::default() },
                        );
                        let apart = level.with_skirts(None).on_lattice([-reach, reach]);
                        for level in [level, apart] {
                            let TileLevel { step, tolerance, assumed, .. } = level;
                            assert!(step.log2().fract() == 0.0 && range / step < 32_700.0);
                            assert!(reach / step < 8.1e6 && tolerance >= assumed.max(rough));
                            assert!(level.goal() >= 0.49 * tolerance, "{level:?}");
                            assert!((0.0..assumed).contains(&level.border_goal()), "{level:?}");
                            assert!(level.lattice.is_none_or(|lattice| 2.0 * lattice <= step));
                            assert!(step <= (assumed / 32.0).max(tolerance / 2.0));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn rounding_takes_a_small_part_of_the_error() {
        for level in 0..=tiling::DEEPEST {
            let level = TileLevel::new(level, 1e-6, &LevelRelief { range: 50.0, ..relief(9000.0) });
            assert!(level.goal() > 0.97 * level.tolerance && level.border_goal() < level.goal());
        }
    }

    #[test]
    fn skirts_reach_across_the_errors_of_two_levels() {
        let mut coarser: Option<TileLevel> = None;
        for number in 0..=tiling::DEEPEST {
            let level = TileLevel::new(number, 1e-6, &relief(9000.0)).with_skirts(coarser.as_ref());
            let least = level.apart() + coarser.map_or(0.0, |coarser| coarser.apart());
            let depth = level.skirt_depth();
            assert!((least..least + level.step).contains(&depth), "{level:?}");
            coarser = Some(level);
        }
    }

    #[test]
    fn lattices_of_positions_are_fine_and_reach_across_a_tile() {
        for level in 0..=tiling::DEEPEST {
            let level = TileLevel::new(level, 1e-6, &relief(9000.0)).on_lattice([-400.0, 9000.0]);
            let lattice = level.lattice.unwrap();
            assert!(lattice <= level.tolerance / 32.0 && lattice.log2().fract() == 0.0);
            let half =
                (tiling::degrees(level.level).to_radians() * EQUATOR * 0.7).min(EQUATOR) + 4700.0;
            assert!(half / lattice < 16_777_216.0, "{level:?}");
        }
    }
}
