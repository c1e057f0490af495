//! From heights and strokes to the rows of a picture.

use crate::render::light::difference;
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
const BORDER: f32 = 2.0;

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
    /// Where each column of the field lies between the columns of the smoothed ground, and how much ridges count there.
    columns: Vec<GroundColumn>,
    /// Heights that stand out by this much are lit fully.
    prominence: f32,
}

/// A column of the field over the smoothed ground.
#[derive(Clone, Copy, Debug)]
struct GroundColumn {
    /// The column of the ground on its left, and the share of the one on its right.
    left: usize,
    share: f32,
    /// From the border, in blocks of the ground.
    border: f32,
}

/// A pixel of the field: colours multiplied by the opacity, and the opacity.
type FieldPixel = [f32; 4];

/// Buffers of a row of the field.
#[derive(Debug, Default)]
struct RowBuffers {
    /// The row above, the row itself and the row below, with a void at each end.
    heights: [Vec<f32>; 3],
    lit: Vec<f32>,
    /// Sums of heights of the ground, and of their weights.
    ground: Vec<[f32; 2]>,
    ridges: Vec<f32>,
    pixels: Vec<FieldPixel>,
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
            columns: Vec::new(),
            prominence: f32::INFINITY,
        };
        painter.columns = (0..field.width).map(|col| painter.column(col)).collect();
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
        let n = self.style.fineness;
        let mut sums = vec![[0.0; 4]; self.width()];
        let mut buffers = RowBuffers::default();
        for line in row * n..(row + 1) * n {
            self.field_row(line, &mut buffers);
            for (sum, pixels) in sums.iter_mut().zip(buffers.pixels.chunks_exact(n)) {
                pixels.iter().for_each(|pixel| (0..4).for_each(|i| sum[i] += pixel[i]));
            }
        }
        let share = 1.0 / (n * n) as f32;
        for (col, (bytes, sum)) in out.chunks_exact_mut(4).zip(&sums).enumerate() {
            let mean = [sum[0] * share, sum[1] * share, sum[2] * share, sum[3] * share];
            let pixel = self.inked(col, row, mean);
            for (byte, channel) in bytes.iter_mut().zip(pixel) {
                *byte = (channel * 255.0 + 0.5) as u8;
            }
        }
    }

    /// A picture pixel, given its premultiplied mean, below the edges; not premultiplied.
    fn inked(&self, col: usize, row: usize, paint: FieldPixel) -> FieldPixel {
        let ink = self.edges.map_or(0.0, |edges| edges.at(col, row));
        let alpha = ink + paint[3] * (1.0 - ink);
        let scale = 1.0 / alpha.max(1e-6);
        let channel = |i: usize| (INK[i] * ink + paint[i] * (1.0 - ink)) * scale;
        [channel(0), channel(1), channel(2), alpha]
    }

    /// Tint and light of a row of the field. A pass over the row for each step, so that the compiler can use vectors.
    fn field_row(&self, row: usize, buffers: &mut RowBuffers) {
        self.light(row, buffers);
        let heights = &self.field.z[row * self.field.width..][..self.field.width];
        buffers.pixels.clear();
        if let Some(colours) = self.colours {
            let [red_level, green_level, blue_level] = lighten(self.style.light.on(0.0, 0.0));
            let pixels = heights.iter().zip(&buffers.lit).enumerate();
            return buffers.pixels.extend(pixels.map(|(col, (z, &lit))| {
                let [red, green, blue, alpha] = colours.at(col, row).map(|v| f32::from(v) / 255.0);
                let paint = [red / red_level, green / green_level, blue / blue_level];
                painted(paint, lighten(lit), *z, alpha)
            }));
        }
        self.ridges(row, heights, buffers);
        let pixels = heights.iter().zip(&buffers.lit).zip(&buffers.ridges);
        buffers.pixels.extend(pixels.map(|((&z, &lit), &ridge)| {
            let tint = self.tint.colour(z);
            let shade = lighten(lit);
            painted([tint[0] * ridge, tint[1] * ridge, tint[2] * ridge], shade, z, 1.0)
        }));
    }

    /// Light on a row.
    fn light(&self, row: usize, buffers: &mut RowBuffers) {
        let RowBuffers { heights, lit, .. } = buffers;
        let width = self.field.width;
        for (line, heights) in
            [row.wrapping_sub(1), row, row + 1].into_iter().zip(heights.iter_mut())
        {
            heights.clear();
            heights.push(f32::NAN);
            match self.field.z.get(line.wrapping_mul(width)..).filter(|_| line < self.field.height)
            {
                Some(rest) => heights.extend_from_slice(&rest[..width]),
                None => heights.resize(width + 1, f32::NAN),
            }
            heights.push(f32::NAN);
        }
        let [east, north] = self.style.ground.map(|pixel| (self.style.exaggeration / pixel) as f32);
        let [above, here, below] = heights.each_ref().map(|line| &line[..width + 2]);
        lit.clear();
        lit.extend((0..width).map(|col| {
            let right = difference(here[col], here[col + 1], here[col + 2]);
            let up = -difference(above[col + 1], here[col + 1], below[col + 1]);
            self.style.light.on(right * east, up * north)
        }));
    }

    /// Factors on the colours of a row: ridges are lighter, valleys darker.
    fn ridges(&self, row: usize, heights: &[f32], buffers: &mut RowBuffers) {
        let RowBuffers { ground, ridges, .. } = buffers;
        let border = self.ground_row(row, ground);
        let scale = RIDGE / self.prominence;
        ridges.clear();
        ridges.extend(heights.iter().zip(&self.columns).map(|(&z, column)| {
            let above = height_above(z, ground, column, border) * scale;
            1.0 + above.clamp(-RIDGE, RIDGE)
        }));
    }

    /// The smoothed ground along a row of the field, as sums of heights and weights; returns the distance of the row
    /// from the border, in blocks.
    fn ground_row(&self, row: usize, out: &mut Vec<[f32; 2]>) -> f32 {
        let at = (self.blocks(row) - 0.5).clamp(0.0, self.ground.height as f64 - 1.0);
        let (upper, share) = (at as usize, at.fract() as f32);
        let weighted = |z: f32, weight: f32| {
            if z.is_nan() { [0.0; 2] } else { [z * weight, weight] }
        };
        out.clear();
        out.extend((0..=self.ground.width).map(|col| {
            let [z, weight] = weighted(self.ground.at(col, upper), 1.0 - share);
            let [below, part] = weighted(self.ground.at(col, upper + 1), share);
            [z + below, weight + part]
        }));
        self.blocks(row).min(self.blocks(self.field.height - 1 - row)) as f32
    }

    fn column(&self, col: usize) -> GroundColumn {
        let at = (self.blocks(col) - 0.5).clamp(0.0, self.ground.width as f64 - 1.0);
        let border = self.blocks(col).min(self.blocks(self.field.width - 1 - col)) as f32;
        GroundColumn { left: at as usize, share: at.fract() as f32, border }
    }

    /// The centre of a pixel from the border of the field, in blocks of the smoothed ground.
    fn blocks(&self, pixel: usize) -> f64 {
        (pixel as f64 + 0.5) / self.stride as f64
    }

    /// Twice the mean height above or below the smoothed ground; infinite when all is level.
    fn usual_prominence(&self) -> f32 {
        let step = self.field.z.len().div_ceil(1 << 16).max(1);
        let (mut sum, mut count) = (0.0f64, 0u64);
        let (mut ground, mut last, mut border) = (Vec::new(), usize::MAX, 0.0);
        for i in (0..self.field.z.len()).step_by(step) {
            let (z, row) = (self.field.z[i], i / self.field.width);
            if row != last {
                (last, border) = (row, self.ground_row(row, &mut ground));
            }
            if !z.is_nan() {
                let column = &self.columns[i % self.field.width];
                sum += f64::from(height_above(z, &ground, column, border).abs());
                count += 1;
            }
        }
        let mean = sum / count.max(1) as f64;
        if mean > 0.0 { 2.0 * mean as f32 } else { f32::INFINITY }
    }
}

/// Height above the smoothed ground, fading out towards the border, where the smoothing is one-sided; 0 where more than
/// half of the ground is void.
#[inline]
fn height_above(z: f32, ground: &[[f32; 2]], column: &GroundColumn, border: f32) -> f32 {
    let (left, right) = (ground[column.left], ground[column.left + 1]);
    let sum = left[0] + (right[0] - left[0]) * column.share;
    let weight = left[1] + (right[1] - left[1]) * column.share;
    let border = if column.border < border { column.border } else { border };
    let fading = (border / BORDER).min(1.0);
    if weight >= 0.5 { (z - sum / weight) * fading } else { 0.0 }
}

/// A pixel of the field, transparent where void.
#[inline]
fn painted(paint: [f32; 3], shade: [f32; 3], z: f32, opacity: f32) -> FieldPixel {
    let opacity = if z.is_nan() { 0.0 } else { opacity };
    let channel = |i: usize| if z.is_nan() { 0.0 } else { paint[i] * shade[i] * opacity };
    [channel(0), channel(1), channel(2), opacity]
}

/// Factors on red, green and blue for light `lit` (0 shadow, 0.5 level, 1 bright).
#[inline]
fn lighten(lit: f32) -> [f32; 3] {
    let (dark, light) = (2.0 * lit.min(0.5), 2.0 * lit.max(0.5) - 1.0);
    let factor =
        |i: usize| SHADOW[i] + (LEVEL[i] - SHADOW[i]) * dark + (BRIGHT[i] - LEVEL[i]) * light;
    [factor(0), factor(1), factor(2)]
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
