//! Hillshade: how bright the ground is in the light.

use std::f64::consts::FRAC_PI_2;

use crate::relief::{Derivative, Gradient, Heights, Turn};

/// Where light comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HillshadeMode {
    /// From one direction: the cosine of the angle to the surface normal.
    #[default]
    One,
    /// From one direction, the angle scaled by the slope's, so that level ground is brightest.
    Combined,
    /// From south-west, west, north-west and north (Mark 1992), each weighted by how much the ground falls towards
    /// it or away from it.
    Four,
}

/// Brightness of the ground, as whole numbers from 1 (dark) to 255.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hillshade {
    /// Gradient algorithm.
    pub gradient: Gradient,
    /// Where light comes from.
    pub light: HillshadeMode,
    /// Degrees clockwise from north, of one light.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub altitude: f64,
    /// Vertical exaggeration factor.
    pub exaggeration: f64,
}

impl Default for Hillshade {
    /// One light from the north-west, 45 degrees above the horizon.
    fn default() -> Self {
        let (gradient, light) = (Gradient::Horn, HillshadeMode::One);
        Self { gradient, light, azimuth: 315.0, altitude: 45.0, exaggeration: 1.0 }
    }
}

impl Derivative for Hillshade {
    fn at(&self, heights: &Heights, turn: &Turn) -> f64 {
        self.bright(&self.lamps(), self.gradient.of(heights, turn))
    }

    fn is_byte(&self) -> bool {
        true
    }

    fn row(&self, rows: [&[f64]; 3], turn: &Turn, out: &mut [f64]) {
        let lamps = self.lamps();
        if self.light != HillshadeMode::One {
            return crate::relief::each(rows, out, f64::NAN, |heights| {
                self.bright(&lamps, self.gradient.of(heights, turn))
            });
        }
        // Roots and quotients of several samples at a time.
        for (run, out) in out.chunks_mut(RUN).enumerate() {
            let rows = rows.map(|row| &row[run * RUN..][..out.len() + 2]);
            let mut slopes = [[0.0; 2]; RUN];
            let slopes = &mut slopes[..out.len()];
            crate::relief::each(rows, slopes, [f64::NAN; 2], |heights| {
                self.gradient.of(heights, turn)
            });
            for (out, slope) in out.iter_mut().zip(&*slopes) {
                let tone = tone(lamps[0].lit(slope.map(|by| by * self.exaggeration)));
                *out = if slope[0].is_nan() { f64::NAN } else { tone };
            }
        }
    }
}

/// Samples of a row that are computed together.
const RUN: usize = 64;

/// The integer value of a brightness of at most 1. Halves are rounded up.
#[inline(always)]
fn tone(bright: f64) -> f64 {
    // Of numbers that are not negative, truncation is the floor, and no call on any processor.
    f64::from((1.0 + 254.0 * bright.max(0.0) + 0.5).min(255.0) as i32)
}

/// A light: the cosine and sine of its direction, and the sine and cosine of its height.
#[derive(Clone, Copy)]
struct LightDirection {
    east: f64,
    north: f64,
    up: f64,
    along: f64,
}

impl LightDirection {
    fn new(azimuth: f64, altitude: f64) -> Self {
        let (azimuth, altitude) = (azimuth.to_radians(), altitude.to_radians());
        let (east, north) = (azimuth.sin(), azimuth.cos());
        Self { east, north, up: altitude.sin(), along: altitude.cos() }
    }

    /// The cosine of the angle to the surface normal.
    #[inline(always)]
    fn lit(&self, [east, north]: [f64; 2]) -> f64 {
        let across = east * self.east + north * self.north;
        (self.up - self.along * across) / (1.0 + east * east + north * north).sqrt()
    }
}

impl Hillshade {
    /// Four lights: the first is the single one, the last is in the north.
    fn lamps(&self) -> [LightDirection; 4] {
        let azimuths = match self.light {
            HillshadeMode::Four => [225.0, 270.0, 315.0, 360.0],
            HillshadeMode::One | HillshadeMode::Combined => [self.azimuth; 4],
        };
        azimuths.map(|azimuth| LightDirection::new(azimuth, self.altitude))
    }

    #[inline(always)]
    fn bright(&self, lamps: &[LightDirection; 4], slope: [f64; 2]) -> f64 {
        let slope = slope.map(|by| by * self.exaggeration);
        let steep = slope[0] * slope[0] + slope[1] * slope[1];
        let bright = match self.light {
            HillshadeMode::One => lamps[0].lit(slope),
            HillshadeMode::Combined => {
                let angle = lamps[0].lit(slope).clamp(-1.0, 1.0).acos();
                1.0 - angle * steep.sqrt().atan() / (FRAC_PI_2 * FRAC_PI_2)
            }
            // Level ground is lit alike by all.
            HillshadeMode::Four if steep == 0.0 => lamps[0].lit(slope),
            HillshadeMode::Four => {
                // How much the ground falls towards a light or away from it: the square of the cosine between its
                // direction and the aspect.
                let [east, north] = slope;
                let south_west = 0.5 * steep + east * north;
                let weights = [south_west, east * east, steep - south_west, north * north];
                let lit = weights
                    .into_iter()
                    .zip(lamps)
                    .map(|(weight, lamp)| weight * lamp.lit(slope).max(0.0));
                lit.sum::<f64>() / steep / 2.0
            }
        };
        tone(bright)
    }
}
