//! Hillshade: how bright the ground is in the light.

use std::f64::consts::FRAC_PI_2;

use crate::{Derivative, Gradient, Heights, Turn};

/// Where light comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Light {
    /// From one direction: the cosine of the angle between it and what is upright on the ground.
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
    /// How the change of height is told.
    pub gradient: Gradient,
    /// Where light comes from.
    pub light: Light,
    /// Degrees clockwise from north, of one light.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub altitude: f64,
    /// Factor on heights.
    pub exaggeration: f64,
}

impl Default for Hillshade {
    /// One light from the north-west, 45 degrees above the horizon.
    fn default() -> Self {
        let (gradient, light) = (Gradient::Horn, Light::One);
        Self { gradient, light, azimuth: 315.0, altitude: 45.0, exaggeration: 1.0 }
    }
}

impl Derivative for Hillshade {
    fn at(&self, heights: &Heights, turn: &Turn) -> f64 {
        let slope = self.gradient.of(heights, turn).map(|by| by * self.exaggeration);
        let steep = slope[0] * slope[0] + slope[1] * slope[1];
        let bright = match self.light {
            Light::One => self.lit(self.azimuth, slope),
            Light::Combined => {
                let angle = self.lit(self.azimuth, slope).clamp(-1.0, 1.0).acos();
                1.0 - angle * steep.sqrt().atan() / (FRAC_PI_2 * FRAC_PI_2)
            }
            Light::Four if steep == 0.0 => self.lit(0.0, slope),
            Light::Four => {
                // How much the ground falls towards a light or away from it: the square of the cosine between its
                // direction and the aspect.
                let [east, north] = slope;
                let south_west = 0.5 * steep + east * north;
                let weights = [
                    (225.0, south_west),
                    (270.0, east * east),
                    (315.0, steep - south_west),
                    (360.0, north * north),
                ];
                let of = |(azimuth, weight): (f64, f64)| weight * self.lit(azimuth, slope).max(0.0);
                weights.map(of).iter().sum::<f64>() / steep / 2.0
            }
        };
        // Halves go up.
        (1.0 + 254.0 * bright.max(0.0) + 0.5).floor().min(255.0)
    }

    fn is_byte(&self) -> bool {
        true
    }
}

impl Hillshade {
    /// The cosine between light from a direction and what is upright.
    #[inline]
    fn lit(&self, azimuth: f64, [east, north]: [f64; 2]) -> f64 {
        let (azimuth, altitude) = (azimuth.to_radians(), self.altitude.to_radians());
        let across = east * azimuth.sin() + north * azimuth.cos();
        (altitude.sin() - altitude.cos() * across) / (1.0 + east * east + north * north).sqrt()
    }
}
