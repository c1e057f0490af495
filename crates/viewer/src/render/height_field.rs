//! A rectangle of heights to draw, and the ways to fill it from a grid.

/// Heights on a lattice of pixels, top row first; NaN where void.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureHeights {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` heights.
    pub z: Vec<f32>,
}

impl PictureHeights {
    /// A field without any surface.
    pub fn void(width: usize, height: usize) -> Self {
        Self { width, height, z: vec![f32::NAN; width * height] }
    }

    /// The height at (`col`, `row`), NaN outside.
    pub fn at(&self, col: usize, row: usize) -> f32 {
        if col < self.width && row < self.height {
            self.z[row * self.width + col]
        } else {
            f32::NAN
        }
    }

    /// The height between lattice positions, weighted over the valid ones of the four around it.
    /// NaN outside (half a position of margin is filled) or where more than half of the weight is
    /// void.
    #[inline]
    pub fn bilinear(&self, col: f64, row: f64) -> f32 {
        let (w, h) = (self.width as f64, self.height as f64);
        if !(col >= -0.5 && row >= -0.5 && col <= w - 0.5 && row <= h - 0.5) {
            return f32::NAN;
        }
        let (col, row) = (col.clamp(0.0, w - 1.0), row.clamp(0.0, h - 1.0));
        // Not negative, so casts round down.
        let (c, r) = (col as usize, row as usize);
        let (fc, fr) = ((col - c as f64) as f32, (row - r as f64) as f32);
        if c + 1 < self.width && r + 1 < self.height {
            let [upper, lower] = [r, r + 1].map(|row| &self.z[row * self.width + c..][..2]);
            let [upper, lower] = [upper, lower].map(|z| z[0] + (z[1] - z[0]) * fc);
            let mean = upper + (lower - upper) * fr;
            if !mean.is_nan() {
                return mean;
            }
        }
        weighted_mean([
            (self.at(c, r), (1.0 - fc) * (1.0 - fr)),
            (self.at(c + 1, r), fc * (1.0 - fr)),
            (self.at(c, r + 1), (1.0 - fc) * fr),
            (self.at(c + 1, r + 1), fc * fr),
        ])
    }

    /// Lowest and highest height; infinity and -infinity when all is void.
    pub fn range(&self) -> (f32, f32) {
        const LANES: usize = 16;
        let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        let (chunks, rest) = self.z.as_chunks::<LANES>();
        for chunk in chunks {
            for lane in 0..LANES {
                // Comparisons with NaN are false.
                low[lane] = if chunk[lane] < low[lane] { chunk[lane] } else { low[lane] };
                high[lane] = if chunk[lane] > high[lane] { chunk[lane] } else { high[lane] };
            }
        }
        let [low, high] = [low, high].map(|lanes| lanes.into_iter().chain(rest.iter().copied()));
        (low.fold(f32::INFINITY, f32::min), high.fold(f32::NEG_INFINITY, f32::max))
    }

    /// This field, coarser by `stride`: means of blocks of `stride * stride` heights.
    pub fn coarser(&self, stride: usize) -> Self {
        let mut out = Self::void(self.width.div_ceil(stride), self.height.div_ceil(stride));
        let bands = self.z.chunks(self.width * stride).zip(out.z.chunks_mut(out.width));
        bands.for_each(|(band, row)| average_rows(band, self.width, stride, row));
        out
    }
}

fn weighted_mean(parts: [(f32, f32); 4]) -> f32 {
    let valid = parts.iter().filter(|(z, _)| !z.is_nan());
    let (sum, weight) = valid.fold((0.0, 0.0), |(s, w), &(z, part)| (s + z * part, w + part));
    if weight >= 0.5 { sum / weight } else { f32::NAN }
}

/// Averages up to `stride` rows of `width` samples into one row of `width.div_ceil(stride)`
/// heights: each the mean of a block's valid samples, NaN when more than half of them are void.
pub fn average_rows(samples: &[f32], width: usize, stride: usize, out: &mut [f32]) {
    for (block, mean) in out.iter_mut().enumerate() {
        let (from, to) = (block * stride, ((block + 1) * stride).min(width));
        let (mut sum, mut valid, mut all) = (0.0f64, 0usize, 0usize);
        for row in samples.chunks_exact(width) {
            for &z in &row[from..to] {
                all += 1;
                if !z.is_nan() {
                    sum += f64::from(z);
                    valid += 1;
                }
            }
        }
        *mean = if valid * 2 >= all && valid > 0 { (sum / valid as f64) as f32 } else { f32::NAN };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averages_blocks_and_keeps_voids() {
        let nan = f32::NAN;
        let samples = [1.0, 3.0, nan, nan, 7.0, 5.0, 7.0, nan, 2.0, nan];
        let mut out = [0.0; 3];
        average_rows(&samples, 5, 2, &mut out);
        assert_eq!(out[0], 4.0);
        assert!(out[1].is_nan(), "one valid of four is void");
        assert_eq!(out[2], 7.0, "a partial block counts its own samples only");
    }

    #[test]
    fn bilinear_is_exact_on_a_plane_and_void_outside() {
        let z = (0..12).map(|i| (i % 4) as f32 * 2.0 + (i / 4) as f32).collect();
        let field = PictureHeights { width: 4, height: 3, z };
        assert_eq!(field.bilinear(1.5, 0.25), 3.25);
        assert_eq!(field.bilinear(-0.4, 2.0), 2.0);
        assert!(field.bilinear(3.6, 0.0).is_nan());
        assert!(field.bilinear(f64::NAN, 0.0).is_nan());
    }

    #[test]
    fn coarser_covers_partial_blocks() {
        let field = PictureHeights { width: 3, height: 3, z: vec![1.0; 9] };
        assert_eq!(field.coarser(2), PictureHeights { width: 2, height: 2, z: vec![1.0; 4] });
    }
}
