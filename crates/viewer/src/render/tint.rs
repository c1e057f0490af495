//! Hypsometric tint: colours by height, chosen so that the whole palette is used.

use crate::render::PictureHeights;

/// Colour stops of land, low to high, in sRGB.
const LAND: [[u8; 3]; 8] = [
    [118, 161, 128],
    [150, 184, 138],
    [193, 206, 150],
    [226, 217, 168],
    [217, 187, 138],
    [188, 147, 114],
    [176, 158, 148],
    [246, 244, 241],
];
/// Colour stops of ground at or below zero, deep to shallow.
const WATER: [[u8; 3]; 3] = [[74, 124, 160], [126, 172, 198], [184, 214, 226]];
/// Colour stops of land, low to high, and of water, deep to shallow: red, green and blue in sRGB.
pub fn palette() -> [&'static [[u8; 3]]; 2] {
    [&LAND, &WATER]
}

/// Number of height steps in the histogram of areas.
const BINS: usize = 2048;

/// Approximate number of heights in the histogram of a large field.
const SAMPLED_HEIGHTS: usize = 1 << 19;

/// Maps heights to colours.
#[derive(Clone, Debug)]
pub struct HeightColors {
    /// Lowest and highest height with land colours.
    low: f32,
    high: f32,
    /// Deepest water; `None` when nothing is water.
    deepest: Option<f32>,
    /// Colours of land at the ends of `BINS` equal steps of height.
    land: Vec<[f32; 3]>,
}

impl HeightColors {
    /// A tint for the heights of `field`: halfway between equal steps of height and equal areas of
    /// colour. Heights at or below zero are water where there is land too.
    pub fn of(field: &PictureHeights) -> Self {
        let (min, max) = field.range();
        let deepest = (min <= 0.0 && max > 0.0).then_some(min);
        let is_land = |z: f32| deepest.is_none() || z > 0.0;
        let (low, high) = if deepest.is_none() { (min, max) } else { range(field, is_land) };
        let positions = positions(field, low, high, is_land);
        let ends = std::iter::once(0.0).chain(positions);
        let land = ends.map(|position| pick(&LAND, position)).collect();
        Self { low, high, deepest, land }
    }

    /// Lowest and highest height on land.
    pub fn land_range(&self) -> (f32, f32) {
        (self.low, self.high)
    }

    /// The colour of a height (any where it is NaN), channels 0 to 1 in sRGB.
    #[inline]
    pub fn colour(&self, z: f32) -> [f32; 3] {
        match self.deepest {
            Some(deepest) if z <= 0.0 => pick(&WATER, 1.0 - self.depth(z, deepest)),
            _ => self.land_colour(z),
        }
    }

    /// Depth from 0 to 1; shallow seas use only the light end, compared with the land's heights.
    fn depth(&self, z: f32, deepest: f32) -> f32 {
        if deepest < 0.0 { z / deepest.min(-0.5 * self.high) } else { 0.0 }
    }

    #[inline]
    fn land_colour(&self, z: f32) -> [f32; 3] {
        let at = bin_position(z, self.low, self.high);
        let bin = (at as usize).min(BINS - 1);
        let (from, to, mix) = (self.land[bin], self.land[bin + 1], at - bin as f32);
        let channel = |i: usize| from[i] * (1.0 - mix) + to[i] * mix;
        [channel(0), channel(1), channel(2)]
    }
}

fn range(field: &PictureHeights, keep: impl Fn(f32) -> bool) -> (f32, f32) {
    let heights = field.z.iter().filter(|&&z| !z.is_nan() && keep(z));
    heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &z| (low.min(z), high.max(z)))
}

/// Position of a height on the scale of bins, 0 to `BINS`; the middle when all heights are equal.
#[inline]
fn bin_position(z: f32, low: f32, high: f32) -> f32 {
    let share = (z - low) / (high - low);
    if share.is_finite() { share.clamp(0.0, 1.0) * BINS as f32 } else { 0.5 * BINS as f32 }
}

fn positions(field: &PictureHeights, low: f32, high: f32, keep: impl Fn(f32) -> bool) -> Vec<f32> {
    let mut counts = vec![0u64; BINS];
    // An odd step does not keep to some columns of a picture of even width.
    let step = (field.z.len() / SAMPLED_HEIGHTS) | 1;
    for &z in field.z.iter().step_by(step).filter(|&&z| !z.is_nan() && keep(z)) {
        counts[(bin_position(z, low, high) as usize).min(BINS - 1)] += 1;
    }
    let all = counts.iter().sum::<u64>().max(1) as f32;
    let mut below = 0;
    let bins = counts.iter().zip(1..=BINS);
    bins.map(|(count, bin)| {
        below += count;
        0.5 * (below as f32 / all) + 0.5 * bin as f32 / BINS as f32
    })
    .collect()
}

/// The colour at `position` (0 to 1) between evenly spaced stops.
fn pick(stops: &[[u8; 3]], position: f32) -> [f32; 3] {
    let at = position.clamp(0.0, 1.0) * (stops.len() - 1) as f32;
    let stop = (at as usize).min(stops.len() - 2);
    let mix = at - stop as f32;
    std::array::from_fn(|i| {
        let (a, b) = (f32::from(stops[stop][i]), f32::from(stops[stop + 1][i]));
        (a + (b - a) * mix) / 255.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(z: &[f32]) -> PictureHeights {
        PictureHeights { width: z.len(), height: 1, z: z.to_vec() }
    }

    #[test]
    fn the_palette_runs_from_lowest_to_highest_land() {
        let tint = HeightColors::of(&field(&[100.0, 150.0, f32::NAN, 900.0]));
        assert_eq!(tint.land_range(), (100.0, 900.0));
        assert_eq!(tint.colour(900.0), LAND[7].map(|c| f32::from(c) / 255.0));
        assert!(tint.colour(100.0)[0] < tint.colour(150.0)[0]);
    }

    #[test]
    fn zero_is_water_only_beside_land() {
        let blue = |c: [f32; 3]| c[2] > c[1];
        assert!(blue(HeightColors::of(&field(&[0.0, 5.0])).colour(0.0)));
        assert!(!blue(HeightColors::of(&field(&[-9.0, -5.0])).colour(-9.0)));
        assert!(!blue(HeightColors::of(&field(&[3.0, 5.0])).colour(3.0)));
        let deep = HeightColors::of(&field(&[-100.0, -1.0, 50.0]));
        assert!(deep.colour(-100.0)[0] < deep.colour(-1.0)[0]);
    }

    #[test]
    fn level_and_empty_fields_have_a_colour() {
        for z in [&[7.0, 7.0][..], &[f32::NAN][..]] {
            assert!(
                HeightColors::of(&field(z)).colour(7.0).iter().all(|c| (0.0..=1.0).contains(c))
            );
        }
    }
}
