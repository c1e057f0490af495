//! From heights and strokes to the rows of a picture.

use crate::render::light::slope;
use crate::render::{HeightColors, PictureHeights, PixelColors, ReliefLight, StrokeCoverage};

/// Lighting and scale of a picture.
#[derive(Clone, Copy, Debug)]
pub struct PictureStyle {
    /// The light.
    pub light: ReliefLight,
    /// Heights are multiplied by this before slopes are lit.
    pub exaggeration: f64,
    /// Size of a field pixel on the ground, in the unit of heights.
    pub ground: [f64; 2],
    /// Field pixels per picture pixel, along each side.
    pub fineness: usize,
}

/// Factors on colours in full shadow, on level ground and in full light: cool to warm, as relief painters do.
const SHADOW: [f32; 3] = [0.36, 0.39, 0.52];
const LEVEL: [f32; 3] = [0.96, 0.96, 0.95];
const BRIGHT: [f32; 3] = [1.17, 1.13, 1.04];
/// Colour of triangle edges.
const INK: [f32; 3] = [0.10, 0.13, 0.20];
/// How much ridges are lifted out of, and valleys pushed into, the picture.
const RIDGE: f32 = 0.16;
/// Number of parts per picture side for distinguishing ridges from slopes.
const NEIGHBOURHOODS: usize = 48;
/// How far from the border ridges count fully, in neighbourhoods.
const BORDER: f64 = 2.0;

/// Paints a field, row by row; rows are independent of each other.
pub struct FieldPainter<'a> {
    field: &'a PictureHeights,
    edges: Option<&'a StrokeCoverage>,
    colours: Option<&'a PixelColors>,
    tint: HeightColors,
    style: PictureStyle,
    /// Smoothed heights, to detect relief.
    ground: PictureHeights,
    stride: usize,
    /// Heights that stand out by this much are lit fully.
    prominence: f32,
}

impl<'a> FieldPainter<'a> {
    /// Prepares to paint `field`, whose sides are multiples of `style.fineness`, with `edges` (in
    /// picture pixels) on top.
    pub fn new(
        field: &'a PictureHeights,
        edges: Option<&'a StrokeCoverage>,
        style: PictureStyle,
    ) -> Self {
        let stride = (field.width.max(field.height) / NEIGHBOURHOODS).max(1);
        let ground = smooth(&field.coarser(stride));
        let tint = HeightColors::of(field);
        let mut painter = Self {
            field,
            edges,
            colours: None,
            tint,
            style,
            ground,
            stride,
            prominence: f32::INFINITY,
        };
        painter.prominence = painter.usual_prominence();
        painter
    }

    /// Paints these colours of the field's pixels in place of a tint by height: unchanged on level ground, shaded on slopes.
    #[must_use]
    pub fn coloured(self, colours: Option<&'a PixelColors>) -> Self {
        Self { colours, ..self }
    }

    /// Picture columns.
    pub fn width(&self) -> usize {
        self.field.width / self.style.fineness
    }

    /// Picture rows.
    pub fn height(&self) -> usize {
        self.field.height / self.style.fineness
    }

    /// Paints picture row `row` into `out`: `4 * width` bytes, RGBA in sRGB, not premultiplied;
    /// transparent where void.
    pub fn row(&self, row: usize, out: &mut [u8]) {
        for (col, pixel) in out.chunks_exact_mut(4).enumerate() {
            let (colour, alpha) = self.pixel(col, row);
            for (byte, channel) in pixel.iter_mut().zip([colour[0], colour[1], colour[2], alpha]) {
                *byte = (channel.clamp(0.0, 1.0) * 255.0).round() as u8;
            }
        }
    }

    /// Colour and opacity of a picture pixel: the mean of its field pixels, inked by the edges.
    fn pixel(&self, col: usize, row: usize) -> ([f32; 3], f32) {
        let n = self.style.fineness;
        let (mut sum, mut valid) = ([0.0f32; 3], 0.0f32);
        for (dy, dx) in (0..n).flat_map(|dy| (0..n).map(move |dx| (dy, dx))) {
            if let Some((colour, share)) = self.colour(col * n + dx, row * n + dy) {
                (0..3).for_each(|i| sum[i] += colour[i] * share);
                valid += share;
            }
        }
        let paint = sum.map(|channel| if valid > 0.0 { channel / valid } else { channel });
        let opacity = valid / (n * n) as f32;
        let ink = self.edges.map_or(0.0, |edges| edges.at(col, row));
        let alpha = ink + opacity * (1.0 - ink);
        let colour = std::array::from_fn(|i| {
            (INK[i] * ink + paint[i] * opacity * (1.0 - ink)) / alpha.max(1e-6)
        });
        (colour, alpha)
    }

    /// Tint and light of one field pixel, and its opacity; `None` where void.
    fn colour(&self, col: usize, row: usize) -> Option<([f32; 3], f32)> {
        let z = self.field.at(col, row);
        if z.is_nan() {
            return None;
        }
        let rise = slope(self.field, col, row);
        let [east, north] = [0, 1].map(|axis| {
            (f64::from(rise[axis]) * self.style.exaggeration / self.style.ground[axis]) as f32
        });
        let lit = self.style.light.on(east, north);
        if let Some(colours) = self.colours {
            let (rgba, level) = (colours.at(col, row), self.style.light.on(0.0, 0.0));
            let rgba = rgba.map(|channel| f32::from(channel) / 255.0);
            let shaded = std::array::from_fn(|i| rgba[i] * lighten(i, lit) / lighten(i, level));
            return Some((shaded, rgba[3]));
        }
        let ridge = RIDGE * (self.above_ground(z, col, row) / self.prominence).clamp(-1.0, 1.0);
        let tint = self.tint.colour(z);
        Some((std::array::from_fn(|i| tint[i] * (1.0 + ridge) * lighten(i, lit)), 1.0))
    }

    /// Height above the smoothed ground, fading out towards the border, where the smoothing is one-sided.
    fn above_ground(&self, z: f32, col: usize, row: usize) -> f32 {
        let ground = self.ground.bilinear(self.blocks(col) - 0.5, self.blocks(row) - 0.5);
        let across = self.blocks(col).min(self.blocks(self.field.width - 1 - col));
        let down = self.blocks(row).min(self.blocks(self.field.height - 1 - row));
        let border = across.min(down);
        let weight = (border / BORDER).min(1.0) as f32;
        if ground.is_nan() { 0.0 } else { (z - ground) * weight }
    }

    /// The centre of a pixel from the border of the field, in blocks of the smoothed ground.
    fn blocks(&self, pixel: usize) -> f64 {
        (pixel as f64 + 0.5) / self.stride as f64
    }

    /// Twice the mean height above or below the smoothed ground; infinite when all is level.
    fn usual_prominence(&self) -> f32 {
        let step = self.field.z.len().div_ceil(1 << 16).max(1);
        let (mut sum, mut count) = (0.0f64, 0u64);
        for i in (0..self.field.z.len()).step_by(step) {
            let z = self.field.z[i];
            if !z.is_nan() {
                let (col, row) = (i % self.field.width, i / self.field.width);
                sum += f64::from(self.above_ground(z, col, row).abs());
                count += 1;
            }
        }
        let mean = sum / count.max(1) as f64;
        if mean > 0.0 { 2.0 * mean as f32 } else { f32::INFINITY }
    }
}

/// Factor on channel `i` for light `lit` (0 shadow, 0.5 level, 1 bright).
fn lighten(i: usize, lit: f32) -> f32 {
    let (from, to, mix) =
        if lit < 0.5 { (SHADOW, LEVEL, lit * 2.0) } else { (LEVEL, BRIGHT, lit * 2.0 - 1.0) };
    from[i] + (to[i] - from[i]) * mix
}

/// Means over 3 x 3 neighbours.
fn smooth(field: &PictureHeights) -> PictureHeights {
    let mut out = PictureHeights::void(field.width, field.height);
    for (i, mean) in out.z.iter_mut().enumerate() {
        let (col, row) = (i % field.width, i / field.width);
        let around =
            (0..9).map(|k| field.at((col + k % 3).wrapping_sub(1), (row + k / 3).wrapping_sub(1)));
        let (sum, count) = around
            .filter(|z| !z.is_nan())
            .fold((0.0f32, 0u32), |(sum, count), z| (sum + z, count + 1));
        *mean = sum / count as f32;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style(fineness: usize) -> PictureStyle {
        let light = ReliefLight::new(315.0, 45.0);
        PictureStyle { light, exaggeration: 1.0, ground: [1.0, 1.0], fineness }
    }

    fn paint(field: &PictureHeights, edges: Option<&StrokeCoverage>, fineness: usize) -> Vec<u8> {
        let painter = FieldPainter::new(field, edges, style(fineness));
        let mut out = vec![0; painter.width() * painter.height() * 4];
        let bytes = painter.width() * 4;
        out.chunks_exact_mut(bytes).enumerate().for_each(|(row, line)| painter.row(row, line));
        out
    }

    #[test]
    fn voids_are_transparent_and_half_voids_half_so() {
        let nan = f32::NAN;
        let z = vec![nan, nan, 5.0, nan, nan, nan, 5.0, nan];
        let picture = paint(&PictureHeights { width: 4, height: 2, z }, None, 2);
        assert_eq!(picture[3], 0);
        assert_eq!(picture[7], 128);
    }

    #[test]
    fn edges_are_dark_on_top() {
        let field = PictureHeights { width: 4, height: 4, z: vec![5.0; 16] };
        let mut edges = StrokeCoverage::empty(4, 4);
        edges.stroke([0.0, 1.5], [4.0, 1.5], 1.0, 1.0);
        let picture = paint(&field, Some(&edges), 1);
        assert!(picture[4 * 4] < 40 && picture[0] > 120);
    }

    #[test]
    fn own_colours_are_as_they_are_where_it_is_level_and_lit_where_it_is_not() {
        let colours = {
            let mut colours = PixelColors::none(8, 8);
            (0..64).for_each(|i| colours.put(i % 8, i / 8, [200.0, 100.0, 3.0, 255.0]));
            colours.put(0, 0, [200.0, 100.0, 3.0, 127.5]);
            colours
        };
        let painted = |slope: f32| {
            let z = (0..64).map(|i| slope * (i % 8 + i / 8) as f32).collect();
            let field = PictureHeights { width: 8, height: 8, z };
            let painter = FieldPainter::new(&field, None, style(1)).coloured(Some(&colours));
            let mut out = vec![0; 8 * 4];
            painter.row(0, &mut out);
            out
        };
        let level = painted(0.0);
        assert_eq!(level[..4], [200, 100, 3, 128], "half transparent");
        assert_eq!(level[4..8], [200, 100, 3, 255]);
        assert!(painted(1.0)[4] > 200 && painted(-1.0)[4] < 200);
    }

    #[test]
    fn slopes_to_the_light_are_brighter() {
        let hill = |sign: f32| {
            let z = (0..64).map(|i| 100.0 + sign * (i % 8 + i / 8) as f32).collect();
            paint(&PictureHeights { width: 8, height: 8, z }, None, 1)[4 * 36]
        };
        assert!(hill(1.0) > hill(-1.0));
    }
}
