//! Direction of the light, and the shading of slopes.

use crate::render::PictureHeights;

/// A main light with two weaker ones on either side, so that no slope is black.
#[derive(Clone, Copy, Debug)]
pub struct ReliefLight {
    /// Unit vectors towards the lights (east, north, up) with their weights.
    sources: [([f32; 3], f32); 3],
    /// Shading of level ground.
    level: f32,
}

impl ReliefLight {
    /// Light from `azimuth` (degrees clockwise from north) and `altitude` (degrees above the
    /// horizon).
    pub fn new(azimuth: f64, altitude: f64) -> Self {
        let sources = [(0.0, 0.64), (-60.0, 0.18), (60.0, 0.18)]
            .map(|(turn, weight)| (towards(azimuth + turn, altitude), weight));
        Self { sources, level: altitude.to_radians().sin() as f32 }
    }

    /// Light received (0 to 1) by a slope rising `east` and `north` (height per ground unit), with
    /// 0.5 for level ground.
    #[inline]
    pub fn on(&self, east: f32, north: f32) -> f32 {
        let scale = 1.0 / (1.0 + east * east + north * north).sqrt();
        let normal = [-east, -north, 1.0];
        let of = |i: usize| self.sources[i].1 * dot(self.sources[i].0, normal).max(0.0);
        let over = (of(0) + of(1) + of(2)) * scale - self.level;
        let range = if over > 0.0 { 1.0 - self.level } else { self.level };
        (0.5 + 0.5 * over / range.max(1e-3)).clamp(0.0, 1.0)
    }
}

fn towards(azimuth: f64, altitude: f64) -> [f32; 3] {
    let (az, alt) = (azimuth.to_radians(), altitude.to_radians());
    [az.sin() * alt.cos(), az.cos() * alt.cos(), alt.sin()].map(|v| v as f32)
}

#[inline]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Slope at (`col`, `row`) as height per pixel towards the right and upwards, from the neighbours
/// that are there.
pub(super) fn slope(field: &PictureHeights, col: usize, row: usize) -> [f32; 2] {
    let here = field.at(col, row);
    let left = field.at(col.wrapping_sub(1), row);
    let above = field.at(col, row.wrapping_sub(1));
    let right = difference(left, here, field.at(col + 1, row));
    let up = -difference(above, here, field.at(col, row + 1));
    [right, up]
}

/// Central difference, or one-sided beside a void, or 0 between two.
#[inline]
pub(super) fn difference(before: f32, here: f32, after: f32) -> f32 {
    let is_central = !before.is_nan() & !after.is_nan();
    let before = if before.is_nan() { here } else { before };
    let after = if after.is_nan() { here } else { after };
    (after - before) * if is_central { 0.5 } else { 1.0 }
}

/// Steepness (rise over run) that the steeper slopes of a picture should have to read well.
const PLEASING_STEEPNESS: f32 = 0.65;
/// Quantile of the steeper slopes.
const STEEP_QUANTILE: f64 = 0.9;
/// Maximum number of sampled slopes.
const MAX_SLOPES: usize = 1 << 18;

/// The vertical exaggeration that gives a field with pixels of `ground` units a readable relief:
/// its steeper slopes come out near 33 degrees. 1 when all is flat.
pub fn natural_exaggeration(field: &PictureHeights, ground: [f64; 2]) -> f64 {
    let step = field.z.len().div_ceil(MAX_SLOPES).max(1);
    let mut steepness: Vec<f32> = (0..field.z.len())
        .step_by(step)
        .filter(|&i| !field.z[i].is_nan())
        .map(|i| slope(field, i % field.width, i / field.width))
        .map(|[e, n]| (e / ground[0] as f32).hypot(n / ground[1] as f32))
        .filter(|s| *s > 0.0 && s.is_finite())
        .collect();
    if steepness.is_empty() {
        return 1.0;
    }
    let steep = (steepness.len() as f64 * STEEP_QUANTILE) as usize;
    let (_, &mut steep, _) = steepness.select_nth_unstable_by(steep, f32::total_cmp);
    f64::from(PLEASING_STEEPNESS / steep)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_facing_the_light_are_brighter_than_level_ground() {
        let light = ReliefLight::new(315.0, 45.0);
        assert!((light.on(0.0, 0.0) - 0.5).abs() < 0.05);
        assert!(light.on(0.5, -0.5) > 0.6, "falls to the north-west");
        assert!(light.on(-0.5, 0.5) < 0.4, "falls to the south-east");
    }

    #[test]
    fn exaggeration_undoes_the_scale_of_heights() {
        let ramp = |k: f32| PictureHeights {
            width: 8,
            height: 2,
            z: (0..16).map(|i| k * (i % 8) as f32).collect(),
        };
        let one = natural_exaggeration(&ramp(1.0), [10.0, 10.0]);
        let ten = natural_exaggeration(&ramp(10.0), [10.0, 10.0]);
        assert!((one - 6.5).abs() < 1e-3 && (ten - 0.65).abs() < 1e-4);
        assert_eq!(natural_exaggeration(&ramp(0.0), [1.0, 1.0]), 1.0);
    }
}
